#include "tests/transport/weights/scattering_formulas.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <numbers>
#include <stdexcept>
#include <tuple>
#include <vector>

namespace woodcock::testing {
namespace {

constexpr double kPiD = std::numbers::pi;

double d(float x) { return static_cast<double>(x); }
DVec3 d(Rgb c) { return DVec3(c); }

double henyey_greenstein(double g, double cosine) {
  return (1 - g * g) / (4 * kPiD * std::pow(std::max(1 + g * g - 2 * g * cosine, 0.0), 1.5));
}

double draine(double g, double alpha, double cosine) {
  return henyey_greenstein(g, cosine) * (1 + alpha * cosine * cosine) / (1 + alpha * (1 + 2 * g * g) / 3);
}

/// Fresnel by Snell's law, for unpolarised light that comes from index 1 to index eta.
double fresnel(double cos_i, double eta) {
  if (eta == 1) return 0;
  const double sin2_t = (1 - cos_i * cos_i) / (eta * eta);
  if (sin2_t >= 1) return 1;
  const double cos_t = std::sqrt(1 - sin2_t);
  const double rs = (cos_i - eta * cos_t) / (cos_i + eta * cos_t), rp = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  return (rs * rs + rp * rp) / 2;
}

double fresnel_of_metal(double cos_i, double eta, double k) {
  const std::complex<double> n(eta, k), cos_t = std::sqrt(1.0 - (1 - cos_i * cos_i) / (n * n));
  const std::complex<double> rs = (cos_i - n * cos_t) / (cos_i + n * cos_t), rp = (n * cos_i - cos_t) / (n * cos_i + cos_t);
  return (std::norm(rs) + std::norm(rp)) / 2;
}

struct Roughness {
  double x = 0, y = 0;

  static Roughness of(double x, double y) {
    // pbrt-v4 takes α below 10⁻³ for smooth and keeps others at 10⁻⁴ at the least.
    if (std::max(x, y) < 1e-3) return {};
    return {std::max(x, 1e-4), std::max(y, 1e-4)};
  }
  static Roughness of(const RoughnessDescription& r) {
    const double u = d(r.u.value), v = d(r.v.value);
    return r.remap ? of(std::sqrt(u), std::sqrt(v)) : of(u, v);
  }
  bool smooth() const { return x == 0 && y == 0; }

  /// D, Λ and G of Heitz 2014.
  double normals(DVec3 m) const {
    const double e = m.x * m.x / (x * x) + m.y * m.y / (y * y) + m.z * m.z;
    return 1 / (kPiD * x * y * e * e);
  }
  double lambda(DVec3 w) const { return (std::sqrt(1 + (x * x * w.x * w.x + y * y * w.y * w.y) / (w.z * w.z)) - 1) / 2; }
  double g2(DVec3 wo, DVec3 wi) const { return 1 / (1 + lambda(wo) + lambda(wi)); }
  double visible_normals(DVec3 wo, DVec3 m) const { return normals(m) * std::abs(glm::dot(wo, m)) / ((1 + lambda(wo)) * std::abs(wo.z)); }
};

bool same_side(DVec3 wo, DVec3 wi) { return wo.z * wi.z > 0; }
double cosine_density(DVec3 wi) { return std::abs(wi.z) / kPiD; }
DVec3 unit_range(DVec3 c) { return glm::clamp(c, DVec3(0), DVec3(1)); }

struct Metal {
  DVec3 eta, k;
  Roughness roughness;

