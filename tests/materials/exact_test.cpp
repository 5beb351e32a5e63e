// Scattering models where the exact answer is known: furnaces, index-matched boundaries, closed forms of coated
// surfaces, and directions at the edge of the domain.
#include <gtest/gtest.h>

#include "renderer/core/warp.h"
#include "renderer/materials/fresnel.h"
#include "tests/materials/bsdf_cases.h"
#include "tests/support/chi_square.h"

namespace woodcock {
namespace {

using testing::bsdf_cases;
using testing::BsdfCase;
using testing::outgoing_directions;

/// Mean weight of `n` samples, with radiance's 1/η² undone so that it counts energy.
double energy(const Bsdf& b, Vec3 wo, int n, uint64_t seed = 1) {
  Stream direction(seed), layered(seed + 1);
  double sum = 0;
  for (int i = 0; i < n; ++i)
    if (const std::optional<BsdfSample> s = sample(b, wo, direction, layered)) sum += static_cast<double>(s->weight.g * s->eta * s->eta);
  return sum / n;
}

TEST(Furnace, WhiteDiffuseReturnsEverySampleWithWeightOne) {
  Stream direction(3), layered(4);
  for (const Vec3 wo : outgoing_directions())
    for (int i = 0; i < 1000; ++i) {
      const std::optional<BsdfSample> s = sample(DiffuseBsdf{Rgb(1)}, wo, direction, layered);
      if (s) {
        EXPECT_EQ(s->weight, Rgb(1));
      }
    }
  EXPECT_NEAR(energy(DiffuseBsdf{Rgb(1)}, {0, 0, 1}, 100000), 1, 1e-4);
}

TEST(Furnace, SmoothBoundariesLoseNothing) {
  for (const float eta : {0.7f, 1.0f, 1.33f, 2.4f})
    for (const Vec3 wo : outgoing_directions()) {
      EXPECT_NEAR(energy(DielectricBsdf{eta, {}}, wo, 2000), 1, 1e-5) << eta;
      EXPECT_NEAR(energy(ThinDielectricBsdf{eta}, wo, 2000), 1, 1e-5) << eta;
    }
}

/// What a perfect rough mirror returns at normal incidence when light is reflected once: the mean of G1(wi) over
/// facets of slope t with P(t² < x) = x / (α² + x), by the midpoint rule. The rest would need a second facet.
double single_scattering_mirror(double alpha) {
  const int n = 200000;
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    const double u = (i + 0.5) / n, t2 = alpha * alpha * u / (1 - u);
    if (t2 >= 1) break;  // reflected downwards
    const double tangent = 2 * std::sqrt(t2) / (1 - t2);
    sum += 2 / (1 + std::sqrt(1 + alpha * alpha * tangent * tangent));
  }
  return sum / n;
}

// GGX has long tails: one reflection returns 0.99 at α = 0.1, 0.88 at α = 0.3, 0.31 at α = 1, and this model leaves out the
// others (as pbrt-v4 does). False alarms: six standard errors.
TEST(Furnace, RoughMirrorsLoseExactlyWhatASecondFacetWouldCatch) {
  for (const float alpha : {0.05f, 0.1f, 0.3f, 1.0f}) {
    const Bsdf mirror_bsdf = ConductorBsdf{Rgb(1), Rgb(1e10f), {alpha, alpha}};
    EXPECT_NEAR(energy(mirror_bsdf, {0, 0, 1}, 400000), single_scattering_mirror(static_cast<double>(alpha)), 6 * 0.5 / std::sqrt(400000.0))
        << alpha;
  }
}

TEST(Furnace, RoughGlassNeverCreatesEnergyAndTendsToLosslessAsItGetsSmooth) {
  for (const Vec3 wo : outgoing_directions()) {
    double previous = 0;
    for (const float alpha : {0.5f, 0.1f, 0.01f, 0.002f}) {
      const double e = energy(DielectricBsdf{1.5f, {alpha, alpha}}, wo, 50000);
      EXPECT_LE(e, 1.00001) << alpha;
      EXPECT_GT(e, previous) << alpha;
      previous = e;
    }
    EXPECT_GT(previous, 0.995);
  }
}

// The energy of a sample is bounded by one only in the mean for layered models. False alarms: five standard errors.
TEST(Furnace, NoModelCreatesEnergy) {
  for (const BsdfCase& c : bsdf_cases())
    for (const Vec3 wo : outgoing_directions()) EXPECT_LE(energy(c.bsdf, wo, 20000), 1.01) << c.name;
}

TEST(SmoothDielectric, FollowsSnellsLaw) {
  Stream direction(7), layered(8);
  for (const Vec3 wo : outgoing_directions()) {
    const float eta = wo.z > 0 ? 1.5f : 1 / 1.5f;
    for (int i = 0; i < 50; ++i) {
      const std::optional<BsdfSample> s = sample(DielectricBsdf{1.5f, {}}, wo, direction, layered);
      ASSERT_TRUE(s);
      if (!s->transmission) {
        EXPECT_NEAR(glm::length(s->wi - mirror(wo)), 0, 1e-6);
        continue;
      }
      EXPECT_NEAR(s->wi.x * eta, -wo.x, 1e-6);
      EXPECT_NEAR(s->wi.y * eta, -wo.y, 1e-6);
      EXPECT_FLOAT_EQ(s->eta, eta);
      EXPECT_NEAR(s->weight.g, 1 / (eta * eta), 1e-6);  // 1/η² of radiance, the Fresnel factor cancelled by the choice
    }
  }
}

/// 2 ∫ F(c) c dc: the reflectance of a boundary for diffuse light; and the transmission through an absorbing layer of
/// depth d on the way there and back, by Simpson's rule.
double diffuse_reflectance(float eta, double depth) {
  const int n = 20000;
  double sum = 0;
  for (int i = 0; i <= n; ++i) {
    const double c = static_cast<double>(i) / n;
    const double absorbed = depth > 0 ? (c > 0 ? std::exp(-2 * depth / c) : 0) : 1;
    sum += (i == 0 || i == n ? 1 : (i % 2 == 1 ? 4 : 2)) * 2 * c * absorbed *
           static_cast<double>(fresnel_dielectric(static_cast<float>(c), eta));
  }
  return sum / (3 * n);
}

// A smooth coat over a diffuse base of albedo ρ: T(wo) T(wi) ρ / (π η²) Σ (ρ Ri)^k with the internal diffuse reflectance Ri,
// each crossing of the coat's medium absorbing, the sum ending with the depth limit: k = 0 … ⌊(max_depth − 1)/2⌋. False
// alarms: six standard errors.
TEST(CoatedDiffuse, SmoothCoatsMatchTheClosedForm) {
  struct Row {
    float eta, thickness, rho;
    int max_depth;
  };
  for (const Row row : {Row{1.5f, 0, 0.5f, 10}, Row{1.5f, 0, 0.9f, 1000}, Row{1.5f, 0.01f, 0.9f, 10}, Row{1.33f, 0.4f, 0.8f, 9},
                        Row{1.0f, 0.2f, 0.7f, 10}, Row{1.5f, 0.1f, 0.9f, 1}, Row{1.5f, 0.1f, 0.9f, 2}, Row{1.5f, 0.1f, 0.9f, 3}}) {
    Coat coat;
    coat.boundary = {row.eta, {}};
    coat.thickness = row.thickness;
    coat.max_depth = row.max_depth;
    const Bsdf b = CoatedDiffuseBsdf{coat, {Rgb(row.rho)}, nullptr};
    const double thickness = static_cast<double>(row.thickness), eta = static_cast<double>(row.eta), rho = static_cast<double>(row.rho);
    const double q = rho * diffuse_reflectance(1 / row.eta, thickness);
    double orders = 0, power = 1;
    for (int k = 0; 2 * k + 1 <= row.max_depth; ++k) orders += power, power *= q;
    const auto enters = [&](Vec3 w) {
      const double c = static_cast<double>(w.z), inside = std::sqrt(1 - (1 - c * c) / (eta * eta));
      return (1 - static_cast<double>(fresnel_dielectric(w.z, row.eta))) * std::exp(-thickness / inside);
    };
    const Vec3 wo = glm::normalize(Vec3(0.3f, 0.1f, 0.8f)), wi = glm::normalize(Vec3(-0.6f, 0.5f, 0.3f));
    const double expected = enters(wo) * enters(wi) * rho / (M_PI * eta * eta) * orders * static_cast<double>(wi.z);
    Stream layered(9);
    double sum = 0, squares = 0;
    const int n = 100000;
    for (int i = 0; i < n; ++i) {
      const double v = static_cast<double>(eval(b, wo, wi, layered).g);
      sum += v, squares += v * v;
    }
    const double mean = sum / n, error = std::sqrt(std::fmax(0, squares / n - mean * mean) / n);
    EXPECT_NEAR(mean, expected, 6 * error + 1e-6) << "eta " << row.eta << " thickness " << row.thickness << " depth " << row.max_depth;
  }
}

// Nothing absorbs: a smooth boundary, a medium of albedo 1, a white base. False alarms: six standard errors.
TEST(CoatedDiffuse, LosslessLayersReturnEverything) {
  for (const float eta : {1.0f, 1.33f, 1.5f})
    for (const float thickness : {0.0f, 0.3f, 2.0f})
      for (const Vec3 wo : {Vec3(0, 0, 1), glm::normalize(Vec3(-0.8f, 0.5f, 0.4f))}) {
        Coat coat;
        coat.boundary = {eta, {}};
        coat.thickness = thickness;
        coat.g = 0.5f;
        coat.albedo = Rgb(1);
        coat.max_depth = 100000;
        EXPECT_NEAR(energy(CoatedDiffuseBsdf{coat, {Rgb(1)}, nullptr}, wo, 20000), 1, 6 * 2 / std::sqrt(20000.0))
            << eta << " " << thickness;
      }
}

// One scattering in a medium without boundary over a black base: a p(θ) μi / (μi + μo) (1 − exp(−τ (1/μi + 1/μo))). False
// alarms: six standard errors.
TEST(CoatedDiffuse, SingleScatteringInTheCoatMatchesTheClosedForm) {
  Coat coat;
  coat.boundary = {1, {}};
  coat.thickness = 0.7f;
  coat.g = 0.4f;
  coat.albedo = Rgb(0.8f);
  coat.max_depth = 1;
  const Vec3 wo = glm::normalize(Vec3(0.3f, 0.1f, 0.8f)), wi = glm::normalize(Vec3(-0.6f, 0.5f, 0.3f));
  const double mo = static_cast<double>(wo.z), mi = static_cast<double>(wi.z), g = 0.4, cosine = -static_cast<double>(glm::dot(wo, wi));
  const double phase = (1 - g * g) / (4 * M_PI * std::pow(1 + g * g - 2 * g * cosine, 1.5));
  const double expected = 0.8 * phase * mi / (mi + mo) * (1 - std::exp(-0.7 * (1 / mi + 1 / mo)));
  Stream layered(15);
  double sum = 0, squares = 0;
  const int n = 200000;
  for (int i = 0; i < n; ++i) {
    const double v = static_cast<double>(eval(CoatedDiffuseBsdf{coat, {Rgb(0)}, nullptr}, wo, wi, layered).g);
    sum += v, squares += v * v;
  }
  const double mean = sum / n;
  EXPECT_NEAR(mean, expected, 6 * std::sqrt((squares / n - mean * mean) / n));
}

TEST(CoatedConductor, SmoothOnSmoothIsOneMirrorWithTheSumOfAllReflections) {
  Coat coat;
  coat.thickness = 0.1f;
  coat.max_depth = 1000;
  const ConductorBsdf metal{Rgb(0.3f), Rgb(2.5f), {}};
  const Bsdf b = CoatedConductorBsdf{coat, metal};
  EXPECT_TRUE(is_specular(b));
  const Vec3 wo = glm::normalize(Vec3(0.3f, 0.1f, 0.8f));
  const double inside = std::sqrt(1 - (1 - static_cast<double>(wo.z * wo.z)) / 2.25);
  const double r = static_cast<double>(fresnel_dielectric(wo.z, 1.5f)),
               m = static_cast<double>(fresnel_conductor(static_cast<float>(inside), 0.3f, 2.5f));
  const double down_and_up = std::exp(-2 * 0.1 / inside) * m;
  // R + T² x / (1 − R x). False alarms: six standard errors.
  EXPECT_NEAR(energy(b, wo, 200000), r + (1 - r) * (1 - r) * down_and_up / (1 - r * down_and_up), 6e-3);
}

TEST(CoatedSurfaces, AreTheSameFromBothSides) {
  int coated = 0;
  for (const BsdfCase& c : bsdf_cases()) {
    if (c.name.find("coat") == std::string::npos && c.name.find("sea") == std::string::npos) continue;
    const Vec3 wo = glm::normalize(Vec3(0.3f, -0.2f, 0.7f)), wi = glm::normalize(Vec3(0.1f, 0.6f, 0.5f));
    Stream a(11), b(11);
    EXPECT_EQ(eval(c.bsdf, wo, wi, a), eval(c.bsdf, -wo, -wi, b)) << c.name;
    EXPECT_EQ(pdf(c.bsdf, wo, wi), pdf(c.bsdf, -wo, -wi)) << c.name;
    ++coated;
  }
  EXPECT_GT(coated, 1);
}

}  // namespace
}  // namespace woodcock
