#include "renderer/materials/coat_table.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "renderer/materials/bsdf_sample.h"
#include "renderer/materials/fresnel.h"

namespace woodcock {

namespace {

/// Calls f(x, weight) for the points of Gauss's rule, four in each of `panels` equal parts of [0, 1].
template <typename F>
void for_each_node(int panels, F&& f) {
  constexpr std::array<double, 4> kNodes{-0.86113631159405258, -0.33998104358485626, 0.33998104358485626, 0.86113631159405258};
  constexpr std::array<double, 4> kWeights{0.34785484513745386, 0.65214515486254614, 0.65214515486254614, 0.34785484513745386};
  const double half = 0.5 / panels;
  for (int panel = 0; panel < panels; ++panel)
    for (size_t i = 0; i < kNodes.size(); ++i) f(half * (2 * panel + 1 + kNodes[i]), half * kWeights[i]);
}

/// What a layer leaves of light that crosses it.
double crossing(double thickness, double cosine) { return thickness > 0 ? (cosine > 0 ? std::exp(-thickness / cosine) : 0) : 1; }

double fresnel(double cosine, double eta) {
  return static_cast<double>(fresnel_dielectric(static_cast<float>(cosine), static_cast<float>(eta)));
}

/// Light that meets a rough boundary: the share that is reflected and the share that is refracted.
struct Split {
  double reflected = 0, refracted = 0;
};

/// The mean over the microfacet normals visible from the cosine `mu`, Ggx::sample_visible being the map; shadows leave G2/G1 of
/// each. The layers that light crosses afterwards have the thicknesses given.
Split split(const Ggx& roughness, float eta, double mu, double thickness_reflected, double thickness_refracted) {
  constexpr int kPanels = 8, kAzimuths = 16;
  const Vec3 wo(static_cast<float>(std::sqrt(std::max(0.0, (1 - mu) * (1 + mu)))), 0, static_cast<float>(mu));
  const Vec3 v = glm::normalize(Vec3(roughness.alpha_x * wo.x, 0, wo.z));
  std::array<Vec2, kAzimuths> azimuths;  // of half a circle: the other half is its mirror image
  for (size_t k = 0; k < kAzimuths; ++k) {
    const float phi = kPi * (static_cast<float>(k) + 0.5f) / kAzimuths;
    azimuths[k] = {std::cos(phi), std::sin(phi)};
  }
  Split mean;
  // u = 1 − x²: steep facets, few and fast-changing, lie near x = 0.
  for_each_node(kPanels, [&](double x, double node_weight) {
    const float x2 = static_cast<float>(x * x), height = x2 * (1 + v.z);
    const float sin_theta = std::sqrt(std::max(0.0f, (1 - x2) * (1 + v.z) * (height + (1 - v.z))));
    const double weight = node_weight * 2 * x / kAzimuths;
    for (const Vec2 azimuth : azimuths) {
      const Vec3 h(sin_theta * azimuth.x + v.x, sin_theta * azimuth.y, height);
      const Vec3 m = glm::normalize(Vec3(roughness.alpha_x * h.x, roughness.alpha_y * h.y, h.z));
      const float cos_m = glm::dot(wo, m);
      if (!(cos_m > 0)) continue;
      const float f = fresnel_dielectric(cos_m, eta);
      const auto share = [&](float fraction, Vec3 wi, double thickness) {
        return weight * static_cast<double>(fraction * roughness.g2_over_g1(wo, wi)) *
               crossing(thickness, static_cast<double>(abs_cos(wi)));
      };
      // What a facet sends to the wrong side is lost, as everywhere in these models.
      const Vec3 mirrored = 2 * cos_m * m - wo;
      if (mirrored.z > 0) mean.reflected += share(f, mirrored, thickness_reflected);
      const std::optional<Vec3> refracted = refract(wo, m, cos_m, eta);
      if (refracted && refracted->z < 0) mean.refracted += share(1 - f, *refracted, thickness_refracted);
    }
  });
  return mean;
}

}  // namespace

CoatTable::CoatTable(float eta, Ggx roughness, float thickness) : eta_(eta), thickness_(thickness), delta_(eta == 1 || roughness.smooth()) {
  const double n = static_cast<double>(eta), depth = static_cast<double>(thickness);
  // Inside, below the cosine of the critical angle, all is reflected (where the facets are level); above it integrals are taken
  // over the cosine μ outside, c dc = μ dμ/η², which takes the root of F at the critical angle away.
  const double critical = std::sqrt(std::max(0.0, (n - 1) * (n + 1))) / n;
  double inner = 0, through = 0;
  if (!delta_) {
    for (size_t i = 0; i <= kIntervals; ++i) {
      const double root = static_cast<double>(i) / kIntervals;
      const Split s = split(roughness, eta, root * root, 0, depth);
      reflectance_[i] = static_cast<float>(s.reflected);
      transmittance_[i] = static_cast<float>(s.refracted);
    }
    const auto returned = [&](double c) { return 2 * c * crossing(depth, c) * split(roughness, 1 / eta, c, depth, 0).reflected; };
    for_each_node(8, [&](double x, double w) {
      inner += w * 2 * x * critical * returned(critical * (1 - x * x));
      if (eta < 1) {
        inner += w * returned(x);
      } else {
        const double c = std::sqrt(critical * critical + x * x / (n * n));
        inner += w * x / (n * n * c) * returned(c);
      }
    });
    for_each_node(64, [&](double root, double w) {
      const double mu = root * root;
      through += w * 4 * root * mu * static_cast<double>(transmittance(static_cast<float>(mu)));
    });
  } else if (eta >= 1) {
    for_each_node(64, [&](double x, double w) {
      inner += w * 2 * x * critical * critical * crossing(2 * depth, x * critical);
      const double inside = std::sqrt(critical * critical + x * x / (n * n)), f = fresnel(x, n);
      inner += w * 2 * x / (n * n) * f * crossing(2 * depth, inside);
      through += w * 2 * x * (1 - f) * crossing(depth, inside);
    });
  } else {
    for_each_node(64, [&](double c, double w) {
      const double f = fresnel(c, 1 / n);
      inner += w * 2 * c * f * crossing(2 * depth, c);
      through += w * 2 * c * n * n * (1 - f) * crossing(depth, c);
    });
  }
  inner_reflectance_ = static_cast<float>(inner);
  mean_transmittance_ = static_cast<float>(through);
}

float CoatTable::transmittance(float cosine) const {
  if (!delta_) return look_up(transmittance_, cosine);
  const float t = 1 - fresnel_dielectric(cosine, eta_);
  if (thickness_ == 0 || t == 0) return t;
  const float eta_cos_t_squared = (eta_ - 1) * (eta_ + 1) + cosine * cosine;
  return eta_cos_t_squared > 0 ? t * std::exp(-thickness_ * eta_ / std::sqrt(eta_cos_t_squared)) : 0;
}

float CoatTable::reflectance(float cosine) const { return delta_ ? fresnel_dielectric(cosine, eta_) : look_up(reflectance_, cosine); }

float CoatTable::look_up(const std::array<float, kIntervals + 1>& table, float cosine) const {
  const float x = std::sqrt(std::clamp(cosine, 0.0f, 1.0f)) * kIntervals;
  const int i = std::min(static_cast<int>(x), kIntervals - 1);
  const float f = x - static_cast<float>(i);
  return table[static_cast<size_t>(i)] * (1 - f) + table[static_cast<size_t>(i) + 1] * f;
}

float geometric_sum(float q, int n) {
  // From the bits of n, the highest first: S(2m) = S(m) (1 + q^m), S(m + 1) = 1 + q S(m).
  float sum = 0, power = 1;
  for (int bit = std::bit_width(static_cast<unsigned>(std::max(n, 0))) - 1; bit >= 0; --bit) {
    sum *= 1 + power;
    power *= power;
    if (((n >> bit) & 1) == 0) continue;
    sum = 1 + q * sum;
    power *= q;
  }
  return sum;
}

}  // namespace woodcock
