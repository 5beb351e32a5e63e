// Scenes whose radiance is known in closed form: what counts as depth, emission and transmittance over many orders of
// optical depth, the same in every container.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

/// A camera in a medium without end that glows: nothing else is there.
std::string unbounded(const std::string& medium, int max_depth, const std::string& shapes = "") {
  return medium + "MediumInterface \"\" \"m\"\n" + perspective({0.1, 0.2, 0.3}, {1, 1, 2}, 60, max_depth) + "WorldBegin\n" + shapes;
}

TEST(HardCases, N21_depth_counts_scatterings_at_surfaces) {
  // A closed room: each depth adds one reflection, E (1 + a + a² + …).
  const auto room = [](int depth) {
    return perspective({0.1, 0.2, 0.3}, {1, 0.5, 0.2}, 90, depth) +
           "WorldBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ .6 .6 .6 ]\nAreaLightSource \"diffuse\" \"rgb L\" [ 2 2 2 ]\n"
           "ReverseOrientation\n" +
           sphere(1);
  };
  expect_value(estimate(room(0), 1000, 1), 2, 1e-6, "depth 0");
  expect_value(estimate(room(1), 20000, 1), 2 * 1.6, 2e-3, "depth 1");
  expect_value(estimate(room(2), 40000, 1), 2 * 1.96, 2e-3, "depth 2");
}

TEST(HardCases, N21_depth_counts_scatterings_in_media) {
  // Emission j at every point, albedo a: j/σt (1 + a + a² + …).
  const std::string medium = homogeneous("m", Rgb(0.5f), Rgb(1.5f), 0.4, Rgb(3));
  const double once = 0.5 * 3 / 2.0;
  // Interfaces change nothing and count for nothing.
  const std::string shells = boundary("m", "m", sphere(0.6)) + boundary("m", "m", sphere(0.9)) + boundary("m", "m", sphere(5, {4, 0, 0}));
  for (const std::string& shapes : {std::string(), shells}) {
    expect_value(estimate(unbounded(medium, 0, shapes), 1000, 2), once, 1e-5, "depth 0");
    expect_value(estimate(unbounded(medium, 1, shapes), 40000, 2), once * 1.75, 3e-3, "depth 1");
    expect_value(estimate(unbounded(medium, 2, shapes), 40000, 2), once * 2.3125, 4e-3, "depth 2");
  }
}

TEST(HardCases, N21_depth_does_not_count_null_collisions) {
  // The grid's majorant is far above its density in the ball.
  const auto ball = [](const std::string& medium, int depth) {
    return perspective({0, 0, 4}, {0, 0, 0}, 25, depth) + "WorldBegin\n" + environment(1) + medium + boundary("m", "", sphere(1));
  };
  std::string density;
  for (int i = 0; i < 125; ++i) density += i == 0 ? " 40" : " 1";
  const std::string grid =
      "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 5 \"integer ny\" 5 \"integer nz\" 5 \"point3 p0\" [ -2.5 -2.5 "
      "-2.5 ] "
      "\"point3 p1\" [ 2.5 2.5 2.5 ]\n \"rgb sigma_a\" [ .3 .3 .3 ] \"rgb sigma_s\" [ 1 1 1 ] \"float density\" [" +
      density + " ]\n";
  for (const int depth : {0, 1, 2, 50}) {
    const Estimate exact = estimate(ball(homogeneous("m", Rgb(0.3f), Rgb(1)), depth), 20000, 3);
    expect_equal(estimate(ball(grid, depth), 30000, 4), exact, 0.03, fmt::format("depth {}", depth));
    expect_equal(estimate(ball(constant_rgb_grid("m", Rgb(0.3f), Rgb(1), 1.5), depth), 20000, 5), exact, 0.03,
                 fmt::format("depth {}", depth));
  }
}

/// A narrow view along a diameter of a ball of radius 1.
std::string along_a_diameter(const std::string& medium, float background) {
  return perspective({0, 0, 4}, {0, 0, 0}, 0.1, 5) + "WorldBegin\n" + environment(background) + medium + boundary("m", "", sphere(1));
}

TEST(HardCases, N50_emission_is_seen_through_its_own_absorption_however_thin_or_thick) {
  for (const double tau : {1e-6, 1e-3, 0.1, 1.0, 5.0, 100.0, 1e3, 1e4}) {
    // Thin media glow as bright as thick ones: it is the product with the length that is held.
    const auto sigma = static_cast<float>(tau / 2), le = static_cast<float>(1 / std::min(1.0, tau));
    const double expected = le * -std::expm1(-tau) + 0.25 * std::exp(-tau);
    const std::string what = fmt::format("tau {}", tau);
    expect_value(estimate(along_a_diameter(homogeneous("m", Rgb(sigma), Rgb(0), 0, Rgb(le)), 0.25f), 100, 1), expected, 1e-5, what);
    expect_value(estimate(along_a_diameter(constant_grid("m", Rgb(sigma), Rgb(0), 1.5, 0, Rgb(le)), 0.25f), 10000, 1), expected, 0.02,
                 what);
    expect_value(estimate(along_a_diameter(constant_rgb_grid("m", Rgb(sigma), Rgb(0), 1.5, 0, Rgb(le)), 0.25f), 10000, 1), expected, 0.02,
                 what);
    // A sum of two halves.
    const std::string halves =
        constant_grid("a", Rgb(sigma / 2), Rgb(0), 1.5, 0, Rgb(le)) + constant_grid("b", Rgb(sigma / 2), Rgb(0), 1.5, 0, Rgb(le));
    expect_value(estimate(along_a_diameter(halves + sum("m", "\"a\" \"b\""), 0.25f), 10000, 1), expected, 0.02, what + ", sum");
  }
}