  Metal(const ConductorDescription& c, double outside) : roughness(Roughness::of(c.roughness)) {
    if (c.reflectance) {
      const DVec3 r = glm::clamp(d(c.reflectance->value), DVec3(0), DVec3(d(0.9999f)));
      eta = DVec3(1 / outside);
      k = 2.0 * glm::sqrt(r) / glm::sqrt(1.0 - r) / outside;
    } else {
      eta = d(c.eta.value) / outside;
      k = d(c.k.value) / outside;
    }
  }
  DVec3 reflectance(double cosine) const {
    DVec3 r;
    for (int c = 0; c < 3; ++c) r[c] = fresnel_of_metal(cosine, eta[c], k[c]);
    return r;
  }
};

double reflected_lobe_density(const Roughness& roughness, DVec3 wo, DVec3 wi) {
  if (roughness.smooth() || !same_side(wo, wi)) return 0;
  const DVec3 m = glm::normalize(wo + wi);
  return roughness.visible_normals(wo, m) / (4 * std::abs(glm::dot(wo, m)));
}

SurfaceScattering rough_metal(const Metal& metal, DVec3 wo, DVec3 wi) {
  if (!same_side(wo, wi)) return {DVec3(0), 0};
  const DVec3 m = glm::normalize(wo + wi);
  const double dg = metal.roughness.normals(m) * metal.roughness.g2(wo, wi) / (4 * std::abs(wo.z));
  return {metal.reflectance(std::abs(glm::dot(wo, m))) * dg, reflected_lobe_density(metal.roughness, wo, wi)};
}

/// Walter et al. 2007. Radiance is divided by the squared relative index when it is refracted.
SurfaceScattering rough_glass(double eta_inside, const Roughness& roughness, DVec3 wo, DVec3 wi) {
  const double eta = wo.z > 0 ? eta_inside : 1 / eta_inside;
  const bool reflects = same_side(wo, wi);
  DVec3 m = glm::normalize(reflects ? wo + wi : wo + eta * wi);
  if (m.z < 0) m = -m;
  const double o = glm::dot(wo, m), i = glm::dot(wi, m);
  if (o * wo.z <= 0 || i * wi.z <= 0) return {DVec3(0), 0};
  const double f = fresnel(std::abs(o), eta), visible = roughness.visible_normals(wo, m);
  const double dg = roughness.normals(m) * roughness.g2(wo, wi);
  if (reflects) return {DVec3(f * dg / (4 * std::abs(wo.z))), f * visible / (4 * std::abs(o))};
  const double jacobian = std::abs(i) / ((i + o / eta) * (i + o / eta));
  return {DVec3((1 - f) * dg * std::abs(o) * jacobian / std::abs(wo.z) / (eta * eta)), (1 - f) * visible * jacobian};
}

/// A layered model's proxy: the coat's own reflection, and what enters it times a lobe.
double coated_density(const CoatDescription& coat, DVec3 wo, DVec3 wi, double below) {
  const Roughness roughness = Roughness::of(coat.roughness);
  const double eta = d(coat.eta);
  const double above = eta == 1 || roughness.smooth() ? 0 : rough_glass(eta, roughness, wo, wi).pdf;
  return above + (1 - fresnel(wo.z, eta)) * below;
}

bool scatters(const CoatDescription& coat) { return !is_black(coat.albedo.value); }

double crossing(double thickness, double cosine) { return thickness > 0 ? std::exp(-thickness / std::max(cosine, 1e-12)) : 1; }
int orders(const CoatDescription& coat) { return (coat.max_depth + 1) / 2; }
double series(double q, int n) {
  double sum = 0;
  for (int k = 0; k < n; ++k) sum = 1 + q * sum;
  return sum;
}

/// An absorbing coat of isotropic roughness over something diffuse: shares of light by the cosine where it arrives.
class CoatShares {
 public:
  CoatShares(double eta, double alpha, double thickness) : eta_(eta), thickness_(thickness) {
    if (eta != 1) roughness_ = Roughness::of(alpha, alpha);
    // Midpoints, fine enough for the root of Fresnel's formula at the critical angle.
    const int steps = smooth() ? 20000 : 100;
    for (int i = 0; i < steps; ++i) {
      const double c = (i + 0.5) / steps;
      inner_ += 2 * c * crossing(thickness, c) * shares(c, 1 / eta, thickness, 0).reflected / steps;
    }
    if (!smooth())
      for (int i = 0; i <= kNodes; ++i) nodes_.push_back(shares(std::max(1e-4, square(i)), eta, 0, thickness));
    const int fine = 20000;
    for (int i = 0; i < fine; ++i) mean_ += 2 * (i + 0.5) / fine * at((i + 0.5) / fine).refracted / fine;
  }

