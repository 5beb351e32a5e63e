// The same light by every way there is: by each estimator of the list, and by `auto` without each of its parts.
//
// False alarms: see tests/transport/estimate.h.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "renderer/frame/frame_renderer.h"
#include "tests/scene/scene_folder.h"
#include "tests/statistical/reference_cases.h"
#include "tests/statistical/reference_scenes.h"
#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

/// `auto` without a part of it.
CompiledScene without(const std::string& text, Feature feature) {
  CompiledScene scene = compile(text);
  scene.settings.features.take_out(feature);
  return scene;
}

struct SceneText {
  std::string name, text;
  int samples;
  bool scatters = true;  ///< in media, which uniform-path leaves out
};

std::string lamp(const std::string& shape) {
  return "AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [ 6 6 6 ]\n" + shape + "AttributeEnd\n";
}

/// Lights of an extent, so that every estimator meets them; grey and chromatic media; emission behind an interface.
std::vector<SceneText> scenes() {
  const std::string head = perspective({0, 0, 4}, {0, 0, 0}, 35, 6) + "WorldBegin\n";
  std::string density;
  for (int i = 0; i < 64; ++i) density += i % 3 == 0 ? " 0" : i % 5 == 0 ? " 3" : " .7";
  const auto grid = [&](const std::string& more) {
    return "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 4 \"integer ny\" 4 \"integer nz\" 4 \"point3 p0\" [ -1 -1 "
           "-1 "
           "] \"point3 p1\" [ 1 1 1 ] " +
           more + " \"float density\" [" + density + " ]\n";
  };
  const std::string fog = homogeneous("m", Rgb(0.3f), Rgb(0.7f), 0.3), ball = boundary("m", "", sphere(1));
  return {
      {"surfaces",
       head + environment(0.5f) + lamp(sphere(0.7, {1.5, 1.5, 1})) + "Material \"diffuse\" \"rgb reflectance\" [ .6 .5 .4 ]\n" +
           sphere(0.8) + sphere(0.5, {0, -1.2, 0.2}),
       40000, false},
      {"glowing grid behind an interface",
       head + environment(0.2f) + grid("\"rgb sigma_a\" [ 1 1 1 ] \"rgb sigma_s\" [ 0 0 0 ] \"rgb Le\" [ 2 1 .5 ]") + ball, 20000, false},
      {"fog", head + environment(0.5f) + lamp(sphere(0.7, {1.5, 1.5, 1})) + fog + ball, 40000},
      {"glowing fog that scatters", head + environment(0.2f) + homogeneous("m", Rgb(0.3f), Rgb(0.7f), -0.3, Rgb(2)) + ball + sphere(0.4),
       40000},
      {"grid",
       head + environment(0.5f) + lamp(sphere(0.7, {1.5, 1.5, 1})) + grid("\"rgb sigma_a\" [ .2 .2 .2 ] \"rgb sigma_s\" [ 2 2 2 ]") + ball,
       40000},
      {"chromatic grid that glows",
       head + environment(0.5f) + grid("\"rgb sigma_a\" [ .2 0 .5 ] \"rgb sigma_s\" [ 2 1 0 ] \"rgb Le\" [ 1 1 1 ]") + ball, 40000},
  };
}

TEST(HardCases, N22_every_unbiased_way_gives_the_same_picture) {
  for (const SceneText& scene : scenes()) {
    const Estimate reference = estimate(scene.text, scene.samples, 1);
    uint64_t seed = 2;
    for (const EstimatorInfo& e : estimators()) {
      if (e.biased() || std::string(e.name) == "auto" || (scene.scatters && !e.media_scatter)) continue;
      expect_equal(estimate(with_estimator(compile(scene.text), {e.name}), scene.samples, seed++), reference, 0.03,
                   scene.name + " by " + e.name);
    }
    for (const FeatureInfo& f : kFeatures)
      expect_equal(estimate(without(scene.text, f.feature), scene.samples, seed++), reference, 0.03, scene.name + " without " + f.name);
    CompiledScene general = compile(scene.text);
    general.settings.plan = false;
    expect_equal(estimate(general, scene.samples, seed++), reference, 0.03, scene.name + " without the plan");
    // The kernel of every effect follows the same plan: the same bits.
    CompiledScene full = compile(scene.text);
    full.settings.full_kernel = true;
    EXPECT_EQ(radiances(full, 2000, 1), radiances(compile(scene.text), 2000, 1)) << scene.name;
  }
}

