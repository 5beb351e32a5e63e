#include "renderer/accuracy/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace woodcock {

namespace {

using Triple = std::array<double, 3>;

// sRGB primaries and the D65 white that the papers use, as the fractions of the sRGB standard's chromaticities.
constexpr Triple kWhite = {0.950428545, 1, 1.088900371};

Triple xyz_of(const Triple& rgb) {
  const auto& [r, g, b] = rgb;
  return {(10135552 * r + 8788810 * g + 4435075 * b) / 24577794, (2613072 * r + 8788810 * g + 887015 * b) / 12288897,
          (1425312 * r + 8788810 * g + 70074185 * b) / 73733382};
}

Triple rgb_of(const Triple& xyz) {
  const auto& [x, y, z] = xyz;
  return {3.241003275 * x - 1.537398934 * y - 0.498615861 * z, -0.969224334 * x + 1.875930071 * y + 0.041554224 * z,
          0.055639423 * x - 0.204011202 * y + 1.057148933 * z};
}

/// The opponent space Y'CxCz, linear in colour: L*a*b* without its cube root.
Triple ycxcz_of(const Triple& rgb) {
  const Triple t = xyz_of(rgb);
  const double x = t[0] / kWhite[0], y = t[1] / kWhite[1], z = t[2] / kWhite[2];
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

Triple rgb_of_ycxcz(const Triple& c) {
  const double y = (c[0] + 16) / 116;
  return rgb_of({(y + c[1] / 500) * kWhite[0], y * kWhite[1], (y - c[2] / 200) * kWhite[2]});
}

constexpr double kDelta = 6.0 / 29;

Triple lab_of(const Triple& rgb) {
  Triple t = xyz_of(rgb);
  for (size_t i = 0; i < 3; ++i) {
    const double v = t[i] / kWhite[i];
    t[i] = v > kDelta * kDelta * kDelta ? std::cbrt(v) : v / (3 * kDelta * kDelta) + 4.0 / 29;
  }
  return {116 * t[1] - 16, 500 * (t[0] - t[1]), 200 * (t[1] - t[2])};
}

Triple rgb_of_lab(const Triple& lab) {
  const double y = (lab[0] + 16) / 116;
  Triple t = {y + lab[1] / 500, y, y - lab[2] / 200};
  for (size_t i = 0; i < 3; ++i) t[i] = kWhite[i] * (t[i] > kDelta ? t[i] * t[i] * t[i] : 3 * kDelta * kDelta * (t[i] - 4.0 / 29));
  return rgb_of(t);
}

/// Colours look more colourful in bright light (Hunt): chroma scaled by lightness.
Triple hunt_adjusted(const Triple& lab) { return {lab[0], 0.01 * lab[0] * lab[1], 0.01 * lab[0] * lab[2]}; }

double hyab(const Triple& a, const Triple& b) { return std::abs(a[0] - b[0]) + std::hypot(a[1] - b[1], a[2] - b[2]); }

using Planes = std::array<Plane, 3>;

Planes opponent_planes(const Picture& picture) {
  Planes planes{Plane(picture.width, picture.height), Plane(picture.width, picture.height), Plane(picture.width, picture.height)};
  for (size_t i = 0; i < picture.pixels.size(); ++i) {
    const Rgb& p = picture.pixels[i];
    const Triple c = ycxcz_of({static_cast<double>(p.r), static_cast<double>(p.g), static_cast<double>(p.b)});
    for (size_t k = 0; k < 3; ++k) planes[k].values[i] = c[k];
  }
  return planes;
}

/// A contrast sensitivity function in space: Σ a·sqrt(π/b)·exp(−π²·d²/b) with d in degrees (2020, table 1 and eq. 3).
struct Sensitivity {
  double a1, b1, a2, b2;
};
constexpr std::array<Sensitivity, 3> kSensitivities = {{{1, 0.0047, 0, 1e-5}, {1, 0.0053, 0, 1e-5}, {34.1, 0.04, 13.5, 0.025}}};
constexpr double kMaxB = 0.04;

Plane contrast_filtered(const Plane& plane, const Sensitivity& s, double pixels_per_degree) {
  constexpr double kPi = 3.14159265358979323846;
  const int radius = static_cast<int>(std::ceil(3 * std::sqrt(kMaxB / (2 * kPi * kPi)) * pixels_per_degree));
  const auto gauss = [&](double b) {
    return sample_filter(radius, [&](int i) { return std::exp(-kPi * kPi * i * i / (pixels_per_degree * pixels_per_degree * b)); });
  };
  const std::vector<double> first = gauss(s.b1), second = gauss(s.b2);
  // The weight of a separable Gaussian in the sum is its value at 0 times the square of its one-dimensional sum.
  const double sum1 = std::accumulate(first.begin(), first.end(), 0.0), sum2 = std::accumulate(second.begin(), second.end(), 0.0);
  const double w1 = s.a1 * std::sqrt(kPi / s.b1) * sum1 * sum1, w2 = s.a2 * std::sqrt(kPi / s.b2) * sum2 * sum2;
  Plane result = filtered(plane, normalised(first), normalised(first));
  if (w2 == 0) return result;
  const Plane other = filtered(plane, normalised(second), normalised(second));
  for (size_t i = 0; i < result.values.size(); ++i) result.values[i] = (w1 * result.values[i] + w2 * other.values[i]) / (w1 + w2);
  return result;
}

/// The picture as the eye resolves it, in Hunt-adjusted L*a*b*.
std::vector<Triple> perceived_colours(const Planes& opponent, double pixels_per_degree) {
  const Planes f{contrast_filtered(opponent[0], kSensitivities[0], pixels_per_degree),
                 contrast_filtered(opponent[1], kSensitivities[1], pixels_per_degree),
                 contrast_filtered(opponent[2], kSensitivities[2], pixels_per_degree)};
  std::vector<Triple> colours;
  for (size_t i = 0; i < f[0].values.size(); ++i) {
    Triple rgb = rgb_of_ycxcz({f[0].values[i], f[1].values[i], f[2].values[i]});
    for (double& v : rgb) v = std::clamp(v, 0.0, 1.0);
    colours.push_back(hunt_adjusted(lab_of(rgb)));
  }
  return colours;
}

/// Scales the negative weights to sum to −1 and the positive ones to 1.
std::vector<double> balanced(std::vector<double> filter) {
  double positive = 0, negative = 0;
  for (const double w : filter) (w > 0 ? positive : negative) += std::abs(w);
  for (double& w : filter) w /= w > 0 ? positive : negative;
  return filter;
}

struct Features {
  Plane edges, points;  ///< strengths
};

/// Strength of edges and points: first and second derivative of a Gaussian as wide as the eye's edge detector (2020, sec. 4.2).
Features detect_features(const Plane& opponent_y, double pixels_per_degree) {
  const double sd = 0.5 * 0.082 * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3 * sd));
  const auto g = [&](int i) { return std::exp(-i * i / (2 * sd * sd)); };
  const auto smooth = normalised(sample_filter(radius, g));
  const auto edge = balanced(sample_filter(radius, [&](int i) { return i == 0 ? 0.0 : -i * g(i); }));
  const auto point = balanced(sample_filter(radius, [&](int i) { return (i * i / (sd * sd) - 1) * g(i); }));
  Plane y = opponent_y;
  for (double& v : y.values) v = (v + 16) / 116;
  const auto strength = [&](const std::vector<double>& derivative) {
    Plane result = filtered(y, derivative, smooth);
    const Plane vertical = filtered(y, smooth, derivative);
    for (size_t i = 0; i < result.values.size(); ++i) result.values[i] = std::hypot(result.values[i], vertical.values[i]);
    return result;
  };
  return {strength(edge), strength(point)};
}

