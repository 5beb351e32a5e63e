// The same light found in different ways: by sampling lights, by chance, through boundaries (tests/hard_cases has more);
// and what boundaries mean.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "renderer/transport/transmittance.h"
#include "tests/statistical/scene_text.h"
#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

using reference::box;

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

std::string uniform_grid(const std::string& name, IVec3 n, DVec3 p0, DVec3 p1, const std::string& density, Rgb sigma_a, Rgb sigma_s) {
  return fmt::format(
      "MakeNamedMedium \"{}\" \"string type\" \"uniformgrid\" \"integer nx\" {} \"integer ny\" {} \"integer nz\" {} \"point3 p0\" [ {} {} "
      "{} "
      "] \"point3 p1\" [ {} {} {} ] \"rgb sigma_a\" [ {} {} {} ] \"rgb sigma_s\" [ {} {} {} ] \"float density\" [ {} ]\n",
      name, n.x, n.y, n.z, p0.x, p0.y, p0.z, p1.x, p1.y, p1.z, sigma_a.r, sigma_a.g, sigma_a.b, sigma_s.r, sigma_s.g, sigma_s.b, density);
}

/// A closed white room with a lamp, seen through a slab whose layers beat against the comb of ray marching, so that its estimates
/// of the transmittance are often negative.
std::string room_behind_layers() {
  std::string density;
  for (int i = 0; i < 22; ++i) density += i % 2 == 0 ? " 1" : " 0";
  return perspective({0, 0, -3}, {0, 0, 0}, 4, 12) + "WorldBegin\n" +
         uniform_grid("g", {1, 1, 22}, {-10, -10, -1}, {10, 10, 1}, density, Rgb(2), Rgb(0)) +
         boundary("g", "", box({-0.5, -0.5, -1}, {0.5, 0.5, 1})) + "Material \"diffuse\" \"rgb reflectance\" [ .95 .95 .95 ]\n" +
         lamp("Translate 0 0 3\nShape \"disk\" \"float radius\" 2.5 \"float innerradius\" 1\n") + box({-4, -4, -4}, {4, 4, 4});
}

// Where a negative path were ended like a black one, the mean would be half as large again.
TEST(Strategies, PathsOfNegativeThroughputCountLikeOthers) {
  CompiledScene tracked = compile(room_behind_layers());
  tracked.settings.features.take_out(Feature::kRayMarchedShadows);
  const Estimate expected = estimate(tracked, 60000, 1);
  expect_equal(estimate(with_estimator(compile(room_behind_layers()), {"uniform-path"}), 200000, 2), expected, 0.12, "uniform-path");
  expect_equal(estimate(room_behind_layers(), 400000, 3), expected, 0.12, "auto");
}

// From the first of two rough bodies that touch, a lamp within the second is seen across both faces: by light sampling as by chance.
TEST(Strategies, ALampBehindTheJoinedFaceOfTwoRoughBodiesIsSampled) {
  const auto glass = [](double eta, const std::string& shape) {
    return fmt::format("AttributeBegin\nMaterial \"dielectric\" \"float eta\" {} \"float roughness\" 0.3\n{}AttributeEnd\n", eta, shape);
  };
  const std::string scene = perspective({0, 0, -6}, {0, 0, 0}, 10, 3) + "WorldBegin\n" + glass(1.5, box({-1, -1, -1}, {1, 1, 0})) +
                            glass(1.3, box({-1, -1, 0}, {1, 1, 2})) + "Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\n" +
                            lamp(sphere(0.5, {0, 0, 1}));
  CompiledScene by_chance = compile(scene), by_light = compile(scene);
  by_chance.settings.features.take_out(Feature::kLightSampling);
  by_light.settings.features.take_out(Feature::kMis);
  const Estimate expected = estimate(by_chance, 200000, 1);
  expect_equal(estimate(scene, 200000, 2), expected, 0.03, "both");
  expect_equal(estimate(by_light, 200000, 3), expected, 0.05, "light sampling alone where it may");
}

