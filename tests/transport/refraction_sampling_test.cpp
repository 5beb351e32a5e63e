// Light sampled through smooth glass: the picture is that of chance, whatever the solver finds.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "renderer/scene/read_scene.h"
#include "renderer/transport/kernel_group.h"

namespace woodcock {
namespace {

/// A ball of glass with `inside`, a lamp beside it and a sky.
std::string ball(const std::string& inside, double eta, const std::string& before = "") {
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
         "\nAttributeBegin\nMaterial \"dielectric\" \"float eta\" [ " + std::to_string(eta) + " ]\n" + before +
         "Shape \"sphere\" \"float radius\" 1\nAttributeEnd\n";
}

const std::string kMilk =
    R"(MakeNamedMedium "m" "string type" "homogeneous" "rgb sigma_s" [ 2.9 2.5 2 ] "rgb sigma_a" [ .1 .1 .2 ] "float g" .6)";
const std::string kMilkInside = "MediumInterface \"m\" \"\"\n";
const std::string kBallInside = R"(AttributeBegin
  Material "diffuse" "rgb reflectance" [ .8 .7 .6 ]
  Translate .2 -.1 .1
  Shape "sphere" "float radius" .5
AttributeEnd)";

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

/// 12 comparisons at 4.2 standard deviations: together they fail by chance once in 3000 sets of seeds.
constexpr double kLimit = 4.2;

void expect_equal(const Mean& a, const Mean& b, const std::string& what) {
  EXPECT_LT(std::abs(a.value - b.value), kLimit * std::sqrt(a.variance + b.variance))
      << what << ": " << a.value << " ± " << std::sqrt(a.variance) << " and " << b.value << " ± " << std::sqrt(b.variance);
}

class RefractionSampling : public ::testing::Test {
 protected:
  /// What is found by chance, by the technique and by one that misses half of the ways has the same mean. Gives the ratio of variances
  /// without and with the technique.
  double compare(const std::string& text, int samples) {
    const auto world = build_world(read_scene_text(text, "ball.pbrt", ".", {}));
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
};

TEST_F(RefractionSampling, LeavesTheMeanOfMilkInGlassWhateverWaysAreFound) {
  EXPECT_GT(compare(ball(kMilk, 1.5, kMilkInside), 200000), 1.5);
}

TEST_F(RefractionSampling, LeavesTheMeanOfABallInGlassTurnedInsideOut) {
  // Normals inwards: the index of the glass is that of what is outside.
  EXPECT_GT(compare(ball(kBallInside, 1 / 1.4, "ReverseOrientation\n"), 200000), 1.5);
}

TEST_F(RefractionSampling, LeavesTheMeanWhereAWallCoversAndTouchesTheGlass) {
  const std::string wall = R"(
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ 0 -3 -3  0 -3 3  .4 3 3  .4 3 -3 ])";
  compare(ball(kMilk + wall, 1.5, kMilkInside), 100000);
}

TEST_F(RefractionSampling, LeavesTheMeanOfMilkInABubble) { compare(ball(kMilk, 0.8, kMilkInside), 200000); }

TEST(RefractionSamplingPlan, EmptyGlassAndRoughGlassAreLeftToChance) {
  const auto effects = [](const std::string& text) {
    return build_world(read_scene_text(text, "ball.pbrt", ".", {}))->effects & kRefractedLight;
  };
  EXPECT_EQ(effects(ball("", 1.5)), 0u);
  EXPECT_EQ(effects(ball(kMilk, 1, kMilkInside)), 0u);
  EXPECT_EQ(effects(ball(kMilk, 1.5, kMilkInside + "Material \"dielectric\" \"float roughness\" .2\n")), 0u);
  EXPECT_EQ(effects(ball(kMilk, 1.5, kMilkInside + "Scale 1 1 .9\n")), 0u);
  EXPECT_NE(effects(ball(kMilk, 1.5, kMilkInside + "Scale .9 .9 .9\n")), 0u);
}

}  // namespace
}  // namespace woodcock
