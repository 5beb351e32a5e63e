// The closed family of surface scattering models and the functions every one of them has.
//
// Directions are unit vectors in the local shading frame (z = shading normal, x along dp/du) and point away
// from the surface. `wo` is where the path comes from, `wi` where it goes on: light travels from wi to wo.
// Densities are per solid angle. Values carry radiance, so that a transmission includes 1/η² (the squared ratio of the
// speeds of light; cancels when a path leaves the body again).
//
// A new model is a file pair with the five functions below, a name in `Bsdf`, and a case in
// `tests/materials/bsdf_cases.h`: the statistical tests then apply by themselves.
#pragma once

#include <optional>
#include <variant>

#include "renderer/core/random.h"
#include "renderer/core/vec.h"
#include "renderer/materials/bsdf_sample.h"
#include "renderer/materials/conductor.h"
#include "renderer/materials/dielectric.h"
#include "renderer/materials/diffuse.h"
#include "renderer/materials/layered.h"
#include "renderer/materials/thin_dielectric.h"

namespace woodcock {

/// Value types, small, without heap.
using Bsdf = std::variant<DiffuseBsdf, DiffuseTransmissionBsdf, ConductorBsdf, DielectricBsdf, ThinDielectricBsdf, CoatedDiffuseBsdf,
                          CoatedConductorBsdf>;

/// f(wo, wi)·|cos θi|; zero for delta lobes. For layered models without a closed form an unbiased estimate drawn from `layered`.
Rgb eval(const Bsdf& bsdf, Vec3 wo, Vec3 wi, Stream& layered);

/// The density that multiple importance sampling uses for `sample` to give wi; deterministic, and equal to
/// `BsdfSample::pdf` for sampled directions. Its integral is the probability of a sample that is not a delta. For layered
/// models without a closed form it is a proxy (see layered.h). Zero for delta lobes.
float pdf(const Bsdf& bsdf, Vec3 wo, Vec3 wi);

/// Draws wi. Empty where the model absorbs or a microfacet sends the ray into the surface: the path ends.
std::optional<BsdfSample> sample(const Bsdf& bsdf, Vec3 wo, Stream& direction, Stream& layered);

/// True when there are only delta lobes, so that sampling lights is pointless.
bool is_specular(const Bsdf& bsdf);

/// The fraction of light from a uniform environment that is scattered to wo, for the albedo AOV. Exact for
/// diffuse models and layered ones with a closed form, Fresnel reflectance at wo for conductors, 1 for dielectrics, and for other
/// layered ones the coat's reflectance over the bottom's albedo without multiple reflection between them.
Rgb albedo(const Bsdf& bsdf, Vec3 wo);

/// Layered models by walks, even where they have a closed form; other models stay as they are.
void use_walks(Bsdf& bsdf);

}  // namespace woodcock
