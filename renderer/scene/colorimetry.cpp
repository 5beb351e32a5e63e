#include "renderer/scene/colorimetry.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace woodcock {

namespace {

constexpr int kSamples = 81;
constexpr double kFirst = 380, kStep = 5;

// CIE 1931 two-degree colour matching functions (CIE 015), 380 to 780 nm in steps of 5 nm: x̄, ȳ, z̄.
constexpr std::array<std::array<double, 3>, kSamples> kObserver{{
    {0.0014, 0.0000, 0.0065}, {0.0022, 0.0001, 0.0105}, {0.0042, 0.0001, 0.0201}, {0.0076, 0.0002, 0.0362}, {0.0143, 0.0004, 0.0679},
    {0.0232, 0.0006, 0.1102}, {0.0435, 0.0012, 0.2074}, {0.0776, 0.0022, 0.3713}, {0.1344, 0.0040, 0.6456}, {0.2148, 0.0073, 1.0391},
    {0.2839, 0.0116, 1.3856}, {0.3285, 0.0168, 1.6230}, {0.3483, 0.0230, 1.7471}, {0.3481, 0.0298, 1.7826}, {0.3362, 0.0380, 1.7721},
    {0.3187, 0.0480, 1.7441}, {0.2908, 0.0600, 1.6692}, {0.2511, 0.0739, 1.5281}, {0.1954, 0.0910, 1.2876}, {0.1421, 0.1126, 1.0419},
    {0.0956, 0.1390, 0.8130}, {0.0580, 0.1693, 0.6162}, {0.0320, 0.2080, 0.4652}, {0.0147, 0.2586, 0.3533}, {0.0049, 0.3230, 0.2720},
    {0.0024, 0.4073, 0.2123}, {0.0093, 0.5030, 0.1582}, {0.0291, 0.6082, 0.1117}, {0.0633, 0.7100, 0.0782}, {0.1096, 0.7932, 0.0573},
    {0.1655, 0.8620, 0.0422}, {0.2257, 0.9149, 0.0298}, {0.2904, 0.9540, 0.0203}, {0.3597, 0.9803, 0.0134}, {0.4334, 0.9950, 0.0087},
    {0.5121, 1.0000, 0.0057}, {0.5945, 0.9950, 0.0039}, {0.6784, 0.9786, 0.0027}, {0.7621, 0.9520, 0.0021}, {0.8425, 0.9154, 0.0018},
    {0.9163, 0.8700, 0.0017}, {0.9786, 0.8163, 0.0014}, {1.0263, 0.7570, 0.0011}, {1.0567, 0.6949, 0.0010}, {1.0622, 0.6310, 0.0008},
    {1.0456, 0.5668, 0.0006}, {1.0026, 0.5030, 0.0003}, {0.9384, 0.4412, 0.0002}, {0.8544, 0.3810, 0.0002}, {0.7514, 0.3210, 0.0001},
    {0.6424, 0.2650, 0.0000}, {0.5419, 0.2170, 0.0000}, {0.4479, 0.1750, 0.0000}, {0.3608, 0.1382, 0.0000}, {0.2835, 0.1070, 0.0000},
    {0.2187, 0.0816, 0.0000}, {0.1649, 0.0610, 0.0000}, {0.1212, 0.0446, 0.0000}, {0.0874, 0.0320, 0.0000}, {0.0636, 0.0232, 0.0000},
    {0.0468, 0.0170, 0.0000}, {0.0329, 0.0119, 0.0000}, {0.0227, 0.0082, 0.0000}, {0.0158, 0.0057, 0.0000}, {0.0114, 0.0041, 0.0000},
    {0.0081, 0.0029, 0.0000}, {0.0058, 0.0021, 0.0000}, {0.0041, 0.0015, 0.0000}, {0.0029, 0.0010, 0.0000}, {0.0020, 0.0007, 0.0000},
    {0.0014, 0.0005, 0.0000}, {0.0010, 0.0004, 0.0000}, {0.0007, 0.0002, 0.0000}, {0.0005, 0.0002, 0.0000}, {0.0003, 0.0001, 0.0000},
    {0.0002, 0.0001, 0.0000}, {0.0002, 0.0001, 0.0000}, {0.0001, 0.0000, 0.0000}, {0.0001, 0.0000, 0.0000}, {0.0001, 0.0000, 0.0000},
    {0.0000, 0.0000, 0.0000},
}};

// CIE standard illuminant D65, relative power, 380 to 780 nm in steps of 10 nm.
constexpr std::array<double, 41> kD65{49.98,  54.65,  82.75,  91.49,  93.43,  86.68,  104.86, 117.01, 117.81, 114.86, 115.92,
                                      108.81, 109.35, 107.80, 104.79, 107.69, 104.41, 104.05, 100.00, 96.33,  95.79,  88.69,
                                      90.01,  89.60,  87.70,  83.29,  83.70,  80.03,  80.21,  82.28,  78.28,  69.72,  71.61,
                                      74.35,  61.60,  69.89,  75.09,  63.59,  46.42,  66.81,  63.38};

double wavelength(int i) { return kFirst + kStep * i; }
double d65(int i) { return i % 2 == 0 ? kD65[i / 2] : 0.5 * (kD65[i / 2] + kD65[i / 2 + 1]); }

// IEC 61966-2-1: Rec. 709 primaries, D65 white.
DVec3 rgb_from_xyz(const DVec3& c) {
  return {3.2404542 * c.x - 1.5371385 * c.y - 0.4985314 * c.z, -0.9692660 * c.x + 1.8760108 * c.y + 0.0415560 * c.z,
          0.0556434 * c.x - 0.2040259 * c.y + 1.0572252 * c.z};
}

/// ∫ value(i) (x̄, ȳ, z̄) dλ
template <typename Function>
DVec3 integrate(const Function& value) {
  DVec3 sum(0);
  for (int i = 0; i < kSamples; ++i) sum += value(i) * DVec3(kObserver[i][0], kObserver[i][1], kObserver[i][2]);
  return kStep * sum;
}

DVec3 clamp_to_gamut(const DVec3& c) { return glm::max(c, DVec3(0)); }

/// Scaled to luminance 1. Luminance is measured before the gamut is clamped: it is ∫ e ȳ, which pbrt-v4 divides by.
Rgb unit_luminance(const DVec3& xyz) { return xyz.y > 0 ? Rgb(clamp_to_gamut(rgb_from_xyz(xyz / xyz.y))) : Rgb(0); }

DVec3 blackbody_xyz(double kelvin) {
  return integrate([&](int i) { return normalized_planck(wavelength(i), kelvin); });
}

}  // namespace

