// Fresnel's equations for unpolarised light, and refraction.
#pragma once

#include <optional>

#include "renderer/core/vec.h"

namespace woodcock {

/// Reflectance of a dielectric boundary for light that meets it at the angle whose cosine is `cos_i` ∈ [0, 1],
/// from the side of index 1 to the side of index `eta`. 1 under total internal reflection and at grazing
/// incidence; exactly 0 for eta = 1, whatever the angle.
///
/// The textbook numerators are differences of nearly equal numbers when eta is near 1. Multiplied by their
/// conjugates they factor, with s = sin²θi and η cos θt = √((η−1)(η+1) + cos²θi):
///   r⊥ = −(η−1)(η+1) / (cos θi + η cos θt)²
///   r∥ =  (η−1)(η+1)(η² − s(η²+1)) / (η² cos θi + η cos θt)²
inline float fresnel_dielectric(float cos_i, float eta) {
  if (eta == 1) return 0;
  const float c = std::fmin(std::fmax(cos_i, 0.0f), 1.0f), eta2 = eta * eta;
  const float d = (eta - 1) * (eta + 1);
  const float eta_cos_t_squared = d + c * c;
  if (eta_cos_t_squared <= 0) return 1;
  const float eta_cos_t = std::sqrt(eta_cos_t_squared), s = (1 - c) * (1 + c);
  const float a = c + eta_cos_t, b = eta2 * c + eta_cos_t;
  const float r_perpendicular = d / (a * a);
  const float r_parallel = d * (eta2 - s * (eta2 + 1)) / (b * b);
  return std::fmin(0.5f * (r_perpendicular * r_perpendicular + r_parallel * r_parallel), 1.0f);
}

/// wo refracted at a facet with unit normal m on wo's side (`cos_o` = wo·m > 0) into the side of relative index `eta`; empty
/// under total reflection.
inline std::optional<Vec3> refract(Vec3 wo, Vec3 m, float cos_o, float eta) {
  if (eta == 1) return -wo;
  const float eta_cos_t_squared = (eta - 1) * (eta + 1) + cos_o * cos_o;  // (η cos θt)², without cancellation
  if (!(eta_cos_t_squared > 0)) return std::nullopt;
  return glm::normalize((cos_o - std::sqrt(eta_cos_t_squared)) * m - wo);
}

/// Reflectance of a conductor of complex index eta + i·k (relative to the outside). In double: for k near 0
/// the formula takes differences.
inline float fresnel_conductor(float cos_i, float eta, float k) {
  const double c = std::fmin(std::fmax(static_cast<double>(cos_i), 0.0), 1.0), s = (1 - c) * (1 + c);
  const double n = static_cast<double>(eta), kk = static_cast<double>(k);
  // a + ib = √((n + ik)² − s), the normal component of the refracted wave.
  const double re = (n - kk) * (n + kk) - s, im = 2 * n * kk;
  const double modulus = std::hypot(re, im);
  const double a =
      re >= 0 ? std::sqrt(0.5 * (modulus + re)) : (modulus > re && modulus - re > 0 ? std::abs(im) / std::sqrt(2 * (modulus - re)) : 0.0);
  const double a2b2 = modulus;
  const double perpendicular_denominator = a2b2 + c * c + 2 * a * c;
  if (perpendicular_denominator <= 0) return 1;
  const double r_perpendicular = (a2b2 + c * c - 2 * a * c) / perpendicular_denominator;
  const double parallel_denominator = c * c * a2b2 + s * s + 2 * a * c * s;
  const double ratio = parallel_denominator > 0 ? (c * c * a2b2 + s * s - 2 * a * c * s) / parallel_denominator : 1.0;
  return static_cast<float>(std::fmin(std::fmax(0.5 * r_perpendicular * (1 + ratio), 0.0), 1.0));
}
inline Rgb fresnel_conductor(float cos_i, Rgb eta, Rgb k) {
  return {fresnel_conductor(cos_i, eta.r, k.r), fresnel_conductor(cos_i, eta.g, k.g), fresnel_conductor(cos_i, eta.b, k.b)};
}

}  // namespace woodcock