// A lamp in a ball of fog in front of a plate that lies in a boundary: light samples and chance agree on what the media between
// them take.
TEST(HardCases, N13_light_found_by_chance_at_a_boundary_is_the_light_that_is_sampled) {
  const std::string text =
      perspective({0, 1.2, 3}, {0, 0, 0}, 30, 5) + "WorldBegin\n" + environment(0.2f) + homogeneous("above", Rgb(0.4f), Rgb(0.4f)) +
      homogeneous("below", Rgb(2), Rgb(1)) + lamp("Translate 0 1.5 0\nShape \"sphere\" \"float radius\" 0.6\n") +
      "AttributeBegin\nMaterial \"diffusetransmission\" \"rgb reflectance\" [ .4 .4 .4 ] \"rgb transmittance\" [ .5 .5 .5 "
      "]\nMediumInterface \"below\" \"above\"\nRotate -90 1 0 0\nShape \"disk\" \"float radius\" 2.5\nAttributeEnd\n"
      "AttributeBegin\nMaterial \"interface\"\nRotate -90 1 0 0\nMediumInterface \"above\" \"\"\nShape \"sphere\" \"float "
      "radius\" 2.5 \"float zmin\" 0\nMediumInterface \"below\" \"\"\nShape \"sphere\" \"float radius\" 2.5 \"float zmax\" "
      "0\nAttributeEnd\n";
  expect_equal(estimate(without(text, Feature::kLightSampling), 100000, 2), estimate(text, 60000, 1), 0.02, "by chance");
}

// Fog and a lamp in a shell of rough glass, through which no light sample gets, and in one of index 1 of an interface.
TEST(HardCases, N17_light_in_glass_is_the_same_with_and_without_light_samples) {
  for (const char* shell : {"Material \"dielectric\" \"float eta\" 1.5", "Material \"interface\""}) {
    const std::string text = perspective({0, 0, 4}, {0, 0, 0}, 35, 30) + "WorldBegin\n" + environment(0.3f) +
                             homogeneous("m", Rgb(0.4f), Rgb(1), 0.3) + lamp(sphere(0.35, {0.3, 0, 0})) + "AttributeBegin\n" + shell +
                             "\nMediumInterface \"m\" \"\"\n" + sphere(1) + "AttributeEnd\nMaterial \"diffuse\"\n" +
                             sphere(0.6, {0, -1.7, 0});
    expect_equal(estimate(without(text, Feature::kLightSampling), 60000, 2), estimate(text, 60000, 1), 0.02, shell);
  }
}

TEST(HardCases, N42_roulette_on_and_off_agree) {
  std::vector<SceneText> all = scenes();
  // A room that glows: an eighth of its light comes from vertices at which the throughput is below the threshold of roulette.
  all.push_back({"room",
                 perspective({0, 0, 4}, {0, 0, 0}, 35, 30) +
                     "WorldBegin\nAttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] " +
                     "\"bool twosided\" true\nMaterial \"diffuse\" \"rgb reflectance\" [ .5 .5 .5 ]\n" + sphere(6) + "AttributeEnd\n",
                 10000});
  for (const SceneText& scene : all)
    expect_equal(estimate(without(scene.text, Feature::kRoulette), scene.samples, 2), estimate(scene.text, scene.samples, 1), 0.02,
                 scene.name);
}

/// The transmittance that a march with steps of `step` gives on average along −z through the medium of a scene, by the
/// definition: cells of the segment [z0, z1], each looked up at the fraction u, and u averaged over 0..1.
double marched_transmittance(const CompiledScene& scene, double step) {
  const CameraSample camera = camera_sample(*scene.world, path_key(1, 4, 4, 0), 4, 4);
  Ray ray = camera.ray;
  const double length = step * scene.world->space.scale;
  const auto entry = scene.world->geometry.intersect(ray, kInf);
  ray.o = offset_origin(scene.world->geometry.surface(*entry, ray), ray.d);
  const double z = scene.world->geometry.intersect(ray, kInf)->t;
  constexpr int kU = 400;
  double sum = 0;
  for (int i = 0; i < kU; ++i) {
    double depth = 0;
    for (double a = 0; a < z; a += length) {
      const double b = std::min(z, a + length);
      depth += (b - a) * static_cast<double>(scene.world->media[0].sigma_t(ray.at(static_cast<float>(a + (i + 0.5) / kU * (b - a)))).g);
    }
    sum += std::exp(-depth) / kU;
  }
  return sum;
}

reference::Scene reference_scene(const std::string& id) {
  for (const auto& c : reference::read_cases(WOODCOCK_SOURCE_DIR "/tests/statistical/cases.json"))
    if (c.id == id) return reference::scenes_of(c).back();
  throw std::out_of_range(id);
}

// P07 and P08. E exp(−τ̂) ≥ exp(−τ), and the difference falls at least with the square of the step (eq. 10 of the paper, in numbers).
TEST(HardCases, N23_marched_transmittance_is_too_large_by_an_error_that_falls_with_the_step) {
  for (const std::string id : {"P07", "P08"}) {
    const reference::Scene reference = reference_scene(id);
    const CompiledScene scene = compile(reference.text);
    double before = 0;
    for (const double step : {1.6, 0.8, 0.4}) {
      const double bias = marched_transmittance(scene, step) / reference.expected - 1;
      if (before > 1e-4) {
        EXPECT_LT(bias, before / 3.2) << id << " step " << step;
      }
      EXPECT_GT(bias, -2e-5) << id << " step " << step;
      before = bias;
    }
    EXPECT_GT(marched_transmittance(scene, 1.6) / reference.expected, 1.05) << id << ": the first step must show something";
  }
}