Rgb xyz_to_rgb(DVec3 xyz) { return Rgb(clamp_to_gamut(rgb_from_xyz(xyz))); }

double evaluate(const SampledSpectrum& spectrum, double lambda) {
  if (lambda <= spectrum.front().first) return spectrum.front().second;
  if (lambda >= spectrum.back().first) return spectrum.back().second;
  const auto above =
      std::upper_bound(spectrum.begin(), spectrum.end(), lambda, [](double l, const auto& sample) { return l < sample.first; });
  const auto below = above - 1;
  const double t = (lambda - below->first) / (above->first - below->first);
  return (1 - t) * below->second + t * above->second;
}

Rgb project(const SampledSpectrum& spectrum, SpectrumUse use) {
  const auto value = [&](int i) { return evaluate(spectrum, wavelength(i)); };
  if (use == SpectrumUse::kIlluminant) return unit_luminance(integrate(value));
  const double first = spectrum.front().second;
  if (std::all_of(spectrum.begin(), spectrum.end(), [&](const auto& sample) { return sample.second == first; }))
    return Rgb(static_cast<float>(first));
  const DVec3 lit = rgb_from_xyz(integrate([&](int i) { return value(i) * d65(i); }));
  const DVec3 white = rgb_from_xyz(integrate(d65));
  const DVec3 rgb = clamp_to_gamut(lit / white);
  return use == SpectrumUse::kReflectance ? Rgb(glm::min(rgb, DVec3(1))) : Rgb(rgb);
}

double normalized_planck(double lambda, double kelvin) {
  // Second radiation constant in nm·K and Wien's displacement constant in the same units (CODATA 2018).
  constexpr double kC2 = 1.438776877e7, kWien = 2.897771955e6;
  const double peak = kWien / kelvin;
  const double ratio = peak / lambda;
  // expm1 keeps the Rayleigh-Jeans end exact; an overflow there means zero.
  return std::pow(ratio, 5) * std::expm1(kC2 / kWien) / std::expm1(kC2 / (lambda * kelvin));
}

Rgb blackbody_rgb(float kelvin) {
  if (!(kelvin > 0)) return Rgb(0);
  return unit_luminance(blackbody_xyz(kelvin));
}

namespace {

/// log RGB over temperatures in geometric steps.
struct EmissionTable {
  static constexpr int kEntries = 4096;
  static constexpr double kCold = 100, kHot = 1e6;
  std::array<Rgb, kEntries + 1> log_rgb;

  EmissionTable() {
    for (int i = 0; i <= kEntries; ++i) {
      const DVec3 rgb = clamp_to_gamut(rgb_from_xyz(blackbody_xyz(kelvin(i))));
      // Channels are interpolated as logarithms, since they fall exponentially in 1/T; a channel out of gamut counts as e^-80.
      for (int c = 0; c < 3; ++c) log_rgb[i][c] = static_cast<float>(rgb[c] > 1e-35 ? std::log(rgb[c]) : -80.0);
    }
  }
  static double kelvin(int i) { return kCold * std::pow(kHot / kCold, static_cast<double>(i) / kEntries); }
};

}  // namespace

Rgb blackbody_emission(float kelvin) {
  static const EmissionTable table;
  if (!(kelvin > 100)) return Rgb(0);
  static const float scale = static_cast<float>(EmissionTable::kEntries / std::log(EmissionTable::kHot / EmissionTable::kCold));
  const float x =
      std::fmin(std::log(kelvin / static_cast<float>(EmissionTable::kCold)) * scale, static_cast<float>(EmissionTable::kEntries));
  const int i = std::min(static_cast<int>(x), EmissionTable::kEntries - 1);
  const float t = x - static_cast<float>(i);
  Rgb rgb;
  for (int c = 0; c < 3; ++c) {
    const float l = (1 - t) * table.log_rgb[i][c] + t * table.log_rgb[i + 1][c];
    rgb[c] = l > -79 ? std::exp(l) : 0.0f;
  }
  return rgb;
}

}  // namespace woodcock
