// Extremes of a slab against exact values: optical depth, albedo, mean cosine, index, grazing views.
//
// False alarms: a comparison with an exact value allows 4.9 standard errors (tests/transport/estimate.h); R + T = 1 allows
// three, which a right renderer exceeds once in 370 seeds a comparison. Seeds are fixed.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/hard_cases/slab.h"
#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

using reference::adding_doubling;
using reference::SlabCase;

std::string describe(const SlabCase& s) { return fmt::format("tau {} albedo {} g {} n {} mu {}", s.tau, s.albedo, s.g, s.n, s.mu); }

/// Compares R and T with the exact values; each must be known to `resolution` of the larger of the two.
void expect_exact(const SlabCase& slab, int samples, double resolution, bool grid = false) {
  const reference::SlabValues exact = adding_doubling(slab);
  const double larger = std::fmax(exact.reflectance, exact.transmittance);
  for (const bool reflected : {true, false}) {
    const double expected = reflected ? exact.reflectance : exact.transmittance;
    const Estimate e =
        estimate(slab_scene(slab, reflected ? SlabSide::kReflectance : SlabSide::kTransmittance, grid), samples, reflected ? 1 : 2);
    const std::string report =
        fmt::format("{}, {}: {:.6g} ± {:.2g}, exact {:.6g}", describe(slab), reflected ? "R" : "T", e.mean[1], e.error[1], expected);
    EXPECT_LE(e.error[1], resolution * larger) << report;
    // 1e-6 is the solver's own accuracy.
    EXPECT_LE(std::abs(e.mean[1] - expected), kStandardErrors * e.error[1] + kRounding * expected + 2e-6) << report;
    EXPECT_EQ(e.counters.nonfinite + e.counters.truncated + e.counters.majorant_violations, 0u) << report;
  }
}

/// R and T of a slab in which nothing absorbs: R + T = 1 within three standard errors.
struct LosslessSlab {
  Estimate r, t;
};
LosslessSlab expect_lossless(const SlabCase& slab, int samples, bool grid = false) {
  const LosslessSlab e{estimate(slab_scene(slab, SlabSide::kReflectance, grid), samples, 3),
                       estimate(slab_scene(slab, SlabSide::kTransmittance, grid), samples, 4)};
  EXPECT_LE(std::abs(e.r.mean[1] + e.t.mean[1] - 1), 3 * std::hypot(e.r.error[1], e.t.error[1]) + kRounding)
      << describe(slab) << (grid ? " as a grid: R " : ": R ") << e.r.mean[1] << " ± " << e.r.error[1] << ", T " << e.t.mean[1] << " ± "
      << e.t.error[1];
  EXPECT_EQ(e.r.counters.truncated + e.t.counters.truncated, 0u) << describe(slab);
  return e;
}

TEST(HardCases, N02_negative_mean_cosines_scatter_backwards) {
  for (const double g : {-0.9, -0.5, -1e-3, 1e-3, 0.5}) expect_exact({.tau = 2, .albedo = 0.9, .g = g}, 20000, 0.01);
}

TEST(HardCases, N03_mean_cosines_from_minus_0_99_to_0_999_are_exact) {
  struct Row {
    double tau, g;
  };
  for (const Row row : {Row{4, -0.99}, Row{4, -0.9}, Row{150, 0.99}, Row{500, 0.999}}) {
    const SlabWalk walk = walk_slab(row.tau, 1, row.g, 4000, 5);
    const SlabCase slab{.tau = row.tau, .albedo = 1, .g = row.g};
    const LosslessSlab rendered = expect_lossless(slab, 2500);
    for (const bool reflected : {true, false}) {
      const Mean& expected = reflected ? walk.reflectance : walk.transmittance;
      const double mean = (reflected ? rendered.r : rendered.t).mean[1],
                   error = std::hypot((reflected ? rendered.r : rendered.t).error[1], expected.error());
      EXPECT_LE(std::abs(mean - expected.mean), kStandardErrors * error)
          << describe(slab) << (reflected ? " R " : " T ") << mean << ", by a random walk " << expected.mean << " ± " << error;
      EXPECT_LE(error, 0.03);
    }
  }
}