TEST(HardCases, N23_estimators_that_march_show_that_error_and_no_other) {
  for (const std::string id : {"P07", "P08"}) {
    const CompiledScene scene = compile(reference_scene(id).text);
    for (const double step : {1.6, 0.8}) {
      const double expected = marched_transmittance(scene, step);
      for (const std::string name : {"march", "march-phase"})
        expect_value(estimate(with_estimator(compile(reference_scene(id).text), {name, step}), 20000, 11), expected, 0.02,
                     fmt::format("{} {} step {}", name, id, step));
      expect_value(estimate(with_estimator(compile(reference_scene(id).text), {"line", step, 16}), 20000, 12), expected, 0.02,
                   fmt::format("line {} step {}", id, step));
    }
  }
}

// A point light in fog, 0.02 beside the ray: the inverse square of the distance to it makes free flights vary without bound as it
// comes nearer. Distances in proportion to it have the exact value, too, at a small part of the variance.
TEST(HardCases, N52_a_point_light_in_fog_is_exact_and_has_little_variance) {
  const double h = 0.02, ahead = 3, sigma_s = 0.5, sigma_t = 0.6;
  const std::string text = homogeneous("m", Rgb(0.1f), Rgb(0.5f)) + "MediumInterface \"\" \"m\"\n" +
                           perspective({0, 0, 0}, {0, 0, 1}, 1e-3, 1) + "WorldBegin\n" +
                           fmt::format("LightSource \"point\" \"point3 from\" [ {} 0 {} ] \"rgb I\" [ 1 1 1 ]\n", h, ahead);
  // ∫ σs/(4π) exp(−σt (s + r))/r² ds with s − 3 = h tan θ, so that ds/r² = dθ/h.
  double expected = 0;
  constexpr int kSteps = 200000;
  const double from = std::atan(-ahead / h), to = std::atan(60 / h);
  for (int i = 0; i < kSteps; ++i) {
    const double theta = from + (to - from) * (i + 0.5) / kSteps;
    expected += sigma_s / (4 * M_PI) * std::exp(-sigma_t * (ahead + h * std::tan(theta) + h / std::cos(theta))) / h * (to - from) / kSteps;
  }
  const Estimate equiangular = estimate(text, 20000, 1), by_flight = estimate(without(text, Feature::kEquiangular), 400000, 2);
  expect_value(equiangular, expected, 5e-3, "equiangular");
  expect_value(by_flight, expected, 0.05, "by free flight");
  const auto variance = [](const Estimate& e) { return e.error[1] * e.error[1] * e.count; };
  EXPECT_LT(variance(equiangular), variance(by_flight) / 10) << variance(equiangular) << " and " << variance(by_flight);
}

// The reference case with a light half a mean free path beside the ray, in both containers, with and without.
TEST(HardCases, N52_airlight_is_exact_with_and_without_equiangular_distances) {
  const reference::Case c = [] {
    for (const auto& one : reference::read_cases(WOODCOCK_SOURCE_DIR "/tests/statistical/cases.json"))
      if (one.id == "P14") return one;
    throw std::out_of_range("P14");
  }();
  for (const reference::Scene& scene : reference::scenes_of(c)) {
    expect_value(estimate(scene.text, 100000, 1), scene.expected, 0.01, scene.name);
    expect_value(estimate(without(scene.text, Feature::kEquiangular), 100000, 2), scene.expected, 0.01, scene.name + " by free flight");
  }
}

// What marches says that it is biased, by what, and with which step, in the list and in the picture; and it takes as many steps
// as the ray is long, however many those are.
TEST(HardCases, N68_estimators_that_march_are_labelled_biased_and_never_capped) {
  const SceneFolder folder;
  const std::string file =
      folder.write("scene.pbrt", "Film \"rgb\" \"integer xresolution\" 2 \"integer yresolution\" 2\nCamera \"perspective\"\nWorldBegin\n" +
                                     environment(1));
  for (const EstimatorInfo& e : estimators()) {
    EXPECT_EQ(e.biased(), e.step) << e.name;
    FrameSettings settings;
    settings.estimator = e.name;
    if (e.step) settings.step = 0.1;
    const FrameRenderer frame(file, settings, {});
    const auto field = [&](const std::string& name) {
      for (const auto& [key, value] : frame.header().settings)
        if (key == name) return value;
      return std::string();
    };
    EXPECT_EQ(field("biased"), e.biased() ? "yes" : "no") << e.name;
    EXPECT_EQ(field("bias"), e.bias) << e.name;
    EXPECT_EQ(field("step").empty(), !e.step) << e.name;
  }
  // Four hundred thousand steps through a ball: the transmittance of a step too many or too few would be off by 5e-6 each.
  for (const char* name : {"march", "line", "march-phase"}) {
    const std::string ball = perspective({0, 0, 4}, {0, 0, 0}, 0.01, 5) + "WorldBegin\n" + environment(1) +
                             constant_grid("m", Rgb(1), Rgb(0), 1.5) + boundary("m", "", sphere(1));
    EXPECT_NEAR(estimate(with_estimator(compile(ball), {name, 5e-6, 1}), 2, 1).mean[1], std::exp(-2),
                name == std::string("line") ? 1 : 2e-5)
        << name;
  }
}

}  // namespace
}  // namespace woodcock::testing
