// Media that overlap, said by a medium of type `sum` (hard case N15): the sum is the same light as one medium with the
// coefficients added, in closed form, in noise, against a grid resampled, and by every estimator.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

std::string ball_of(const std::string& media, double fov = 30, int depth = 1000) {
  return perspective({0, 0, 4}, {0, 0, 0}, fov, depth) + "WorldBegin\n" + environment({1, 2, 3}) + media + boundary("m", "", sphere(1));
}

TEST(HardCases, N15_transmittance_is_the_product_of_the_parts) {
  // Through the middle of a ball of radius 1: exp(−2 Σσ). The parts are defined after the sum.
  const std::string text =
      ball_of(sum("m", "\"a\" \"b\" \"a\"") + homogeneous("a", {0.1, 0.2, 0.3}, Rgb(0)) + homogeneous("b", {0.5, 0, 2}, Rgb(0)), 1e-3);
  const std::array<double, 3> expected{std::exp(-2 * 0.7), 2 * std::exp(-2 * 0.4), 3 * std::exp(-2 * 2.6)};
  expect_value(estimate(text, 200, 1), expected, 1e-5, "three absorbing parts");
}

TEST(HardCases, N15_homogeneous_parts_without_scattering_give_the_same_bits_as_one_medium) {
  // Coefficients whose sums are exact in float.
  const auto one = compile(ball_of(homogeneous("m", {0.75, 0.5, 1.5}, Rgb(0))));
  const auto two =
      compile(ball_of(homogeneous("a", {0.25, 0, 1}, Rgb(0)) + homogeneous("b", {0.5, 0.5, 0.5}, Rgb(0)) + sum("m", "\"a\" \"b\"")));
  EXPECT_EQ(radiances(one, 500, 3), radiances(two, 500, 3));
}

TEST(HardCases, N15_homogeneous_parts_scatter_and_glow_as_one_medium) {
  const std::string one = homogeneous("m", {0.5, 1, 0.25}, {1, 2, 3}, 0.4, {1, 0, 2});
  const std::string two = homogeneous("a", {0.5, 1, 0.25}, {0.25, 1, 0}, 0.4, {1, 0, 2}) + homogeneous("b", Rgb(0), {0.75, 1, 3}, 0.4);
  expect_equal(estimate(ball_of(one), 40000, 5), estimate(ball_of(two + sum("m", "\"a\" \"b\"")), 40000, 6), 0.01, "one and two parts");
}

TEST(HardCases, N15_phase_functions_mix_by_sigma_s) {
  // Two lobes in one medium, or one in each of two, of the same weights: the same phase function.
  const std::string lobes =
      "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [ .2 .2 .2 ] \"rgb sigma_s\" [ 4 4 4 ] \"string phase\" "
      "\"twolobe\" \"float g\" 0.9 \"float g2\" -0.6 \"float lobeweight\" 0.75\n";
  const std::string parts = homogeneous("a", Rgb(0.2f), Rgb(3), 0.9) + homogeneous("b", Rgb(0), Rgb(1), -0.6) + sum("m", "\"a\" \"b\"");
  expect_equal(estimate(ball_of(lobes, 30, 3), 60000, 7), estimate(ball_of(parts, 30, 3), 60000, 8), 0.01, "two lobes and two media");
}

TEST(HardCases, N15_a_grid_and_a_fog_are_the_same_as_one_grid_of_both) {
  // 6³ voxels of edge 0.6 reach a voxel beyond the ball, so that no interpolant fades inside of it.
  const int side = 6;
  std::string density, sigma_a, sigma_s;
  Stream random(9);
  for (int i = 0; i < side * side * side; ++i) {
    const double d = 0.125 * (random.next_u32() % 16);
    density += fmt::format("{} ", d);
    sigma_a += fmt::format("{} {} {} ", d * 0.5 + 0.125, d * 0.5, d * 0.5 + 0.5);
    sigma_s += fmt::format("{} {} {} ", d * 1 + 0.5, d * 2 + 0.5, d * 4 + 0.5);
  }
  const std::string box = fmt::format(
      " \"integer nx\" {0} \"integer ny\" {0} \"integer nz\" {0} \"point3 p0\" [ -1.8 -1.8 -1.8 ] \"point3 p1\" [ 1.8 1.8 1.8 ]", side);
  const std::string grid = "MakeNamedMedium \"c\" \"string type\" \"uniformgrid\"" + box +
                           " \"rgb sigma_a\" [ .5 .5 .5 ] \"rgb sigma_s\" [ 1 2 4 ] \"float g\" 0.3 \"float density\" [ " + density + "]\n";
  const std::string both = "MakeNamedMedium \"m\" \"string type\" \"rgbgrid\"" + box + " \"float g\" 0.3 \"rgb sigma_a\" [ " + sigma_a +
                           "] \"rgb sigma_s\" [ " + sigma_s + "]\n";
  const std::string parts = grid + homogeneous("f", {0.125, 0, 0.5}, Rgb(0.5), 0.3) + sum("m", "\"c\" \"f\"");
  const Estimate a = estimate(ball_of(both), 60000, 10), b = estimate(ball_of(parts), 60000, 11);
  expect_equal(a, b, 0.01, "rgbgrid and sum");
  EXPECT_EQ(b.counters.majorant_violations, 0u);
}

