// Measured scattering coefficients by name, and the albedo that gives a wanted diffuse reflectance.
#pragma once

#include <string>

#include "renderer/scene/description.h"

namespace woodcock {

/// Coefficients in 1/mm; the scattering coefficient is the reduced one σs′, to be used with g = 0.
struct ScatteringPreset {
  Rgb sigma_a, sigma_s;
};

/// Throws SceneError at `where`, listing the known names, for an unknown one.
/// Sources: Jensen, Marschner, Levoy, Hanrahan, "A Practical Model for Subsurface Light Transport" (2001), figure 5; Narasimhan, Gupta,
/// Donner, Ramamoorthi, Nayar, Jensen, "Acquiring Scattering Properties of Participating Media by Dilution" (2006).
ScatteringPreset scattering_preset(const std::string& name, const SourceLocation& where);

/// Single-scattering albedo σs/σt of a semi-infinite medium with refractive index `eta` and mean cosine `g` that has the total diffuse
/// reflectance `reflectance` in [0, 1]. Inverts R(α′) = α′/2 (1 + e^{-4/3 A √(3(1-α′))}) e^{-√(3(1-α′))} (Jensen et al. 2001, section 2.4,
/// with A from the diffuse Fresnel reflectance of the boundary) for the reduced albedo α′ by bisection, then undoes the similarity relation
/// α′ = (1-g)α/(1-gα). The formula is the classical dipole: at worst a few percent from a path-traced slab. pbrt-v4 inverts its photon beam
/// diffusion table.
float albedo_from_diffuse_reflectance(float reflectance, float eta, float g);

}  // namespace woodcock