/// Spreads colour differences over [0, 1]: most of it for those up to two fifths of the largest (2020, eq. 8).
double redistributed(double power, double largest) {
  constexpr double pc = 0.4, pt = 0.95;
  const double knee = pc * largest;
  return power < knee ? pt / knee * power : pt + (power - knee) / (largest - knee) * (1 - pt);
}

// The tone mapper of HDR-FLIP, an approximation of ACES, as (k0·x² + k1·x)/(k3·x² + k4·x + k5).
constexpr double kTone[6] = {0.6 * 0.6 * 2.51, 0.6 * 0.03, 0, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14};

double tone_mapped(double v) {
  const double y = (kTone[0] * v * v + kTone[1] * v) / (kTone[3] * v * v + kTone[4] * v + kTone[5]);
  return std::isfinite(y) ? std::clamp(y, 0.0, 1.0) : 1;
}

Picture exposed(const Picture& picture, double exposure) {
  Picture result = picture;
  const double scale = std::exp2(exposure);
  for (Rgb& pixel : result.pixels)
    for (int c = 0; c < 3; ++c) pixel[c] = static_cast<float>(tone_mapped(scale * std::max(0.0, static_cast<double>(pixel[c]))));
  return result;
}

/// The middle value, or the mean of the two middle ones.
double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return values.size() % 2 == 1 ? *middle : 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

}  // namespace

