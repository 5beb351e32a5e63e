#include "renderer/materials/conductor.h"

#include "renderer/materials/fresnel.h"

namespace woodcock {

namespace {

/// The half vector turned to z ≥ 0, or empty where wo and wi are opposite (or all but).
std::optional<Vec3> half_vector(Vec3 wo, Vec3 wi) {
  const Vec3 h = wo + wi;
  const float length = glm::length(h);
  if (!(length > 0)) return std::nullopt;
  return h * (std::copysign(1.0f, h.z) / length);
}

}  // namespace

Rgb eval(const ConductorBsdf& b, Vec3 wo, Vec3 wi) {
  if (b.roughness.smooth() || !same_hemisphere(wo, wi)) return Rgb(0);
  const std::optional<Vec3> m = half_vector(wo, wi);
  if (!m) return Rgb(0);
  // f cos θi = D F G2 / (4 cos θo)
  const float dg = 0.5f * b.roughness.d(*m) * b.roughness.g2_over_2cos(wo, wi);
  return fresnel_conductor(std::abs(glm::dot(wo, *m)), b.eta, b.k) * dg;
}

float pdf(const ConductorBsdf& b, Vec3 wo, Vec3 wi) {
  if (b.roughness.smooth() || !same_hemisphere(wo, wi)) return 0;
  const std::optional<Vec3> m = half_vector(wo, wi);
  return m ? 0.25f * b.roughness.visible_pdf_over_dot(wo, *m) : 0;
}

std::optional<BsdfSample> sample(const ConductorBsdf& b, Vec3 wo, Stream& direction) {
  BsdfSample s;
  if (wo.z == 0) return std::nullopt;
  if (b.roughness.smooth()) {
    s.wi = mirror(wo);
    s.weight = fresnel_conductor(abs_cos(wo), b.eta, b.k);
    s.specular = true;
    return s;
  }
  const float side = std::copysign(1.0f, wo.z);
  const Vec3 m = side * b.roughness.sample_visible(side * wo, direction.uniform2());
  const float cos_m = glm::dot(wo, m);
  s.wi = glm::normalize(2 * cos_m * m - wo);
  s.pdf = pdf(b, wo, s.wi);
  if (!(s.pdf > 0)) return std::nullopt;  // into the surface: a second bounce this model leaves out
  s.weight = fresnel_conductor(std::abs(cos_m), b.eta, b.k) * b.roughness.g2_over_g1(wo, s.wi);
  return s;
}

Rgb albedo(const ConductorBsdf& b, Vec3 wo) { return fresnel_conductor(abs_cos(wo), b.eta, b.k); }

}  // namespace woodcock