TEST(HardCases, N57_a_channel_without_absorption_does_not_emit_on_a_way_without_end) {
  // The channel that does not absorb does not emit, however long the way is.
  const Estimate e = estimate(unbounded(homogeneous("m", {1, 0, 2}, Rgb(0), 0, Rgb(3)), 5), 1000, 1);
  EXPECT_NEAR(e.mean[0], 3, 1e-5);
  EXPECT_EQ(e.mean[1], 0);
  EXPECT_NEAR(e.mean[2], 3, 1e-5);
}

TEST(HardCases, N56_transmittance_is_finite_and_right_at_any_optical_depth) {
  for (const double tau : {1e-3, 1.0, 10.0, 1e2, 1e3, 1e4}) {
    const auto sigma = static_cast<float>(tau / 2);
    for (const std::string& medium : {homogeneous("m", Rgb(sigma), Rgb(0)), constant_grid("m", Rgb(sigma), Rgb(0), 1.5),
                                      constant_rgb_grid("m", Rgb(sigma), Rgb(0), 1.5)}) {
      const Estimate e = estimate(along_a_diameter(medium, 1), 10000, 1);
      const double expected = std::exp(-tau);
      EXPECT_TRUE(std::isfinite(e.mean[0]));
      if (tau > 5)  // rare events: 4.9 standard errors mean little, the bound of one part in a thousand of the light does
        EXPECT_NEAR(e.mean[0], expected, 1e-3) << tau;
      else
        expect_value(e, expected, 0.02, fmt::format("tau {}", tau));
    }
    // Half of what is met scatters: brighter than black, darker than the furnace.
    for (const std::string& medium : {homogeneous("m", Rgb(sigma), Rgb(sigma)), constant_grid("m", Rgb(sigma), Rgb(sigma), 1.5)}) {
      const Estimate e = estimate(along_a_diameter(medium, 1), 500, 1);
      EXPECT_TRUE(e.mean[0] > 0 && e.mean[0] < 1.5) << tau << ": " << e.mean[0];
    }
    // A glowing ball in the dark, in closed form: Le (1 − exp(−τ)).
    const Estimate glow = estimate(along_a_diameter(homogeneous("m", Rgb(sigma), Rgb(0), 0, Rgb(2)), 0), 10, 1);
    EXPECT_NEAR(glow.mean[0], -2 * std::expm1(-tau), -2e-5 * std::expm1(-tau)) << tau;
  }
}

TEST(HardCases, N51_transmittance_of_a_medium_without_end_is_zero_or_one) {
  // A floor under a distant light that shines straight down; the camera is a unit above it. Green is not attenuated.
  const std::string floor =
      homogeneous("m", {0.1f, 0, 2}, Rgb(0)) + "MediumInterface \"\" \"m\"\n" + perspective({0, 1, 0}, {0, 0, 0}, 10, 1) +
      "WorldBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ .5 .5 .5 ]\nRotate -90 1 0 0\nShape \"disk\" \"float radius\" 10\nIdentity\n"
      "LightSource \"distant\" \"point3 from\" [ 0 1 0 ] \"point3 to\" [ 0 0 0 ] \"rgb L\" [ 2 2 2 ]\n";
  const Estimate e = estimate(floor, 100, 1);
  EXPECT_EQ(e.mean[0], 0);
  EXPECT_NEAR(e.mean[1], 0.5 * 2 / 3.14159265358979, 1e-5);
  EXPECT_EQ(e.mean[2], 0);
  EXPECT_EQ(e.counters.nonfinite, 0u);
}

TEST(HardCases, N09_an_empty_grid_is_vacuum_to_the_bit) {
  const auto scene = [](const std::string& medium) {
    std::string zeros;
    for (int i = 0; i < 27; ++i) zeros += " 0";
    return perspective({0, 0.5, 4}, {0, 0, 0}, 40, 10) + "WorldBegin\n" + environment(1) +
           "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 3 \"integer ny\" 3 \"integer nz\" 3 \"point3 p0\" [ -1 -1 "
           "-1 ]\n"
           "\"point3 p1\" [ 1 1 1 ] \"rgb Le\" [ 5 5 5 ] \"float density\" [" +
           zeros + " ]\n" + boundary(medium, "", sphere(1)) + sphere(0.5) + sphere(10, {0, -11, 0});
  };
  EXPECT_EQ(radiances(compile(scene("m")), 2000, 5), radiances(compile(scene("")), 2000, 5));
}

}  // namespace
}  // namespace woodcock::testing
