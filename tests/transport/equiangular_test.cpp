// Equiangular distances, the series of unbiased ray marching and residual ratio tracking, by themselves.
#include "renderer/transport/equiangular.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "renderer/core/random.h"
#include "renderer/transport/ray_marching.h"
#include "renderer/transport/transmittance.h"
#include "tests/media/grids.h"
#include "tests/support/chi_square.h"
#include "tests/support/optical_depth.h"

namespace woodcock::testing {
namespace {

/// χ² of distances against the integral of the density over cells, at a level of 1e-6 for each of 12 tests; and the density
/// at a sample is the one that the inversion has there (Jacobian).
TEST(EquiangularDistances, ComeWithTheirDensity) {
  const Ray ray{{0.3f, -0.2f, 0.1f}, glm::normalize(Vec3(1, 2, -0.5f))};
  for (const float t_max : {0.7f, 5.0f, kInf}) {
    for (const DVec3 light : {DVec3(0.5, 0.5, 0), DVec3(3, 5, -1), DVec3(-4, 0, 0), ray.at(0.5)}) {
      const EquiangularDistances distances(ray, light, t_max);
      constexpr int kCells = 64, kSamples = 100000;
      // Cells of equal probability by the inversion itself would prove nothing: these are equal in t/(1 + t).
      const auto cell_end = [&](int i) {
        const double far = std::isfinite(t_max) ? static_cast<double>(t_max) / (1 + static_cast<double>(t_max)) : 1.0, x = far * i / kCells;
        return x < 1 ? x / (1 - x) : 1e30;
      };
      std::vector<double> expected(kCells), found(kCells);
      for (int i = 0; i < kCells; ++i) {
        const double a = cell_end(i), b = std::min(cell_end(i + 1), 1e9);
        constexpr int kSteps = 2000;
        // Midpoints in log-like steps: the density may be a peak of the width of the light's distance.
        for (int k = 0; k < kSteps; ++k) {
          const double u = (k + 0.5) / kSteps, t = b > 10 * (a + 1) ? a + (b - a) * u * u * u : a + (b - a) * u;
          const double dt = b > 10 * (a + 1) ? (b - a) * 3 * u * u / kSteps : (b - a) / kSteps;
          expected[static_cast<size_t>(i)] += static_cast<double>(distances.pdf(static_cast<float>(t))) * dt;
        }
      }
      Stream random(17);
      for (int s = 0; s < kSamples; ++s) {
        const double t = static_cast<double>(distances.sample(random.uniform_double()));
        ASSERT_TRUE(t >= 0 && t <= static_cast<double>(t_max));
        int i = 0;
        while (i + 1 < kCells && t >= cell_end(i + 1)) ++i;
        ++found[static_cast<size_t>(i)];
      }
      double total = 0, statistic = 0, rest_expected = 0, rest_found = 0;
      int degrees = -1;
      for (size_t i = 0; i < kCells; ++i) {
        total += expected[i];
        const double e = expected[i] * kSamples;
        if (e < 20) {
          rest_expected += e;
          rest_found += found[i];
          continue;
        }
        statistic += (found[i] - e) * (found[i] - e) / e;
        ++degrees;
      }
      if (rest_expected > 5) {
        statistic += (rest_found - rest_expected) * (rest_found - rest_expected) / rest_expected;
        ++degrees;
      }
      // A light on the ray has a peak that the quadrature cannot see; its inversion is tested all the same.
      if (glm::length(light - ray.at(0.5)) > 1e-3) {
        EXPECT_NEAR(total, 1, 2e-3);
        EXPECT_GT(chi_square_p_value(statistic, degrees), 1e-6) << "t_max " << t_max << ", light " << light.x;
      }
      for (double u = 0.01; u < 1; u += 0.07) {
        const double h = 1e-4;
        const double slope = (static_cast<double>(distances.sample(u + h)) - static_cast<double>(distances.sample(u - h))) / (2 * h);
        const double density = static_cast<double>(distances.pdf(distances.sample(u)));
        if (slope > 1e-2) {
          EXPECT_NEAR(density * slope, 1, 0.02) << u;
        }
      }
    }
  }
}

/// The mean of `samples` estimates of a transmittance is `exact`: 5 standard errors, once in a million; and their standard error is at
/// most `most_error` of it.
void expect_transmittance(double exact, int samples, double most_error, const std::function<double()>& estimate) {
  double sum = 0, squares = 0;
  for (int i = 0; i < samples; ++i) {
    const double t = estimate();
    sum += t;
    squares += t * t;
  }
  const double mean = sum / samples, error = std::sqrt(std::max(0.0, squares / samples - mean * mean) / samples);
  EXPECT_LT(std::abs(mean - exact), 5 * error + 1e-6 * exact) << mean << " ± " << error << ", exact " << exact;
  EXPECT_LT(error, most_error * exact) << mean << ", exact " << exact;
}

/// Uneven all over, in bricks with a lower bound that is not far from the upper one: the lower bounds make much of the depth, and
/// beyond a depth of 2.3 roulette decides on them.
TEST(ResidualTracking, IsUnbiasedWhereTheLowerBoundsMakeMuchOfTheDepth) {
  Stream values(5);
  const DenseGrid<float> grid =
      make_dense(IVec3(96, 48, 48), DVec3(0), DVec3(96, 48, 48), [&](IVec3) { return 0.8f + 0.2f * values.uniform(); });
  const Ray ray{{-1, 22.2f, 23.1f}, glm::normalize(Vec3(1, 0.02f, 0.03f))};
  for (const float scale : {0.05f, 0.08f}) {
    SCOPED_TRACE(scale);
    const Medium medium = make_medium(grid_medium(grid, Rgb(0), Rgb(scale)));
    const double depth = optical_depth_exact(medium, ray, 0, 120).x;
    ASSERT_LT(MarchedSegments(medium, ray, 120, true).lower_transmittance(), std::exp(-0.4 * depth));
    Stream random(11);
    PathCounters counters;
    expect_transmittance(std::exp(-depth), 200000, 0.04,
                         [&] { return static_cast<double>(estimate_transmittance(medium, ray, 120, random, counters).x); });
  }
}

TEST(RayMarching, IsUnbiasedWhateverTheDepth) {
  Stream values(3);
  for (const float scale : {0.3f, 2.0f, 9.0f}) {
    SCOPED_TRACE(scale);
    const DenseGrid<float> grid = make_dense(IVec3(9, 7, 8), DVec3(0), DVec3(9, 7, 8), [&](IVec3) { return values.uniform(); });
    const Medium medium = make_medium(grid_medium(grid, Rgb(scale), Rgb(0)));
    const Ray ray{{-1, 2.2f, 3.1f}, glm::normalize(Vec3(1, 0.2f, 0.1f))};
    const double exact = std::exp(-optical_depth_exact(medium, ray, 0, 12).x);
    const MarchedSegments segments(medium, ray, 12, true);
    ASSERT_FALSE(segments.overflows());
    ASSERT_GT(segments.depth(), 0);
    Stream random(11);
    uint64_t look_ups = 0;
    expect_transmittance(exact, 60000, 1e-3, [&] {
      return segments.lower_transmittance() * static_cast<double>(march_transmittance(medium, ray, segments, true, random, look_ups).x);
    });
  }
}

}  // namespace
}  // namespace woodcock::testing
