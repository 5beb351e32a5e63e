#include "renderer/geometry/refraction.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace woodcock {
namespace {

constexpr double kPi64 = std::numbers::pi;

/// Of the angle asin(c sin t), 0 ≤ c ≤ 1: its sine, its cosine, and its derivative by t.
struct Angle {
  double sine, cosine, slope;
  double value() const { return std::atan2(sine, cosine); }
};
Angle angle(double c, double sin_t, double cos_t) {
  const double s = c * sin_t, root = std::sqrt((1 - s) * (1 + s));
  // For c = 1 this is |cos t|, and the slope ±1 up to rounding.
  return {s, root, root > 0 ? c * cos_t / root : 1};
}

/// H as a function of t on one branch. Up to the angle of total reflection t is the angle of the refracted ray (sin t = ηa sin u), so that
/// H has a slope everywhere; where nothing is reflected totally t is u itself and the branch `kNear` goes from 0 to π.
class Arrival {
 public:
  Arrival(double eta, double a, double b) : reflects_(eta * a > 1) {
    const double s2 = reflects_ ? 1 : eta * a;
    u_ = reflects_ ? 1 / (eta * a) : 1;
    i_ = reflects_ ? 1 / eta : a;
    t_ = s2;
    y_ = s2 / b;
  }

  bool reflects() const { return reflects_; }

  /// A way: sines and cosines alone.
  struct Way {
    double slope;                     ///< dH/dt
    double sin_u, du;                 ///< du: du/dt
    double cos_azimuth, sin_azimuth;  ///< of v
    double cos_i, cos_t, cos_y;
  };
  Way near_way(double t) const { return way(t, reflects_ ? 1 : 0); }
  Way far_way(double t) const { return way(t, -1); }

  struct Value {
    double h, slope;
  };
  /// The cosine of H where total reflection begins, the end of the near side. H is between 0 and π there.
  double cos_near_end() const {
    const Way last = near_way(kPi64 / 2);
    // H = azimuth + π/2 − asin(sin y).
    const double sin_y = std::sqrt((1 - last.cos_y) * (1 + last.cos_y));
    return last.cos_azimuth * sin_y - last.sin_azimuth * last.cos_y;
  }
  /// A function that is zero where near's H is ψ, for |H − ψ| ≤ π, and its slope: H − ψ, or its tangent where that is small. The sum of the
  /// angles by products of e^(iα).
  Value near_offset(double t, double cos_psi, double sin_psi) const {
    const double s = std::sin(t), c = std::cos(t);
    double re = c * cos_psi + s * sin_psi, im = s * cos_psi - c * sin_psi, slope = 1;
    const auto turn = [&](double factor, double sign) {
      const double sine = factor * s, cosine = std::sqrt((1 - sine) * (1 + sine)), was = re;
      re = was * cosine - sign * im * sine;
      im = im * cosine + sign * was * sine;
      slope += sign * (cosine > 0 ? factor * c / cosine : 1);
    };
    turn(reflects_ ? u_ : t_, 1);
    turn(i_, -1);
    turn(y_, -1);
    if (!(re > std::abs(im))) return {std::atan2(im, re), slope};
    const double tangent = im / re;
    return {tangent, slope * (1 + tangent * tangent)};
  }

  /// u = π − asin(sin t / ηa), with t from 0 (u = π) to π/2 (total reflection).
  Value far(double t) const { return value(t, -1); }

  /// Where far(t) has its minimum; 0 where it has none. With w = cos t the slope has the sign of 1 − Σ c w/√(1 − c² + c² w²), which is
  /// convex and falls from 1 at w = 0: Newton's steps from there come nearer and never pass the zero.
  double minimum() const {
    if (u_ + i_ + y_ <= 1) return 0;
    double w = 0;
    for (int k = 0; k < 24; ++k) {
      double value = 1, slope = 0;
      for (const double c : {u_, i_, y_}) {
        const double rest = (1 - c) * (1 + c), square = rest + c * c * w * w, size = std::sqrt(square);
        value -= c * w / size;
        slope -= c * rest / (square * size);
      }
      const double step = -value / slope;
      // A term of c = 1 is a step at w = 0.
      if (!(step > 0x1p-26) || !std::isfinite(step)) break;
      w = std::min(1.0, w + step);
    }
    return std::acos(w);
  }

 private:
  struct Angles {
    Angle u, i, o, y;
    double slope() const { return u.slope - i.slope + o.slope - y.slope; }
  };
  /// `side`: 0 where u = t, else the sign of du/dt.
  Angles angles(double t, int side) const {
    const double s = std::sin(t), c = std::cos(t);
    const Angle itself{s, c, 1};
    Angles all{side == 0 ? itself : angle(u_, s, c), angle(i_, s, c), reflects_ ? itself : angle(t_, s, c), angle(y_, s, c)};
    if (side < 0) {
      all.u.cosine = -all.u.cosine;
      all.u.slope = -all.u.slope;
    }
    return all;
  }
  Value value(double t, int side) const {
    const Angles a = angles(t, side);
    return {a.u.value() - a.i.value() + a.o.value() - a.y.value(), a.slope()};
  }
  Way way(double t, int side) const {
    const Angles a = angles(t, side);
    return {a.slope(),  a.u.sine,   a.u.slope, a.u.cosine * a.i.cosine + a.u.sine * a.i.sine, a.u.sine * a.i.cosine - a.u.cosine * a.i.sine,
            a.i.cosine, a.o.cosine, a.y.cosine};
  }

