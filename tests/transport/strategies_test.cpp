// The same light found in different ways: by sampling lights, by chance, through boundaries and glass (hard cases N13,
// N17, N22, N33, N42, N61); and what boundaries mean.
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

// A point light of intensity I and a small sphere of the same: I = L π r².
TEST(Strategies, APointLightEqualsATinySphere) {
  const std::string medium = homogeneous("m", Rgb(0.2f), Rgb(0.5f), 0.5);
  for (const std::string& fog : {std::string(), boundary("m", "", sphere(3))}) {
    const std::string scene = floor_below(0.8, 3) + medium + fog;
    const double r = 1e-3, intensity = 2;
    const std::string point = fmt::format("LightSource \"point\" \"point3 from\" [ 0.3 1 0.2 ] \"rgb I\" [ {0} {0} {0} ]\n", intensity);
    const std::string ball = fmt::format("AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [ {0} {0} {0} ]\n{1}AttributeEnd\n",
                                         intensity / (kPiD * r * r), sphere(r, {0.3, 1, 0.2}));
    expect_equal(estimate(scene + ball, 60000, 1), estimate(scene + point, 60000, 2), 0.03, fog.empty() ? "in vacuum" : "in fog");
  }
}

// An enclosing sphere that glows and an environment are one and the same.
TEST(Strategies, AnEnclosingLampEqualsAnEnvironment) {
  const std::string medium = homogeneous("m", Rgb(0.3f), Rgb(1), 0.3);
  const std::string bodies = perspective({0, 0, 4}, {0, 0, 0}, 50, 6) + "WorldBegin\n" + medium +
                             boundary("m", "", sphere(1, {-1.1, 0, 0})) +
                             "AttributeBegin\nMaterial \"dielectric\"\nMediumInterface \"m\" \"\"\n" + sphere(0.9, {1.1, 0, 0}) +
                             "AttributeEnd\nMaterial \"diffuse\"\n" + sphere(0.5, {0, 1.2, 0}) +
                             "Material \"dielectric\" \"float roughness\" 0.3\n" + sphere(0.5, {0, -1.2, 0});
  expect_equal(
      estimate(bodies + "ReverseOrientation\n" + lamp(sphere(50), "Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\n"), 60000, 1),
      estimate(bodies + environment(3), 60000, 2), 0.01, "six bounces");
}

// A lamp in a medium in glass: shadow rays never get through the glass, chance does. Smooth glass of index 1 must show
// what an interface shows, where shadow rays do get through.
TEST(Strategies, GlassOfIndexOneEqualsAnInterface) {
  const std::string medium = homogeneous("m", Rgb(0.3f), Rgb(1.5f), 0.3);
  const auto scene = [&](const char* material) {
    return floor_below(0.8, 4) + medium + lamp(sphere(0.3, {0, 1.5, 0})) + "AttributeBegin\nMaterial " + material +
           "\nMediumInterface \"m\" \"\"\n" + sphere(0.7, {0, 1.5, 0}) + "AttributeEnd\n";
  };
  // Depth counts the pass through a surface, so the comparison is of one more scattering at each crossing: deep enough
  // for neither to matter is deep enough for both.
  const auto deep = [](std::string text) {
    text.replace(text.find("\"integer maxdepth\" 4"), 20, "\"integer maxdepth\" 100");
    return text;
  };
  expect_equal(estimate(deep(scene("\"dielectric\" \"float eta\" 1")), 300000, 1), estimate(deep(scene("\"interface\"")), 60000, 2), 0.03,
               "lamp in fog in a shell");
}

// A boundary close before or behind a lamp neither hides nor leaks its light (N61). Gaps below the rounding of
// positions, about 1e-7 here, are another matter: there one of the two is jumped over.
TEST(Boundaries, NextToALampChangeNothing) {
  const double expected = 0.8 * 3 / 2;
  for (const double gap : {1e-6, 1e-5, 1e-4, 1e-3, 0.1, -1e-6, -1e-3}) {
    const std::string plane = fmt::format(
        "AttributeBegin\nMaterial \"interface\"\nMediumInterface \"\" \"\"\nShape \"trianglemesh\" \"point3 P\" [ -30 {0} -30  30 {0} "
        "-30  30 {0} 30  -30 {0} 30 ] \"integer indices\" [ 0 1 2  0 2 3 ]\nAttributeEnd\n",
        1 - gap);
    expect_value(estimate(floor_below(0.8, 1) + plane + lamp(ceiling(1, 1)), 20000, 1), expected, 0.01, fmt::format("gap {}", gap));
  }
}

// A shape without MediumInterface keeps the medium of the ray (N13): a diffuse plate in fog is lit through the fog.
TEST(Boundaries, AShapeWithoutMediumInterfaceKeepsTheMedium) {
  const std::string fog = homogeneous("m", Rgb(0.7f), Rgb(0));
  const std::string light = "LightSource \"distant\" \"point3 from\" [ 0 1 0 ] \"point3 to\" [ 0 0 0 ] \"rgb L\" [ 1 1 1 ]\n";
  // A floor inside of a ball of radius 20: the light enters at height 20, the camera is at 0.5.
  const std::string plate =
      "AttributeBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ .8 .8 .8 ]\nRotate -90 1 0 0\nShape \"disk\" \"float radius\" "
      "1\nAttributeEnd\n";
  const Estimate e =
      estimate(perspective({0, 0.5, 0}, {0, 0, 0}, 0.1, 1) + "WorldBegin\n" + fog + plate + light + boundary("m", "", sphere(2)), 1000, 1);
  EXPECT_NEAR(e.mean[0], 0.8 / kPiD * std::exp(-0.7 * 2.5), 1e-4);
}

// Overlapping balls: the last boundary that was crossed says which medium it is (N15).
TEST(Boundaries, TheLastOneCrossedWins) {
  const std::string media = homogeneous("m", Rgb(1), Rgb(0)) + homogeneous("n", Rgb(0.1f), Rgb(0));
  // Along z from 4: m from 1 to 0.5 (where n begins), n to -1 (where m ends and vacuum begins), vacuum to the end of n.
  const Estimate e = estimate(perspective({0, 0, 4}, {0, 0, 0}, 0.01, 1) + "WorldBegin\n" + environment(1) + media +
                                  boundary("m", "", sphere(1)) + boundary("n", "", sphere(1, {0, 0, -0.5})),
                              100, 1);
  EXPECT_NEAR(e.mean[0], std::exp(-0.5 - 0.15), 1e-4);
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
