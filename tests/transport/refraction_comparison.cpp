#include "tests/transport/refraction_comparison.h"

#include <gtest/gtest.h>

#include <cmath>

#include "renderer/scene/read_scene.h"
#include "renderer/transport/kernel_group.h"

namespace woodcock::testing {
namespace {

struct Mean {
  double value = 0, variance = 0;  ///< of the mean
  double per_sample = 0;
};

/// Luminance of the whole picture.
Mean render(const World& world, RadianceFunction run, Features features, uint64_t seed, int samples) {
  PathSettings settings;
  settings.frame_seed = frame_seed(seed, 0);
  settings.max_depth = 40;
  settings.features = features;
  const RenderPlan plan(world, settings);
  PathCounters count;
  double sum = 0, squares = 0;
  for (int i = 0; i < samples; ++i) {
    const uint32_t x = static_cast<uint32_t>(i % 8), y = static_cast<uint32_t>(i / 8 % 8);
    const PathKey key = path_key(settings.frame_seed, x, y, static_cast<uint64_t>(i / 64));
    const double l = static_cast<double>(
        luminance(run(world, plan, camera_sample(world, key, static_cast<int>(x), static_cast<int>(y)).ray, key, count).radiance));
    sum += l;
    squares += l * l;
  }
  EXPECT_EQ(count.truncated, 0u);
  const double n = samples, mean = sum / n, variance = squares / n - mean * mean;
  return {mean, variance / n, variance};
}

constexpr RadianceFunction kFull = &run_kernel<kAllEffects>, kCrippled = &run_kernel<kAllEffects | kMissesWays>;

constexpr double kLimit = 4.2;

void expect_equal(const Mean& a, const Mean& b, const std::string& what) {
  EXPECT_LT(std::abs(a.value - b.value), kLimit * std::sqrt(a.variance + b.variance))
      << what << ": " << a.value << " ± " << std::sqrt(a.variance) << " and " << b.value << " ± " << std::sqrt(b.variance);
}

}  // namespace

std::string glass_body(const std::string& shape, const std::string& inside, double eta, const std::string& before) {
  return R"(LookAt 0 -4 0  0 0 0  0 0 1
Camera "perspective" "float fov" [ 26 ]
Film "rgb" "integer xresolution" [ 8 ] "integer yresolution" [ 8 ] "string filename" [ "x.exr" ]
Integrator "volpath" "integer maxdepth" [ 40 ]
WorldBegin
LightSource "infinite" "rgb L" [ .3 .3 .3 ]
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [ 20 15 10 ]
  Material "diffuse" "rgb reflectance" [ 0 0 0 ]
  Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ -.5 -1.2 2.2  -.5 -.2 2.2  .5 -.2 2.2  .5 -1.2 2.2 ]
AttributeEnd
)" + inside +
         "\nAttributeBegin\nMaterial \"dielectric\" \"float eta\" [ " + std::to_string(eta) + " ]\n" + before + shape + "\nAttributeEnd\n";
}

std::unique_ptr<const World> glass_world(const std::string& text) { return build_world(read_scene_text(text, "glass.pbrt", ".", {})); }

double compare_refraction(const std::string& text, int samples) {
  const auto world = glass_world(text);
  EXPECT_NE(world->effects & kRefractedLight, 0u);
  Features without;
  without.take_out(Feature::kDielectricBoundaries);
  const Mean chance = render(*world, kFull, without, 1, samples);
  const Mean sampled = render(*world, kFull, {}, 2, samples), crippled = render(*world, kCrippled, {}, 3, samples);
  expect_equal(chance, sampled, "by chance and sampled");
  expect_equal(chance, crippled, "by chance and with a solver that misses ways");
  expect_equal(sampled, crippled, "with a solver that misses ways and one that does not");
  return chance.per_sample / sampled.per_sample;
}

}  // namespace woodcock::testing
