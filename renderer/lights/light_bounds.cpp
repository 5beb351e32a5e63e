#include "renderer/lights/light_bounds.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace woodcock {
namespace {

/// A grazing direction may be lit better than the middle of the bounds suggests.
constexpr double kMinCosine = 0.05;
/// Of angles and lengths, for what rounding does to them.
constexpr double kMargin = 1e-6;

double sine_of(double cosine) { return std::sqrt(std::max(0.0, 1 - cosine * cosine)); }

struct Angle {
  double cosine, sine;
};

/// a − b, or 0 where b is larger.
Angle minus(Angle a, Angle b) {
  if (a.cosine > b.cosine) return {1, 0};
  return {a.cosine * b.cosine + a.sine * b.sine, a.sine * b.cosine - a.cosine * b.sine};
}

}  // namespace

double LightBounds::importance(DVec3 p) const {
  const DVec3 center = 0.5 * (lower + upper), half = upper - center, to = p - center;
  const DVec3 margin = kMargin * half + 1e-7 * glm::abs(center);
  const double radius2 = length_squared(half + margin), distance2 = length_squared(to);
  // Never infinite, and far below any distance that matters.
  constexpr double kMinSquare = 1e-60;
  if (!(distance2 > radius2)) return intensity / std::max(radius2, kMinSquare);
  double cosine = 1;
  if (axes.cos_angle > -1) {
    double along = std::clamp(glm::dot(axes.axis, to) / std::sqrt(distance2), -1.0, 1.0);
    if (two_sided) along = std::abs(along);
    const Angle seen{std::sqrt(1 - radius2 / distance2), std::sqrt(radius2 / distance2)};
    const Angle beyond = minus(minus({along, sine_of(along)}, {axes.cos_angle, sine_of(axes.cos_angle)}), seen);
    if (beyond.cosine < cos_emission - kMargin) return 0;
    cosine = std::max(beyond.cosine, kMinCosine);
  }
  return intensity * cosine / std::max(distance2, kMinSquare);
}

DirectionCone merged(const DirectionCone& a, const DirectionCone& b) {
  const auto angle = [](double cosine) { return std::acos(std::clamp(cosine, -1.0, 1.0)); };
  const double angle_a = angle(a.cos_angle), angle_b = angle(b.cos_angle), between = angle(glm::dot(a.axis, b.axis));
  if (between + angle_b <= angle_a) return a;
  if (between + angle_a <= angle_b) return b;
  const double all = (angle_a + between + angle_b) / 2;
  const DVec3 across = b.axis - glm::dot(a.axis, b.axis) * a.axis;
  const double length = glm::length(across);
  if (all >= std::numbers::pi || !(length > 1e-9)) return {};
  // From a's axis towards b's.
  const double turn = all - angle_a;
  return {glm::normalize(std::cos(turn) * a.axis + std::sin(turn) / length * across), std::cos(all) - kMargin * kMargin};
}

LightBounds merged(const LightBounds& a, const LightBounds& b) {
  LightBounds both;
  both.lower = glm::min(a.lower, b.lower);
  both.upper = glm::max(a.upper, b.upper);
  both.intensity = a.intensity + b.intensity;
  both.axes = merged(a.axes, b.axes);
  both.cos_emission = std::min(a.cos_emission, b.cos_emission);
  both.two_sided = a.two_sided || b.two_sided;
  return both;
}

}  // namespace woodcock
