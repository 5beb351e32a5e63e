// The GGX (Trowbridge-Reitz) distribution of microfacet normals, with height-correlated Smith shadowing.
//
// Everything is written in l(w) = √(αx² x² + αy² y² + z²), the length of w stretched to the unit-roughness
// configuration: then Smith's G1 = 2|z| / (|z| + l) and the correlated G2 = 2|zo zi| / (lo |zi| + li |zo|) have no
// tangents, no differences, and no pole at grazing angles.
#pragma once

#include "renderer/core/vec.h"

namespace woodcock {

struct Ggx {
  float alpha_x = 0, alpha_y = 0;

  /// Below this roughness a surface counts as smooth, as in pbrt-v4.
  static constexpr float kSmooth = 1e-3f;

  /// Roughness as α; a rough surface keeps both α ≥ 1e-4 so that the distribution has a finite peak.
  static Ggx from_alpha(float x, float y) {
    if (std::fmax(x, y) < kSmooth) return {0, 0};
    return {std::fmax(x, 1e-4f), std::fmax(y, 1e-4f)};
  }
  bool smooth() const { return alpha_x == 0 && alpha_y == 0; }

  float stretched_length(Vec3 w) const {
    const float x = alpha_x * w.x, y = alpha_y * w.y;
    return std::sqrt(x * x + y * y + w.z * w.z);
  }

  /// Density of microfacet normals: ∫ D(m) m.z dm = 1.
  float d(Vec3 m) const {
    const float x = m.x / alpha_x, y = m.y / alpha_y;
    const float e = x * x + y * y + m.z * m.z;
    return 1 / (kPi * alpha_x * alpha_y * e * e);
  }

  /// G2(wo, wi) / (2 |wo.z|): what remains of G2/|cos θo| once poles are cancelled.
  float g2_over_2cos(Vec3 wo, Vec3 wi) const {
    const float zo = std::abs(wo.z), zi = std::abs(wi.z);
    const float denominator = stretched_length(wo) * zi + stretched_length(wi) * zo;
    return denominator > 0 ? zi / denominator : 0;
  }
  /// G2(wo, wi) / G1(wo), in [0, 1]: the weight of a sampled visible normal.
  float g2_over_g1(Vec3 wo, Vec3 wi) const { return g2_over_2cos(wo, wi) * (std::abs(wo.z) + stretched_length(wo)); }

  /// Density of `sample_visible`, G1(wo) |wo·m| D(m) / |wo.z|, without its factor |wo·m|.
  float visible_pdf_over_dot(Vec3 wo, Vec3 m) const { return 2 * d(m) / (std::abs(wo.z) + stretched_length(wo)); }

  /// A microfacet normal (z > 0) visible from wo (z ≥ 0), by spherical caps (Dupuy & Benyoub 2023, "Sampling
  /// Visible GGX Normals with Spherical Caps", listing 3). The third component of the half vector is formed as the
  /// product it is, so that it is never zero.
  Vec3 sample_visible(Vec3 wo, Vec2 u) const {
    const Vec3 v = glm::normalize(Vec3(alpha_x * wo.x, alpha_y * wo.y, wo.z));
    const float height = (1 - u.x) * (1 + v.z);  // z of the cap sample plus v.z
    const float sin2 = u.x * (1 + v.z) * (height + (1 - v.z));
    const float sin_theta = std::sqrt(std::fmax(sin2, 0.0f)), phi = 2 * kPi * u.y;
    const Vec3 h{sin_theta * std::cos(phi) + v.x, sin_theta * std::sin(phi) + v.y, height};
    return glm::normalize(Vec3(alpha_x * h.x, alpha_y * h.y, h.z));
  }
};

}  // namespace woodcock