  struct Shares {
    double reflected = 0, refracted = 0;
  };
  Shares at(double cosine) const {
    if (smooth()) return shares(cosine, eta_, 0, thickness_);
    const double x = std::sqrt(cosine) * kNodes;
    const size_t i = static_cast<size_t>(std::min(x, kNodes - 1.0));
    const double f = x - static_cast<double>(i);
    return {nodes_[i].reflected * (1 - f) + nodes_[i + 1].reflected * f, nodes_[i].refracted * (1 - f) + nodes_[i + 1].refracted * f};
  }
  /// Of diffuse light from below, what comes back; of diffuse light from above, what reaches the base.
  double inner() const { return inner_; }
  double mean() const { return mean_; }
  bool smooth() const { return roughness_.smooth(); }

 private:
  static constexpr int kNodes = 200;
  static double square(int i) { return static_cast<double>(i) * i / (kNodes * kNodes); }

  /// Over the slopes of facets, all of them, each with its area towards the light: ∫ D (wo·m)+ G2 / cos θo dm.
  Shares shares(double mu, double eta, double layer_reflected, double layer_refracted) const {
    if (smooth()) {
      const double f = fresnel(mu, eta), below = std::sqrt(std::max(0.0, 1 - (1 - mu * mu) / (eta * eta)));
      return {f * crossing(layer_reflected, mu), f < 1 ? (1 - f) * crossing(layer_refracted, below) : 0};
    }
    const DVec3 wo(std::sqrt(1 - mu * mu), 0, mu);
    constexpr int kSlopes = 64, kAzimuths = 64;
    Shares sum;
    for (int i = 0; i < kSlopes; ++i) {
      const double v = 1 - (i + 0.5) / kSlopes, tangent = roughness_.x * std::sqrt(1 - v * v) / v, z = 1 / std::hypot(1, tangent);
      for (int k = 0; k < kAzimuths; ++k) {
        const double phi = kPiD * (k + 0.5) / kAzimuths;
        const DVec3 m(tangent * z * std::cos(phi), tangent * z * std::sin(phi), z);
        const double o = glm::dot(wo, m);
        if (o <= 0) continue;
        const double area = 2 * v / (kSlopes * kAzimuths) * o / (z * mu), f = fresnel(o, eta);
        const DVec3 up = 2 * o * m - wo;
        if (up.z > 0) sum.reflected += area * f * roughness_.g2(wo, up) * crossing(layer_reflected, up.z);
        const double sin2 = (1 - o * o) / (eta * eta);
        if (sin2 >= 1) continue;
        const DVec3 down = (o / eta - std::sqrt(1 - sin2)) * m - wo / eta;
        if (down.z < 0) sum.refracted += area * (1 - f) * roughness_.g2(wo, down) * crossing(layer_refracted, -down.z);
      }
    }
    return sum;
  }

  double eta_, thickness_, inner_ = 0, mean_ = 0;
  Roughness roughness_;
  std::vector<Shares> nodes_;
};

bool has_closed_form(const CoatDescription& coat) {
  const Roughness r = Roughness::of(coat.roughness);
  return !scatters(coat) && r.x == r.y && (coat.eta >= 1 || r.smooth());
}

/// One for each coat, kept.
const CoatShares& shares_of(const CoatDescription& coat) {
  thread_local std::map<std::tuple<double, double, double>, CoatShares> all;
  const double alpha = Roughness::of(coat.roughness).x, thickness = d(coat.thickness.value);
  return all.try_emplace({d(coat.eta), alpha, thickness}, d(coat.eta), alpha, thickness).first->second;
}

/// The base and all orders of light between base and coat, over what enters.
DVec3 from_below(const CoatedDiffuseDescription& m, const CoatShares& coat) {
  const DVec3 r = unit_range(d(m.reflectance.value));
  DVec3 sum;
  for (int c = 0; c < 3; ++c) sum[c] = r[c] * series(r[c] * coat.inner(), orders(m.coat)) / (d(m.coat.eta) * d(m.coat.eta));
  return sum;
}

/// The coat's lobe is chosen as its energy is to that of the brightest channel from below.
double coat_probability(const CoatedDiffuseDescription& m, const CoatShares& coat, double cosine) {
  const DVec3 below = from_below(m, coat);
  const CoatShares::Shares s = coat.at(cosine);
  return s.reflected / (s.reflected + s.refracted * coat.mean() * std::max({below.x, below.y, below.z}));
}

struct Scatter {
  DVec3 wo, wi;
  bool closed_forms;