Plane flip_ldr(const Picture& reference, const Picture& test, double pixels_per_degree) {
  const Planes a = opponent_planes(reference), b = opponent_planes(test);
  const auto colours_a = perceived_colours(a, pixels_per_degree), colours_b = perceived_colours(b, pixels_per_degree);
  const Features fa = detect_features(a[0], pixels_per_degree), fb = detect_features(b[0], pixels_per_degree);
  constexpr double qc = 0.7, qf = 0.5;
  const double largest = std::pow(hyab(hunt_adjusted(lab_of({0, 1, 0})), hunt_adjusted(lab_of({0, 0, 1}))), qc);
  Plane map(reference.width, reference.height);
  for (size_t i = 0; i < map.values.size(); ++i) {
    const double colour = redistributed(std::pow(hyab(colours_a[i], colours_b[i]), qc), largest);
    const double feature = std::max(std::abs(fa.edges.values[i] - fb.edges.values[i]), std::abs(fa.points.values[i] - fb.points.values[i]));
    map.values[i] = std::pow(colour, 1 - std::pow(feature / std::sqrt(2.0), qf));
  }
  return map;
}

HdrFlip flip_hdr(const Picture& reference, const Picture& test, double pixels_per_degree) {
  std::vector<double> luminances, lit;
  for (const Rgb& pixel : reference.pixels) luminances.push_back(std::max(0.0, static_cast<double>(luminance(pixel))));
  std::copy_if(luminances.begin(), luminances.end(), std::back_inserter(lit), [](double y) { return y > 0; });
  HdrFlip result{Plane(reference.width, reference.height), 0, 0, 1};
  if (!lit.empty()) {
    // The luminance that the tone mapper shows as 0.85 (2021, sec. 3.2): the larger root of a quadratic equation.
    constexpr double t = 0.85, p = (kTone[1] - kTone[4] * t) / (kTone[0] - kTone[3] * t), q = -kTone[5] * t / (kTone[0] - kTone[3] * t);
    const double x = -0.5 * p + std::sqrt(0.25 * p * p - q), middle = median(luminances);
    result.start = std::log2(x / *std::max_element(lit.begin(), lit.end()));
    result.stop = std::log2(x / (middle > 0 ? middle : median(lit)));
    result.count = std::max(2, static_cast<int>(std::ceil(result.stop - result.start)));
  }
  for (int i = 0; i < result.count; ++i) {
    const double exposure = result.start + i * (result.stop - result.start) / std::max(1, result.count - 1);
    const Plane map = flip_ldr(exposed(reference, exposure), exposed(test, exposure), pixels_per_degree);
    for (size_t k = 0; k < map.values.size(); ++k) result.map.values[k] = std::max(result.map.values[k], map.values[k]);
  }
  return result;
}

double mean_of(const Plane& plane) {
  return std::accumulate(plane.values.begin(), plane.values.end(), 0.0) / static_cast<double>(plane.values.size());
}

Rgb error_colour(double error) {
  // Chroma and hue angle (degrees) at L* = 0, 25, 50, 75, 97: violet-blue, magenta-red, orange, yellow, nearly white.
  constexpr double kChroma[] = {0, 45, 62, 60, 12}, kHue[] = {-65, -50, 10, 65, 95}, kAt[] = {0, 0.25, 0.5, 0.77, 1};
  const double e = std::clamp(error, 0.0, 1.0);
  size_t i = 0;
  while (i < 3 && e > kAt[i + 1]) ++i;
  const double t = (e - kAt[i]) / (kAt[i + 1] - kAt[i]);
  const double chroma = std::lerp(kChroma[i], kChroma[i + 1], t), hue = std::lerp(kHue[i], kHue[i + 1], t) * 3.14159265358979323846 / 180;
  const Triple rgb = rgb_of_lab({97 * e, chroma * std::cos(hue), chroma * std::sin(hue)});
  Rgb colour;
  for (int c = 0; c < 3; ++c) colour[c] = static_cast<float>(std::clamp(rgb[static_cast<size_t>(c)], 0.0, 1.0));
  return colour;
}

Picture error_picture(const Plane& map) {
  Picture picture{map.width, map.height, {}};
  for (const double v : map.values) picture.pixels.push_back(error_colour(v));
  return picture;
}

}  // namespace woodcock
