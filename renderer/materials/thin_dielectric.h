// A pane of glass as one surface.
#pragma once

#include <optional>

#include "renderer/core/random.h"
#include "renderer/materials/bsdf_sample.h"
#include "renderer/materials/fresnel.h"

namespace woodcock {

/// Two parallel smooth boundaries too close together to see apart. With R and T = 1 − R of one of them, all
/// orders of reflection between the two sum to R + T²R/(1 − R²) = 2R/(1 + R).
struct ThinDielectricBsdf {
  float eta = 1.5f;

  float reflectance(Vec3 wo) const {
    const float r = fresnel_dielectric(abs_cos(wo), eta);
    return 2 * r / (1 + r);
  }
};
inline Rgb eval(const ThinDielectricBsdf&, Vec3, Vec3) { return Rgb(0); }
inline float pdf(const ThinDielectricBsdf&, Vec3, Vec3) { return 0; }
inline std::optional<BsdfSample> sample(const ThinDielectricBsdf& b, Vec3 wo, Stream& direction) {
  BsdfSample s;
  s.transmission = direction.uniform() >= b.reflectance(wo);
  s.wi = s.transmission ? -wo : mirror(wo);
  s.weight = Rgb(1);
  s.specular = true;
  return s;
}
inline bool is_specular(const ThinDielectricBsdf&) { return true; }
inline Rgb albedo(const ThinDielectricBsdf&, Vec3) { return Rgb(1); }

}  // namespace woodcock