  SurfaceScattering operator()(const InterfaceDescription&) const { return {DVec3(0), 0}; }
  SurfaceScattering operator()(const DiffuseDescription& m) const {
    if (!same_side(wo, wi)) return {DVec3(0), 0};
    return {unit_range(d(m.reflectance.value)) * cosine_density(wi), cosine_density(wi)};
  }
  SurfaceScattering operator()(const DiffuseTransmissionDescription& m) const {
    const DVec3 r = unit_range(d(m.scale * m.reflectance.value)), t = unit_range(d(m.scale * m.transmittance.value));
    const double pr = std::max({r.x, r.y, r.z}), pt = std::max({t.x, t.y, t.z});
    if (!(pr + pt > 0)) return {DVec3(0), 0};
    return {(same_side(wo, wi) ? r : t) * cosine_density(wi), (same_side(wo, wi) ? pr : pt) / (pr + pt) * cosine_density(wi)};
  }
  SurfaceScattering operator()(const ConductorDescription& m) const {
    const Metal metal(m, 1);
    return metal.roughness.smooth() ? SurfaceScattering{DVec3(0), 0} : rough_metal(metal, wo, wi);
  }
  SurfaceScattering operator()(const DielectricDescription& m) const {
    const Roughness roughness = Roughness::of(m.roughness);
    if (m.eta == 1 || roughness.smooth()) return {DVec3(0), 0};
    return rough_glass(d(m.eta), roughness, wo, wi);
  }
  SurfaceScattering operator()(const ThinDielectricDescription&) const { return {DVec3(0), 0}; }
  SurfaceScattering operator()(const CoatedDiffuseDescription& m) const {
    if (!same_side(wo, wi)) return {std::nullopt, 0};
    const double side = wo.z < 0 ? -1 : 1;
    if (!closed_forms || !has_closed_form(m.coat)) return {std::nullopt, coated_density(m.coat, side * wo, side * wi, cosine_density(wi))};
    const CoatShares& coat = shares_of(m.coat);
    const double p = coat_probability(m, coat, std::abs(wo.z));
    SurfaceScattering s{from_below(m, coat) * (coat.at(std::abs(wo.z)).refracted * coat.at(std::abs(wi.z)).refracted * cosine_density(wi)),
                        (1 - p) * cosine_density(wi), coat.smooth() ? 1e-5 : 3e-3};
    if (coat.smooth()) return s;
    const Roughness roughness = Roughness::of(m.coat.roughness);
    *s.value += rough_glass(d(m.coat.eta), roughness, side * wo, side * wi).value.value();
    s.pdf += p * reflected_lobe_density(roughness, side * wo, side * wi);
    return s;
  }
  SurfaceScattering operator()(const CoatedConductorDescription& m) const {
    if (!same_side(wo, wi)) return {std::nullopt, 0};
    const double side = wo.z < 0 ? -1 : 1, eta = d(m.coat.eta);
    const Roughness coat = Roughness::of(m.coat.roughness), metal = Roughness::of(m.conductor.roughness);
    const Roughness seen = Roughness::of(std::hypot(coat.x, eta * metal.x), std::hypot(coat.y, eta * metal.y));
    const double broad = scatters(m.coat) ? 0.5 : 0.15;
    const double below =
        seen.smooth() ? cosine_density(wi) : broad * cosine_density(wi) + (1 - broad) * reflected_lobe_density(seen, side * wo, side * wi);
    return {std::nullopt, coated_density(m.coat, side * wo, side * wi, below)};
  }
  SurfaceScattering operator()(const MixDescription&) const { throw std::logic_error("a mix has no scattering of its own"); }
};

}  // namespace

double phase_density(const PhaseDescription& phase, DVec3 wo, DVec3 wi) {
  const double cosine = -glm::dot(wo, wi) / std::sqrt(glm::dot(wo, wo) * glm::dot(wi, wi));
  if (const auto* p = std::get_if<HenyeyGreensteinDescription>(&phase)) return henyey_greenstein(d(p->g), cosine);
  if (const auto* p = std::get_if<TwoLobeDescription>(&phase))
    return d(p->weight) * henyey_greenstein(d(p->g), cosine) + (1 - d(p->weight)) * henyey_greenstein(d(p->g2), cosine);
  if (const auto* p = std::get_if<DraineDescription>(&phase)) return draine(d(p->g), d(p->alpha), cosine);
  if (const auto* p = std::get_if<MieDescription>(&phase)) {
    // Jendersie & d'Eon 2023, equations 4 to 7.
    const double size = d(p->droplet_diameter);
    const double g_hg = std::exp(-0.0990567 / (size - 1.67154)), g_d = std::exp(-2.20679 / (size + 3.91029) - 0.428934);
    const double alpha = std::exp(3.62489 - 8.29288 / (size + 5.52825)), w = std::exp(-0.599085 / (size - 0.641583) - 0.665888);
    return (1 - w) * henyey_greenstein(g_hg, cosine) + w * draine(g_d, alpha, cosine);
  }
  throw std::logic_error("no formula for a tabulated phase function");
}

SurfaceScattering scatter(const MaterialKind& material, DVec3 wo, DVec3 wi, bool closed_forms) {
  return std::visit(Scatter{wo, wi, closed_forms}, material);
}

bool is_mixed(const MaterialKind& material, bool closed_forms) {
  const auto* m = std::get_if<CoatedDiffuseDescription>(&material);
  return m != nullptr && closed_forms && has_closed_form(m->coat) && (m->coat.eta == 1 || Roughness::of(m->coat.roughness).smooth());
}

bool is_by_walks(const MaterialKind& material, bool closed_forms) {
  if (const auto* m = std::get_if<CoatedDiffuseDescription>(&material)) return !closed_forms || !has_closed_form(m->coat);
  return std::holds_alternative<CoatedConductorDescription>(material) && (!closed_forms || !is_delta(material));
}

bool is_delta(const MaterialKind& material) {
  if (const auto* m = std::get_if<ConductorDescription>(&material)) return Roughness::of(m->roughness).smooth();
  if (const auto* m = std::get_if<DielectricDescription>(&material)) return m->eta == 1 || Roughness::of(m->roughness).smooth();
  if (const auto* m = std::get_if<CoatedConductorDescription>(&material))
    return (m->coat.eta == 1 || Roughness::of(m->coat.roughness).smooth()) && Roughness::of(m->conductor.roughness).smooth() &&
           !scatters(m->coat);
  return std::holds_alternative<ThinDielectricDescription>(material);
}

double index_ratio(const MaterialKind& material, DVec3 wo, DVec3 wi) {
  const auto* glass = std::get_if<DielectricDescription>(&material);
  if (glass == nullptr || same_side(wo, wi)) return 1;
  return wo.z > 0 ? d(glass->eta) : 1 / d(glass->eta);
}

DVec3 delta_factor(const MaterialKind& material, DVec3 wo, DVec3 wi) {
  if (const auto* m = std::get_if<ConductorDescription>(&material)) return Metal(*m, 1).reflectance(std::abs(wo.z));
  const double mu = std::abs(wo.z);
  if (const auto* m = std::get_if<CoatedDiffuseDescription>(&material))
    return DVec3(fresnel(mu, d(m->coat.eta)) / coat_probability(*m, shares_of(m->coat), mu));
  if (const auto* m = std::get_if<CoatedConductorDescription>(&material)) {
    const double n = d(m->coat.eta), f = fresnel(mu, n), inside = std::sqrt(std::max(0.0, 1 - (1 - mu * mu) / (n * n)));
    const double layer = crossing(2 * d(m->coat.thickness.value), inside);
    DVec3 sum = Metal(m->conductor, n).reflectance(inside) * layer;
    for (int c = 0; c < 3; ++c) sum[c] = f + (1 - f) * (1 - f) * sum[c] * series(f * sum[c], orders(m->coat));
    return sum;
  }
  const double eta = index_ratio(material, wo, wi);
  return DVec3(1 / (eta * eta));
}

}  // namespace woodcock::testing
