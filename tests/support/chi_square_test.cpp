// The χ² helper itself: its p-values against closed forms, and its power to find wrong samplers.
#include "tests/support/chi_square.h"

#include <gtest/gtest.h>

#include "renderer/core/random.h"
#include "renderer/core/warp.h"

namespace woodcock {
namespace {

using testing::chi_square_sphere;

TEST(GammaQ, MatchesItsClosedForms) {
  for (const double x : {1e-6, 0.1, 0.5, 1.0, 2.0, 10.0, 50.0}) {
    EXPECT_NEAR(testing::gamma_q(0.5, x), std::erfc(std::sqrt(x)), 1e-13) << x;
    EXPECT_NEAR(testing::gamma_q(1, x), std::exp(-x), 1e-13) << x;
    EXPECT_NEAR(testing::gamma_q(3, x), std::exp(-x) * (1 + x + x * x / 2), 1e-13) << x;
  }
  EXPECT_EQ(testing::gamma_q(2, 0), 1);
}

TEST(GammaQ, IsAboutOneHalfAtTheMedianOfManyDegrees) {
  for (const int n : {10, 100, 1000}) EXPECT_NEAR(testing::chi_square_p_value(n * std::pow(1 - 2.0 / (9 * n), 3), n), 0.5, 1e-3);
}

TEST(IntegrateSphere, KnowsAreasAndCosines) {
  EXPECT_NEAR(testing::integrate_sphere([](Vec3) { return 1.0f; }), 4 * M_PI, 1e-5);
  EXPECT_NEAR(testing::integrate_sphere([](Vec3 w) { return std::fmax(w.z, 0.0f); }), M_PI, 1e-5);
}

// False alarm: 1e-4.
TEST(ChiSquare, AcceptsARightSampler) {
  Stream random(1);
  const auto result =
      chi_square_sphere([&] { return std::optional(square_to_cosine_hemisphere(random.uniform2())); }, square_to_cosine_hemisphere_pdf);
  EXPECT_GT(result.p_value, 1e-4) << result.describe();
  EXPECT_NEAR(result.total, 1, 1e-5);
}

TEST(ChiSquare, FindsAWrongDistribution) {
  Stream random(2);
  const auto result =
      chi_square_sphere([&] { return std::optional(square_to_hemisphere(random.uniform2())); }, square_to_cosine_hemisphere_pdf);
  EXPECT_LT(result.p_value, 1e-10) << result.describe();
}

// Two percent missing, two percent too bright, and draws that give nothing without the density knowing.
TEST(ChiSquare, FindsAWrongTotal) {
  for (const float factor : {0.98f, 1.02f}) {
    Stream random(3);
    const auto result = chi_square_sphere([&] { return std::optional(square_to_cosine_hemisphere(random.uniform2())); },
                                          [&](Vec3 w) { return factor * square_to_cosine_hemisphere_pdf(w); });
    EXPECT_LT(result.p_value, 1e-6) << result.describe();
  }
  Stream random(4);
  const auto result = chi_square_sphere(
      [&]() -> std::optional<Vec3> {
        const Vec3 w = square_to_cosine_hemisphere(random.uniform2());
        return random.uniform() < 0.02f ? std::nullopt : std::optional(w);
      },
      square_to_cosine_hemisphere_pdf);
  EXPECT_LT(result.p_value, 1e-6) << result.describe();
  EXPECT_GT(result.none, 0);
}

TEST(ChiSquare, FindsDirectionsWhereTheDensityIsZero) {
  Stream random(5);
  const auto result = chi_square_sphere(
      [&] {
        Vec3 w = square_to_cosine_hemisphere(random.uniform2());
        if (random.uniform() < 0.001f) w.z = -w.z;
        return std::optional(w);
      },
      square_to_cosine_hemisphere_pdf);
  EXPECT_LT(result.p_value, 1e-10) << result.describe();
}

}  // namespace
}  // namespace woodcock
