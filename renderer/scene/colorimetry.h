// From spectra to linear Rec. 709 RGB.
//
// Woodcock carries three channels, pbrt-v4 carries wavelengths. A spectrum of a scene file is projected once, when the file is read, with
// the CIE 1931 two-degree observer tabulated at 5 nm from 380 to 780 nm:
//
//  - an illuminant e(λ) becomes RGB = M ∫ e(λ) (x̄, ȳ, z̄)(λ) dλ / ∫ ȳ(λ) dλ, M the XYZ → Rec. 709 matrix (white point D65); lights then
//  divide
//    by its luminance, as pbrt-v4 does, so only the chromaticity is left;
//  - a reflectance or a coefficient r(λ) becomes, per channel c, ∫ r(λ) D65(λ) c̄(λ) dλ / ∫ D65(λ) c̄(λ) dλ with c̄ = M (x̄, ȳ, z̄): what a D65
//  light
//    would show. A constant r gives exactly (r, r, r).
//
// Outside the wavelengths a file gives, a spectrum keeps its end value (pbrt-v4 takes zero there, which would tint constants).
// Colours outside the Rec. 709 gamut have a negative channel; it is set to zero, since radiance below zero cannot be sampled.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "renderer/core/vec.h"

namespace woodcock {

/// What a spectrum stands for decides how it is projected and which values are possible.
enum class SpectrumUse {
  kReflectance,  ///< within [0, 1]
  kUnbounded,    ///< non-negative: σ, η, k
  kIlluminant,   ///< non-negative; normalised to luminance 1 unless it was given as RGB
};

/// Wavelength in nm, increasing, with values; at least one.
using SampledSpectrum = std::vector<std::pair<double, double>>;

/// Value at `lambda` (nm), piecewise linear, ends extended.
double evaluate(const SampledSpectrum& spectrum, double lambda);
/// Projection for the given use, as described above.
Rgb project(const SampledSpectrum& spectrum, SpectrumUse use);

/// Linear Rec. 709 RGB of a CIE 1931 XYZ, negative channels set to zero.
Rgb xyz_to_rgb(DVec3 xyz);

/// Planck's law divided by its own maximum over wavelength; `lambda` in nm, `kelvin` > 0.
double normalized_planck(double lambda, double kelvin);
/// Chromaticity of a blackbody as RGB of luminance 1 (3000 K: 1.77 .84 .27). What a `blackbody` light emits. Zero for kelvin <= 0.
Rgb blackbody_rgb(float kelvin);
/// Emission of a temperature grid: a blackbody with peak 1, M ∫ B (x̄, ȳ, z̄) dλ, not divided by ∫ ȳ, as pbrt-v4 renders it (6500 K:
/// luminance about 97). Zero for kelvin <= 100, where pbrt-v4 too emits nothing. From a table (relative error below 1e-4); cheap enough for
/// inner loops.
Rgb blackbody_emission(float kelvin);

/// Indices of refraction and of absorption, per channel, of a metal known to pbrt-v4, e.g. "metal-Cu-eta"; nullopt when unknown.
std::optional<Rgb> named_coefficient(std::string_view name);
/// Index of refraction at 587.6 nm of a glass known to pbrt-v4, e.g. "glass-BK7"; nullopt when unknown.
std::optional<float> named_glass(std::string_view name);
/// RGB of luminance 1 of an illuminant known to pbrt-v4 ("stdillum-A", "stdillum-D65", …); nullopt when unknown.
std::optional<Rgb> named_illuminant(std::string_view name);
/// All names the three functions above know.
std::vector<std::string> named_spectra();

}  // namespace woodcock
