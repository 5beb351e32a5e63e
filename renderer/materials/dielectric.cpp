#include "renderer/materials/dielectric.h"

#include "renderer/materials/fresnel.h"

namespace woodcock {

namespace {

/// Relative index of the far side for light arriving along w.
float relative_eta(const DielectricBsdf& b, Vec3 w) { return w.z > 0 ? b.eta : 1 / b.eta; }

/// The facet that sends wo to wi and the quantities that density and value share.
struct Facet {
  Vec3 m;  // z > 0
  float cos_o, cos_i;
  bool reflection;
  float eta;                 // of wi's side over wo's; 1 for a reflection
  float reflectance;         // Fresnel
  float jacobian_times_dot;  // dm/dwi · |wo·m|: turns a density over `m` divided by |wo·m| into one over wi
};

std::optional<Facet> facet(const DielectricBsdf& b, Vec3 wo, Vec3 wi) {
  if (wo.z == 0 || wi.z == 0) return std::nullopt;
  Facet f;
  f.reflection = wo.z * wi.z > 0;
  const float eta = relative_eta(b, wo);
  f.eta = f.reflection ? 1 : eta;
  // In double: for eta near 1 the generalised half vector is a difference.
  const DVec3 h = DVec3(wo) + static_cast<double>(f.eta) * DVec3(wi);
  const double length = glm::length(h);
  if (!(length > 0)) return std::nullopt;
  f.m = Vec3(h * (std::copysign(1.0, h.z) / length));
  f.cos_o = glm::dot(wo, f.m);
  f.cos_i = glm::dot(wi, f.m);
  // Facets seen from behind take no part.
  if (f.cos_o * wo.z <= 0 || f.cos_i * wi.z <= 0 || f.m.z <= 0) return std::nullopt;
  f.reflectance = fresnel_dielectric(std::abs(f.cos_o), eta);
  if (f.reflection) {
    f.jacobian_times_dot = 0.25f;
  } else {
    // |wi·m| / (wi·m + wo·m/η)²; the sum in the denominator has the length of h over η.
    const float sum = static_cast<float>(length) / f.eta;
    f.jacobian_times_dot = std::abs(f.cos_o * f.cos_i) / (sum * sum);
  }
  return f;
}

/// Probability of choosing reflection.
float reflection_probability(float reflectance, Lobes lobes) {
  if (lobes == Lobes::kReflection) return 1;
  return lobes == Lobes::kTransmission ? 0 : reflectance;
}

float radiance_factor(float eta, Transport transport) { return transport == Transport::kRadiance ? 1 / (eta * eta) : 1; }

/// Common end of smooth and rough sampling: choose the lobe at a facet whose normal m points to wo's side.
struct Lobe {
  Vec3 wi;
  bool reflection;
  float weight;  // Fresnel factor over the probability of the choice
  float eta;
};
std::optional<Lobe> choose(const DielectricBsdf& b, Vec3 wo, Vec3 m, float u, Lobes lobes) {
  const float eta = relative_eta(b, wo), cos_o = glm::dot(wo, m);
  const float r = fresnel_dielectric(cos_o, eta), p = reflection_probability(r, lobes);
  if (u < p) {
    if (r == 0) return std::nullopt;
    return Lobe{2 * cos_o * m - wo, true, lobes == Lobes::kBoth ? 1.0f : r, 1};
  }
  const std::optional<Vec3> wi = refract(wo, m, cos_o, eta);
  if (!wi || r == 1) return std::nullopt;
  return Lobe{*wi, false, lobes == Lobes::kBoth ? 1.0f : 1 - r, eta};
}

}  // namespace

Rgb eval(const DielectricBsdf& b, Vec3 wo, Vec3 wi, Transport transport) {
  if (b.delta()) return Rgb(0);
  const std::optional<Facet> f = facet(b, wo, wi);
  if (!f) return Rgb(0);
  const float fresnel = f->reflection ? f->reflectance : (1 - f->reflectance) * radiance_factor(f->eta, transport);
  // f cos θi = F D (G2 / cos θo) · |wo·m| dm/dwi
  return Rgb(fresnel * 2 * b.roughness.d(f->m) * b.roughness.g2_over_2cos(wo, wi) * f->jacobian_times_dot);
}

float pdf(const DielectricBsdf& b, Vec3 wo, Vec3 wi, Lobes lobes) {
  if (b.delta()) return 0;
  const std::optional<Facet> f = facet(b, wo, wi);
  if (!f) return 0;
  const float p = reflection_probability(f->reflectance, lobes);
  // Under total reflection nothing is refracted, even where the half-vector formula would give a facet.
  const float choice = f->reflection ? p : (f->reflectance < 1 ? 1 - p : 0);
  return choice * b.roughness.visible_pdf_over_dot(wo, f->m) * f->jacobian_times_dot;
}

std::optional<BsdfSample> sample(const DielectricBsdf& b, Vec3 wo, Stream& direction, Lobes lobes, Transport transport) {
  if (wo.z == 0 && b.eta != 1) return std::nullopt;
  const float side = std::copysign(1.0f, wo.z);
  const float u = direction.uniform();
  const bool delta = b.delta();
  const Vec3 m = delta ? Vec3(0, 0, side) : side * b.roughness.sample_visible(side * wo, direction.uniform2());
  const std::optional<Lobe> lobe = choose(b, wo, m, u, lobes);
  if (!lobe) return std::nullopt;
  BsdfSample s;
  s.wi = lobe->wi;
  s.specular = delta;
  s.transmission = !lobe->reflection;
  s.eta = lobe->eta;
  const float factor = lobe->weight * (lobe->reflection ? 1 : radiance_factor(lobe->eta, transport));
  if (delta) {
    s.weight = Rgb(factor);
    return s;
  }
  // A facet may send light to the wrong side: a second bounce this model leaves out.
  if ((lobe->reflection ? wo.z : -wo.z) * s.wi.z <= 0) return std::nullopt;
  s.wi = glm::normalize(s.wi);
  s.pdf = pdf(b, wo, s.wi, lobes);
  if (!(s.pdf > 0)) return std::nullopt;
  s.weight = Rgb(factor * b.roughness.g2_over_g1(wo, s.wi));
  return s;
}

}  // namespace woodcock