/// A voxel of 10⁶ beside thin matter, in front of a lamp: a ray past it has a million look-ups.
std::string thin_matter_under_a_high_bound() {
  std::string density = "1e6";
  for (int i = 1; i < 16; ++i) density += " 1e-4";
  return perspective({0.75, 0.75, -3}, {0.75, 0.75, 0}, 1, 1) + "WorldBegin\n" +
         uniform_grid("g", {4, 4, 1}, DVec3(0), DVec3(1), density, Rgb(0), Rgb(1)) + boundary("g", "", box(DVec3(0), DVec3(1))) +
         "AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" true\n" +
         "Shape \"trianglemesh\" \"point3 P\" [ .6 .6 2  .9 .6 2  .9 .9 2  .6 .9 2 ] \"integer indices\" [ 0 2 1 0 3 2 ]\nAttributeEnd\n";
}

// Each ray decides a million times on a scattering of probability 10⁻¹⁰. Of 60 rays 0.006 scatter in the mean, so that 0.6 % of all
// seeds see one or more; with decisions in 24 digits it would be 3.6 rays.
TEST(Strategies, ThinMatterUnderAHighBoundScattersAsRarelyAsItShould) {
  for (const bool achromatic : {true, false}) {
    CompiledScene compiled = compile(thin_matter_under_a_high_bound());
    compiled.settings.plan = achromatic;  // without the plan all channels are carried
    EXPECT_GT(estimate(compiled, 60, 1).mean[0], 1 - 0.5 / 60);
  }
}

// On its way through a million look-ups a ray meets not one vertex at which paths look for a signal.
TEST(Strategies, LongFlightsOfPathsAndShadowRaysCanBeCancelled) {
  constexpr uint64_t kWhole = 900000, kCancelled = 65536;
  std::atomic<uint64_t> vertices{0};
  std::atomic<bool> cancel{false};
  const PathWatch watch{vertices, cancel};
  const PathKey key = path_key(1, 0, 0, 0);
  const auto look_ups = [&](CompiledScene scene, bool shadow) {
    scene.settings.watch = &watch;
    const RenderPlan plan(*scene.world, scene.settings);
    const Ray ray = camera_sample(*scene.world, key, 0, 0).ray;
    PathCounters counters;
    if (shadow) {
      Stream random = stream(key, 0, Purpose::kTransmittance);
      estimate_transmittance(scene.world->media[0], ray, 10, random, counters, plan.transmittance);
    } else {
      scene.radiance(*scene.world, plan, ray, key, counters);
    }
    return counters.medium_lookups;
  };
  const auto all_channels = [](CompiledScene scene) {
    scene.settings.plan = false;
    return scene;
  };
  const std::string text = thin_matter_under_a_high_bound();
  for (const bool cancelled : {false, true}) {
    cancel = cancelled;
    const auto expect = [&](uint64_t count, const char* what) {
      EXPECT_GE(count, cancelled ? 1 : kWhole) << what;
      EXPECT_LE(count, cancelled ? kCancelled : 2 * kWhole) << what;
    };
    expect(look_ups(compile(text), false), "one channel");
    expect(look_ups(all_channels(compile(text)), false), "all channels");
    expect(look_ups(with_estimator(compile(text), {"woodcock"}), false), "woodcock");
    expect(look_ups(compile(text), true), "shadow ray");
  }
}

// Sources that nothing dims, without end: no number is right, and none is given.
TEST(Strategies, ScatteringWithoutExtinctionAndWithoutEndIsReported) {
  TransferTerms terms;
  terms.absorption = terms.out_scattering = false;
  const std::string fog = "MediumInterface \"\" \"m\"\n";
  const std::string scene = homogeneous("m", Rgb(0), Rgb(1)) + fog + perspective({0, 0, 4}, {0, 0, 0}, 10, 3) + "WorldBegin\n" +
                            environment(1) + "Material \"diffuse\"\nMediumInterface \"m\" \"m\"\n" + sphere(0.1);
  const CompiledScene compiled = compile(scene, terms);
  const std::vector<Rgb> found = radiances(compiled, 64, 1);
  EXPECT_TRUE(std::any_of(found.begin(), found.end(), [](Rgb r) { return std::isinf(r.r); }));
  EXPECT_EQ(estimate(compiled, 64, 1).counters.truncated, 0u);
}

}  // namespace
}  // namespace woodcock::testing
