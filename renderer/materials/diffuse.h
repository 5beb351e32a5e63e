// Lambertian reflection and transmission.
#pragma once

#include <optional>

#include "renderer/core/random.h"
#include "renderer/core/warp.h"
#include "renderer/materials/bsdf_sample.h"

namespace woodcock {

/// Cosine-weighted direction with z of the sign of `side`.
inline Vec3 cosine_direction(Vec2 u, float side) {
  Vec3 w = square_to_cosine_hemisphere(u);
  w.z = std::copysign(w.z, side);
  return w;
}

/// Reflects `reflectance` ∈ [0, 1] of the light evenly in radiance, on both sides.
struct DiffuseBsdf {
  Rgb reflectance{0.5f};
};
inline Rgb eval(const DiffuseBsdf& b, Vec3 wo, Vec3 wi) {
  return same_hemisphere(wo, wi) ? b.reflectance * (kInvPi * abs_cos(wi)) : Rgb(0);
}
inline float pdf(const DiffuseBsdf&, Vec3 wo, Vec3 wi) { return same_hemisphere(wo, wi) ? kInvPi * abs_cos(wi) : 0; }
inline std::optional<BsdfSample> sample(const DiffuseBsdf& b, Vec3 wo, Stream& direction) {
  BsdfSample s;
  s.wi = cosine_direction(direction.uniform2(), wo.z);
  s.pdf = pdf(b, wo, s.wi);
  if (!(s.pdf > 0)) return std::nullopt;  // on the horizon
  s.weight = b.reflectance;
  return s;
}
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
