// The Henyey-Greenstein phase function against long double references, from mean cosines of 0 to 0.9999.
#include <gtest/gtest.h>

#include "renderer/core/random.h"
#include "renderer/core/warp.h"
#include "renderer/media/henyey_greenstein.h"

namespace woodcock::testing {
namespace {

using Real = long double;

constexpr float kMeanCosines[] = {0.0f,  1e-8f, -1e-8f, 1e-6f, -1e-6f, 1e-4f, 1e-3f, -1e-3f, 0.01f,  0.1f,    -0.1f,   0.3f,
                                  -0.3f, 0.5f,  -0.5f,  0.7f,  0.9f,   -0.9f, 0.99f, -0.99f, 0.999f, -0.999f, 0.9999f, -0.9999f};
constexpr float kNumbers[] = {0.0f, 0x1p-24f, 1e-6f, 1e-4f, 0.01f,   0.1f,         0.25f,
                              0.5f, 0.7f,     0.9f,  0.99f, 0.9999f, 1 - 0x1p-23f, kOneMinusEpsilon};

/// Both complements of the deflection cosine by the inversion of the distribution, in long double.
struct Complements {
  Real one_minus_cos, one_plus_cos;
};
Complements reference_cosine(float u_float, float g_float) {
  const Real u = u_float, g = g_float, d = 1 - g + 2 * g * u;
  return {2 * (1 - g) * (1 - g) * (1 - u) * (1 + g * u) / (d * d), 2 * (1 + g) * (1 + g) * u * (1 - g * (1 - u)) / (d * d)};
}
Real reference_density(Real one_minus_cos, float g_float) {
  const Real g = g_float, d = (1 - g) * (1 - g) + 2 * g * one_minus_cos;
  return (1 - g * g) / (4 * 3.14159265358979323846264338L * d * std::sqrt(d));
}

TEST(HardCases, N01_sampled_cosine_and_its_complements_have_full_precision_for_every_g) {
  for (const float g : kMeanCosines)
    for (const float u : kNumbers) {
      const Complements want = reference_cosine(u, g);
      const Deflection got = hg_sample_cosine(u, g);
      EXPECT_NEAR(got.one_minus_cos, static_cast<double>(want.one_minus_cos), 8e-7 * static_cast<double>(want.one_minus_cos))
          << g << ' ' << u;
      EXPECT_NEAR(got.one_plus_cos, static_cast<double>(want.one_plus_cos), 8e-7 * static_cast<double>(want.one_plus_cos)) << g << ' ' << u;
      EXPECT_NEAR(got.cos, static_cast<double>(1 - want.one_minus_cos), 8e-7);
    }
}

TEST(HardCases, N02_mean_cosine_is_g_for_small_negative_and_large_g) {
  // Midpoint rule over the random number: no noise, only the rule's own error, largest where |g| is near 1.
  const int n = 1 << 18;
  for (const float g : {1e-4f, -1e-4f, 1e-3f, -1e-3f, 0.1f, -0.1f, 0.5f, -0.5f, 0.9f, -0.9f, 0.99f, -0.99f}) {
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += hg_sample_cosine((static_cast<float>(i) + 0.5f) / n, g).cos;
    EXPECT_NEAR(sum / n, g, 2e-8 + 2e-6 * std::abs(g)) << g;
  }
}

TEST(HardCases, N03_density_has_full_precision_up_to_g_of_0_9999) {
  for (const float g : kMeanCosines)
    for (const float u : kNumbers) {
      const Deflection c = hg_sample_cosine(u, g);
      // The reference gets the complement that carries the precision.
      const Real one_minus_cos = c.one_minus_cos < c.one_plus_cos ? Real(c.one_minus_cos) : 2 - Real(c.one_plus_cos);
      const double want = static_cast<double>(reference_density(one_minus_cos, g));
      EXPECT_NEAR(hg_eval(c.one_minus_cos, c.one_plus_cos, g), want, 2e-6 * want) << g << ' ' << u;
    }
}

TEST(HardCases, N04_sampled_directions_are_unit_vectors_at_the_sampled_angle) {
  Stream random(7);
  for (const float g : kMeanCosines)
    for (int i = 0; i < 2000; ++i) {
      const Vec3 wo = square_to_sphere(random.uniform2());
      const Vec2 u = random.uniform2();
      const auto [wi, pdf] = HenyeyGreenstein{g}.sample(wo, u);
      ASSERT_TRUE(is_finite(wi));
      EXPECT_NEAR(glm::length(wi), 1, 1e-6);
      EXPECT_NEAR(-glm::dot(wo, wi), hg_sample_cosine(u.x, g).cos, 1e-6);
      EXPECT_GT(pdf, 0);
    }
}

// From wo on the axis the deflection's sine can be read off exactly: next to 0 and π, where 1 − c² of a rounded c has no digit
// left, it has all of them.
TEST(HardCases, N04_the_sine_of_the_deflection_has_full_precision) {
  for (const float g : kMeanCosines)
    for (const float u : kNumbers) {
      const Complements c = reference_cosine(u, g);
      const auto wi = HenyeyGreenstein{g}.sample({0, 0, -1}, {u, 0}).wi;
      const auto want = static_cast<double>(std::sqrt(c.one_minus_cos * c.one_plus_cos));
      EXPECT_NEAR(std::hypot(static_cast<double>(wi.x), static_cast<double>(wi.y)), want, 2e-6 * want) << g << ' ' << u;
    }
}

}  // namespace
}  // namespace woodcock::testing
