// Lambertian reflection and transmission.
#pragma once

#include <optional>

#include "renderer/core/random.h"
#include "renderer/materials/bsdf_sample.h"

namespace woodcock {

/// Reflects `reflectance` ∈ [0, 1] of the light evenly in radiance, on both sides.
struct DiffuseBsdf {
  Rgb reflectance{0.5f};
};
Rgb eval(const DiffuseBsdf& b, Vec3 wo, Vec3 wi);
float pdf(const DiffuseBsdf& b, Vec3 wo, Vec3 wi);
std::optional<BsdfSample> sample(const DiffuseBsdf& b, Vec3 wo, Stream& direction);
inline bool is_specular(const DiffuseBsdf&) { return false; }
inline Rgb albedo(const DiffuseBsdf& b, Vec3) { return b.reflectance; }

/// A thin sheet: reflects one part evenly and lets another part through evenly.
struct DiffuseTransmissionBsdf {
  Rgb reflectance{0.25f}, transmittance{0.25f};
};
Rgb eval(const DiffuseTransmissionBsdf& b, Vec3 wo, Vec3 wi);
float pdf(const DiffuseTransmissionBsdf& b, Vec3 wo, Vec3 wi);
std::optional<BsdfSample> sample(const DiffuseTransmissionBsdf& b, Vec3 wo, Stream& direction);
inline bool is_specular(const DiffuseTransmissionBsdf&) { return false; }
inline Rgb albedo(const DiffuseTransmissionBsdf& b, Vec3) { return b.reflectance + b.transmittance; }

}  // namespace woodcock