TEST(HardCases, N16_a_slab_of_index_1_5_is_exact) {
  expect_exact({.tau = 1, .albedo = 0.99, .g = 0.5, .n = 1.5}, 20000, 0.02);
  expect_exact({.tau = 5, .albedo = 0.9, .g = 0, .n = 1.33, .mu = 0.3}, 20000, 0.03);
}

TEST(HardCases, N19_a_constant_grid_is_the_homogeneous_slab) {
  for (const bool grid : {false, true}) {
    expect_exact({.tau = 1, .albedo = 0.99, .g = 0, .mu = 0.5}, 20000, 0.01, grid);
    expect_exact({.tau = 4, .albedo = 0.7, .g = 0.5}, 20000, 0.02, grid);
  }
}

TEST(HardCases, N32_a_grazing_view_at_cosine_0_01_is_exact) {
  for (const double n : {1.0, 1.5}) {
    expect_exact({.tau = 1, .albedo = 0.99, .g = 0, .n = n, .mu = 0.01}, 20000, 0.01);
    expect_lossless({.tau = 1, .albedo = 1, .g = 0.5, .n = n, .mu = 0.01}, 20000);
  }
}

// Half of the light is lost at every scattering, so that roulette decides from the second one on.
TEST(HardCases, N42_roulette_keeps_the_mean) {
  expect_exact({.tau = 3, .albedo = 0.5, .g = 0}, 40000, 0.02);
  expect_exact({.tau = 10, .albedo = 0.8, .g = 0.8}, 40000, 0.02);
}

// A path in the deepest slab here scatters some thousand times; a cap of the depth would show as missing light.
TEST(HardCases, N43_albedo_0_999999_is_exact) {
  expect_exact({.tau = 10, .albedo = 0.999999, .g = 0}, 10000, 0.01);
  expect_exact({.tau = 1e3, .albedo = 0.999999, .g = 0}, 1500, 0.03);
}

TEST(HardCases, N43_nothing_is_lost_between_optical_depths_1e_minus_4_and_1e3) {
  for (const double tau : {1e-4, 1e-2, 1.0, 10.0, 1e2, 1e3}) expect_lossless({.tau = tau, .albedo = 1, .g = 0}, tau > 100 ? 500 : 10000);
  for (const double tau : {1e-2, 10.0, 1e2}) expect_lossless({.tau = tau, .albedo = 1, .g = 0.8}, 3000, true);
}

TEST(HardCases, N56_reflectance_is_exact_at_optical_depths_1e2_1e3_1e4) {
  for (const bool grid : {false, true})
    for (const double tau : {1e2, 1e3, 1e4}) {
      expect_exact({.tau = tau, .albedo = 0.9, .g = 0}, 20000, 0.01, grid);
      expect_exact({.tau = tau, .albedo = 0.99, .g = 0, .n = 1.5}, 5000, 0.03, grid);
    }
}

// Clipped to 0.99, the reflectance of this slab would be ten times what it is.
TEST(HardCases, N65_a_mean_cosine_of_0_9999_is_exact) {
  const double tau = 1000;
  const SlabWalk walk = walk_slab(tau, 1, 0.9999, 3000, 7);
  const SlabCase slab{.tau = tau, .albedo = 1, .g = 0.9999};
  const Estimate r = estimate(slab_scene(slab, SlabSide::kReflectance), 2500, 8),
                 t = estimate(slab_scene(slab, SlabSide::kTransmittance), 1000, 9);
  EXPECT_LE(std::abs(r.mean[1] - walk.reflectance.mean), kStandardErrors * std::hypot(r.error[1], walk.reflectance.error()))
      << r.mean[1] << " ± " << r.error[1] << ", by a random walk " << walk.reflectance.mean << " ± " << walk.reflectance.error();
  EXPECT_LE(std::hypot(r.error[1], walk.reflectance.error()), 0.01);
  EXPECT_LE(std::abs(r.mean[1] + t.mean[1] - 1), 3 * std::hypot(r.error[1], t.error[1]) + kRounding);
}

}  // namespace
}  // namespace woodcock::testing