TEST(HardCases, N15_a_sum_without_end_is_followed_to_the_last_of_its_grids) {
  // The fog has no extinction in blue, so nothing but its end stops a path behind the grid; red and green never see the sky.
  const std::string parts = constant_grid("c", {0, 0.2f, 0.1f}, {0, 0.3f, 0.6f}, 1.5) + homogeneous("f", {0.2f, 0.1f, 0}, {0.3f, 0.1f, 0}) +
                            sum("m", "\"f\" \"c\"");
  const std::string text =
      "MediumInterface \"\" \"m\"\n" + perspective({0, 0, 3}, {0, 0, 0}, 20, 40) + "WorldBegin\n" + parts + environment({1, 0.5f, 0.25f});
  const CompiledScene scene = compile(text);
  CompiledScene general = compile(text);
  general.settings.plan = false;
  const Estimate a = estimate(scene, 40000, 15);
  EXPECT_EQ(a.mean[0], 0);
  EXPECT_GT(a.mean[2], 0.05);
  expect_equal(a, estimate(general, 40000, 16), 0.02, "plan off");
  for (const char* name : {"woodcock", "woodcock-phase"})
    expect_equal(a, estimate(with_estimator(compile(text), {name}), 40000, 17), 0.02, name);
  EXPECT_EQ(a.counters.truncated, 0u);
}

TEST(HardCases, N15_parts_that_glow_add_their_light) {
  // Absorbing and glowing only: the emission of a grid and of a fog, against a fog of both in the part where the grid is
  // constant. In closed form through the middle: Σσa Le/σ (1 − exp(−2σ)).
  const std::string parts = constant_grid("c", Rgb(0.5f), Rgb(0), 1.5, 0, {2, 1, 0}) + homogeneous("f", Rgb(0.25f), Rgb(0), 0, {0, 4, 4}) +
                            sum("m", "\"c\" \"f\"");
  const std::string text = perspective({0, 0, 4}, {0, 0, 0}, 1e-3, 10) + "WorldBegin\n" + parts + boundary("m", "", sphere(1));
  const double opaque = (1 - std::exp(-2 * 0.75)) / 0.75;
  expect_value(estimate(text, 40000, 12), {(0.5 * 2) * opaque, (0.5 * 1 + 0.25 * 4) * opaque, (0.25 * 4) * opaque}, 0.01,
               "glow of grid and fog");
}

TEST(HardCases, N15_every_estimator_that_tracks_or_marches_sees_all_parts) {
  // Absorbing and glowing, so that all of them apply: two grids, of which the smaller ends inside of the ball. Marching estimators may be
  // off by their step.
  const std::string parts = constant_grid("c", Rgb(0.5f), Rgb(0), 0.4, 0, {2, 1, 0}) +
                            constant_grid("f", Rgb(0.25f), Rgb(0), 0.7, 0, {0, 4, 4}) + sum("m", "\"f\" \"c\"");
  const std::string text = ball_of(parts, 5, 5);
  const Estimate reference = estimate(text, 40000, 13);
  for (const EstimatorInfo& e : estimators()) {
    const Estimate other = estimate(with_estimator(compile(text), {e.name, e.step ? 0.01 : 0}), 40000, 14);
    if (!e.biased()) {
      expect_equal(reference, other, 0.02, e.name);
      continue;
    }
    for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(other.mean[c], reference.mean[c], 0.03 * reference.mean[c]) << e.name;
  }
}

TEST(HardCases, N15_without_a_sum_the_last_boundary_decides) {
  // A ball of b in a ball of a: b alone is inside. As a sum it is both.
  const std::string media = homogeneous("a", Rgb(0.5f), Rgb(0)) + homogeneous("b", Rgb(0.25f), Rgb(0)) + sum("s", "\"a\" \"b\"");
  const auto scene = [&](const std::string& inner) {
    return perspective({0, 0, 4}, {0, 0, 0}, 1e-3, 10) + "WorldBegin\n" + environment(1) + media + boundary("a", "", sphere(1)) +
           boundary(inner, "a", sphere(0.5));
  };
  expect_value(estimate(scene("b"), 100, 1), std::exp(-0.5 * 1 - 0.25 * 1), 1e-5, "the inner medium alone");
  expect_value(estimate(scene("s"), 100, 1), std::exp(-0.5 * 2 - 0.25 * 1), 1e-5, "the sum");
}

}  // namespace
}  // namespace woodcock::testing
