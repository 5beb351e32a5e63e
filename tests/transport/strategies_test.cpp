// The same light found in different ways: by sampling lights, by chance, through boundaries (tests/hard_cases has more);
// and what boundaries mean.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

constexpr double kPiD = 3.14159265358979323846;

/// Looking down at a small part of a wide floor in the plane y = 0.
std::string floor_below(double albedo, int depth) {
  return perspective({0, 0.5, 0}, {0, 0, 0}, 2, depth) + fmt::format(
                                                             "WorldBegin\nAttributeBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ {0} "
                                                             "{0} {0} ]\nRotate -90 1 0 0\nShape \"disk\" \"float "
                                                             "radius\" 20\nAttributeEnd\n",
                                                             albedo);
}
std::string lamp(const std::string& shape, const char* extra = "") {
  return "AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [ 3 3 3 ]\n" + std::string(extra) + shape + "AttributeEnd\n";
}
/// A disk of radius r at height h that faces down.
std::string ceiling(double r, double h, const std::string& parameters = "") {
  return fmt::format("Translate 0 {} 0\nRotate 90 1 0 0\nShape \"disk\" \"float radius\" {} {}\n", h, r, parameters);
}

// Radiance of a diffuse floor under a disk, on its axis: a L sin²θ (the form factor r²/(r² + h²)). The camera stands
// between them and hides nothing.
TEST(Strategies, ADiskLampLightsAFloorByItsFormFactor) {
  for (const double r : {0.1, 1.0, 10.0}) {
    const double expected = 0.8 * 3 * r * r / (r * r + 1);
    expect_value(estimate(floor_below(0.8, 1) + lamp(ceiling(r, 1)), 20000, 1), expected, 0.01, fmt::format("lamp of radius {}", r));
    // Textured opacity 1: light samples leave it out, and it is found by chance only.
    const std::string opaque = "Texture \"one\" \"float\" \"constant\" \"float value\" 1\n";
    expect_value(estimate(floor_below(0.8, 1) + opaque + lamp(ceiling(r, 1, "\"texture alpha\" \"one\"")), r < 1 ? 400000 : 40000, 1),
                 expected, 0.02, fmt::format("lamp of radius {} found by chance", r));
    // Half there: half the light, whichever way.
    expect_value(estimate(floor_below(0.8, 1) + lamp(ceiling(r, 1, "\"float alpha\" 0.5")), 40000, 1), expected / 2, 0.02,
                 fmt::format("half a lamp of radius {}", r));
  }
}

TEST(Strategies, LightThroughAnIndexMatchedShellIsTheSameLight) {
  // Between lamp and floor: an interface of vacuum, and one of a medium that only absorbs.
  const std::string medium = homogeneous("m", Rgb(1), Rgb(0));
  const auto scene = [&](const std::string& inside) {
    return floor_below(0.8, 1) + medium + "AttributeBegin\nMaterial \"interface\"\nMediumInterface \"" + inside +
           "\" \"\"\nShape \"trianglemesh\" \"point3 P\" [ -30 .7 -30  30 .7 -30  30 .7 30  -30 .7 30 ] \"integer indices\" [ 0 1 2  0 2 3 "
           "]\n" +
           // The normal of the upper face points up, that of the lower one down.
           "ReverseOrientation\nShape \"trianglemesh\" \"point3 P\" [ -30 .8 -30  30 .8 -30  30 .8 30  -30 .8 30 ] \"integer indices\" [ 0 "
           "1 2  0 2 3 ]\n"
           "AttributeEnd\n" +
           lamp(ceiling(0.05, 1));
  };
  const double expected = 0.8 * 3 * 0.05 * 0.05 / (0.05 * 0.05 + 1);
  // The lamp and the view are so small that every ray is nearly vertical: it meets 0.1 of absorption 1.
  EXPECT_NEAR(estimate(scene(""), 10000, 1).mean[0] / expected, 1, 1e-3);
  EXPECT_NEAR(estimate(scene("m"), 10000, 1).mean[0] / (expected * std::exp(-0.1)), 1, 2e-3);
}

TEST(Strategies, ALampWithTheMaterialInterfaceDoesNotShine) {
  const Estimate e = estimate(floor_below(0.8, 1) + lamp(ceiling(1, 1), "Material \"interface\"\n"), 1000, 1);
  EXPECT_EQ(e.mean[0], 0);
}

// Coincident boundaries neither crash nor hang, and no path is cut off.
TEST(Boundaries, CoincidentOnesEndEveryPath) {
  const std::string media = homogeneous("m", Rgb(0.5f), Rgb(0.5f)) + homogeneous("n", Rgb(0.1f), Rgb(2));
  std::string shells;
  for (int i = 0; i < 20; ++i) shells += boundary(i % 2 ? "m" : "n", "", sphere(1));
  const Estimate e = estimate(perspective({0, 0, 4}, {0, 0, 0}, 40, 50) + "WorldBegin\n" + environment(1) + media + shells, 5000, 1);
  EXPECT_TRUE(std::isfinite(e.mean[0]));
  EXPECT_EQ(e.counters.truncated, 0u);
  EXPECT_EQ(e.counters.nonfinite, 0u);
}

}  // namespace
}  // namespace woodcock::testing
