#include "renderer/materials/layered_closed_forms.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/warp.h"
#include "renderer/materials/fresnel.h"

namespace woodcock {

namespace {

int orders(const Coat& coat) { return (coat.max_depth + 1) / 2; }

/// ρ/η² Σ (ρ Ri)^k: radiosity over what first reaches the base, as radiance outside.
Rgb from_below(const CoatedDiffuseBsdf& b) {
  const float eta = b.coat.boundary.eta, inner = b.table->inner_reflectance();
  Rgb sum;
  for (int c = 0; c < 3; ++c) sum[c] = b.base.reflectance[c] * geometric_sum(b.base.reflectance[c] * inner, orders(b.coat));
  return sum / (eta * eta);
}

/// Probability of sampling the coat's own lobe; empty where nothing is reflected at all.
std::optional<float> coat_probability(const CoatedDiffuseBsdf& b, Vec3 wo) {
  const float mu = abs_cos(wo), coat = b.table->reflectance(mu);
  const float below = b.table->transmittance(mu) * b.table->mean_transmittance() * max_component(from_below(b));
  if (!(coat + below > 0)) return std::nullopt;
  return coat / (coat + below);
}

/// Both directions above or both below.
float density(const CoatedDiffuseBsdf& b, Vec3 wo, Vec3 wi, float p) {
  return p * pdf(b.coat.boundary, wo, wi, Lobes::kReflection) + (1 - p) * kInvPi * abs_cos(wi);
}

}  // namespace

Rgb eval_closed_form(const CoatedDiffuseBsdf& b, Vec3 wo, Vec3 wi) {
  if (!same_hemisphere(wo, wi)) return Rgb(0);
  if (wo.z < 0) wo = -wo, wi = -wi;
  const float through = b.table->transmittance(wo.z) * b.table->transmittance(wi.z);
  return eval(b.coat.boundary, wo, wi) + from_below(b) * (through * kInvPi * wi.z);
}

float pdf_closed_form(const CoatedDiffuseBsdf& b, Vec3 wo, Vec3 wi) {
  if (!same_hemisphere(wo, wi)) return 0;
  if (wo.z < 0) wo = -wo, wi = -wi;
  const std::optional<float> p = coat_probability(b, wo);
  return p ? density(b, wo, wi, *p) : 0;
}

std::optional<BsdfSample> sample_closed_form(const CoatedDiffuseBsdf& b, Vec3 wo, Stream& direction) {
  const float side = std::copysign(1.0f, wo.z);
  wo *= side;
  const std::optional<float> p = wo.z > 0 ? coat_probability(b, wo) : std::nullopt;
  if (!p) return std::nullopt;
  // One point of the square chooses and directs: what is left of its first coordinate is uniform again.
  Vec2 u = direction.uniform2();
  const bool by_coat = u.x < *p;
  constexpr float kBelowOne = 0x1.fffffep-1f;
  u.x = std::min(by_coat ? u.x / *p : (u.x - *p) / (1 - *p), kBelowOne);
  BsdfSample s;
  if (by_coat && b.coat.boundary.delta()) {
    s.wi = side * mirror(wo);
    s.weight = Rgb(b.table->reflectance(wo.z) / *p);
    s.specular = true;
    return s;
  }
  Vec3 wi;
  if (by_coat) {
    const Vec3 m = b.coat.boundary.roughness.sample_visible(wo, u);
    wi = glm::normalize(2 * glm::dot(wo, m) * m - wo);
  } else {
    wi = square_to_cosine_hemisphere(u);
  }
  if (!(wi.z > 0)) return std::nullopt;  // into the surface: a second bounce this model leaves out
  s.pdf = density(b, wo, wi, *p);
  if (!(s.pdf > 0)) return std::nullopt;
  s.wi = side * wi;
  s.weight = eval_closed_form(b, wo, wi) / s.pdf;
  return s;
}

Rgb albedo_closed_form(const CoatedDiffuseBsdf& b, Vec3 wo) {
  const float mu = abs_cos(wo);
  return Rgb(b.table->reflectance(mu)) + from_below(b) * (b.table->transmittance(mu) * b.table->mean_transmittance());
}

Rgb albedo_closed_form(const CoatedConductorBsdf& b, Vec3 wo) {
  const float eta = b.coat.boundary.eta, mu = abs_cos(wo), f = fresnel_dielectric(mu, eta);
  const float eta_cos_t_squared = (eta - 1) * (eta + 1) + mu * mu;
  if (!(eta_cos_t_squared > 0)) return Rgb(f);
  const float inside = std::sqrt(eta_cos_t_squared) / eta;
  const float layer = b.coat.thickness > 0 ? std::exp(-2 * b.coat.thickness / inside) : 1;
  const Rgb x = fresnel_conductor(inside, b.base.eta, b.base.k) * layer;
  Rgb sum;
  for (int c = 0; c < 3; ++c) sum[c] = f + (1 - f) * (1 - f) * x[c] * geometric_sum(f * x[c], orders(b.coat));
  return sum;
}

std::optional<BsdfSample> sample_closed_form(const CoatedConductorBsdf& b, Vec3 wo) {
  if (wo.z == 0) return std::nullopt;
  BsdfSample s;
  s.wi = mirror(wo);
  s.weight = albedo_closed_form(b, wo);
  s.specular = true;
  return s;
}

}  // namespace woodcock