  bool reflects_;
  double u_, i_, t_, y_;  ///< what sin t is multiplied by to give the sines of u, of both angles at v and of the angle at y
};

/// The root of h(t) = target between lo and hi, where h grows from below the target to above it, or the other way round: Newton's steps
/// from `t`, halved brackets where they lead out.
template <typename Function>
double root(Function&& h, double lo, double hi, bool grows, double t, double target) {
  for (int i = 0; i < 80; ++i) {
    const auto value = h(t);
    const double off = value.h - target;
    ((off < 0) == grows ? lo : hi) = t;
    double next = t - off / value.slope;
    const bool inside = next > lo && next < hi;
    // A step that leaves the bracket, or that is no number.
    if (!inside) next = 0.5 * (lo + hi);
    // The error of Newton's next step is of the size of the square of this one.
    if (next == lo || next == hi || std::abs(next - t) <= (inside ? 0x1p-30 : 0x1p-52) * t) return next;
    t = next;
  }
  return t;
}

}  // namespace

RefractedWays refracted_ways(const Sphere& sphere, double eta, DVec3 x, DVec3 y, double longest) {
  RefractedWays result;
  const double r = sphere.radius;
  const DVec3 from = (x - sphere.center) / r, to = (y - sphere.center) / r;
  const double a = glm::length(from), b = glm::length(to);
  if (!(a < 1 && b > 1)) return result;
  // The plane of the way: `axis` through x, `across` on the side of y.
  const DVec3 axis = a > 1e-12 ? from / a : to / b;
  const DVec3 normal = glm::cross(axis, to);
  const bool on_axis = !(a > 1e-12);
  const double sin_psi = on_axis ? 0 : glm::length(normal) / b, cos_psi = on_axis ? 1 : glm::dot(axis, to) / b;
  DVec3 across = glm::cross(normal, axis);
  if (const double length = glm::length(across); length > 0)
    across /= length;
  else
    across = glm::normalize(glm::cross(axis, std::abs(axis.x) < 0.5 ? DVec3(1, 0, 0) : DVec3(0, 1, 0)));

  const Arrival arrival(eta, a, b);
  const auto add = [&](const Arrival::Way& found, double side) {
    if (result.count == RefractedWays::kCapacity) return;
    RefractedWay way;
    const DVec3 n = found.cos_azimuth * axis + side * found.sin_azimuth * across;
    way.v = sphere.center + r * n;
    way.wi = glm::normalize(n - from);
    way.wo = glm::normalize(to - n);
    way.cos_i = found.cos_i;
    way.cos_t = found.cos_t;
    // du/dH, and sin u over sin ψ, which on the axis has the same limit.
    const double rate = std::abs(found.du / found.slope);
    const double ring = found.sin_u < 1e-7 && sin_psi < 1e-5 ? rate : found.sin_u / sin_psi;
    way.solid_angle_per_area = ring * rate / (b * b * found.cos_y * r * r);
    if (glm::dot(way.wo, n) > 0) result.ways[result.count++] = way;
  };
  const auto near_offset = [&](double t) { return arrival.near_offset(t, cos_psi, sin_psi); };
  const auto far = [&](double t) { return arrival.far(t); };
  if (!arrival.reflects()) {
    add(arrival.near_way(root(near_offset, 0, kPi64, true, std::atan2(sin_psi, cos_psi), 0)), 1);
    return result;
  }
  constexpr double kHalf = kPi64 / 2;
  if (const double cos_last = arrival.cos_near_end(); cos_psi >= cos_last) {
    // The share of ψ in the angle at the end, by chords.
    const double share = std::sqrt((1 - cos_psi) / (1 - cos_last));
    add(arrival.near_way(root(near_offset, 0, kHalf, true, kHalf * share, 0)), 1);
  }
  // On the far side sin u ≤ 1/(ηa) and cos u < 0, so that no way is shorter than this.
  const double across_all = std::sqrt((1 - 1 / eta) * (1 + 1 / eta)) + std::sqrt((a - 1 / eta) * (a + 1 / eta));
  if (across_all * r > longest) return result;
  const double psi = std::atan2(sin_psi, cos_psi);
  const double lowest = arrival.minimum(), least = lowest > 0 ? far(lowest).h : kPi64, last = far(kHalf).h;
  const auto middle = [](double lo, double hi) { return 0.5 * (lo + hi); };
  if (lowest > 0 && psi >= least) add(arrival.far_way(root(far, 0, lowest, false, middle(0, lowest), psi)), 1);
  if (psi >= least && psi <= last) add(arrival.far_way(root(far, lowest, kHalf, true, middle(lowest, kHalf), psi)), 1);
  const double other = 2 * kPi64 - psi;
  if (other <= last) add(arrival.far_way(root(far, lowest, kHalf, true, middle(lowest, kHalf), other)), -1);
  return result;
}

}  // namespace woodcock
