// Metals: smooth or GGX-rough surfaces of a complex index of refraction.
#pragma once

#include <optional>

#include "renderer/core/random.h"
#include "renderer/materials/bsdf_sample.h"
#include "renderer/materials/ggx.h"

namespace woodcock {

/// Index eta + i·k per channel, relative to the outside. Reflects on both sides. Rough surfaces count single
/// scattering between microfacets only, so they lose energy as roughness grows (as in pbrt-v4).
struct ConductorBsdf {
  Rgb eta{0.2f}, k{3.9f};
  Ggx roughness;
};
Rgb eval(const ConductorBsdf& b, Vec3 wo, Vec3 wi);
float pdf(const ConductorBsdf& b, Vec3 wo, Vec3 wi);
std::optional<BsdfSample> sample(const ConductorBsdf& b, Vec3 wo, Stream& direction);
inline bool is_specular(const ConductorBsdf& b) { return b.roughness.smooth(); }
Rgb albedo(const ConductorBsdf& b, Vec3 wo);

}  // namespace woodcock
