// The layered models whose walks have a sum in closed form: same light, no noise.
//
// **An absorbing coat over a diffuse base of albedo ρ.** Light that enters from wi reaches the base with the share t(wi), is
// reflected diffusely, and then leaves along wo or comes back to the base with the share Ri, whatever its history:
//
//   f(wo, wi) = f_coat(wo, wi) + t(wo) t(wi) / η² · ρ/π · Σ (ρ Ri)^k over k < ⌈max_depth / 2⌉
//
// with t and Ri of CoatTable and f_coat the microfacet reflection, or a mirror's delta lobe. Each order takes one scattering at the
// base and one at the coat, hence half of the depth. The sum over orders between a diffuse base and a boundary is Saunderson 1942,
// "Calculation of the Color of Pigmented Plastics".
//
// Samples: the coat's lobe with the probability R / (R + D), else a cosine lobe, R the coat's reflectance from wo and D the
// largest channel of what leaves from below. Weights of a smooth coat are then R + D, times t(wi) over its mean for the cosine lobe.
//
// **A smooth coat over a smooth metal**, nothing scattering between: a mirror of F + (1 − F)² x Σ (F x)^k over k < ⌈max_depth / 2⌉
// with x the metal's reflectance times what the layer leaves on the way there and back.
#pragma once

#include <optional>

#include "renderer/materials/layered.h"

namespace woodcock {

/// Only for models whose `closed_form()` is true. As the functions of the family in bsdf.h; without stochastic parts.
Rgb eval_closed_form(const CoatedDiffuseBsdf& b, Vec3 wo, Vec3 wi);
float pdf_closed_form(const CoatedDiffuseBsdf& b, Vec3 wo, Vec3 wi);
std::optional<BsdfSample> sample_closed_form(const CoatedDiffuseBsdf& b, Vec3 wo, Stream& direction);
/// Exact: all that is scattered to wo of light from everywhere.
Rgb albedo_closed_form(const CoatedDiffuseBsdf& b, Vec3 wo);

std::optional<BsdfSample> sample_closed_form(const CoatedConductorBsdf& b, Vec3 wo);
Rgb albedo_closed_form(const CoatedConductorBsdf& b, Vec3 wo);

}  // namespace woodcock
