// Light sampled through spheres of smooth glass: the picture is that of chance, whatever the solver finds.
#include <gtest/gtest.h>

#include "renderer/world/effects.h"
#include "tests/transport/refraction_comparison.h"

namespace woodcock::testing {
namespace {

TEST(RefractionSampling, LeavesTheMeanOfMilkInGlassWhateverWaysAreFound) {
  EXPECT_GT(compare_refraction(glass_ball(kMilk, 1.5, kMilkInside), 200000), 1.5);
}

TEST(RefractionSampling, LeavesTheMeanOfABallInGlassTurnedInsideOut) {
  // Normals inwards: the index of the glass is that of what is outside.
  EXPECT_GT(compare_refraction(glass_ball(kBallInside, 1 / 1.4, "ReverseOrientation\n"), 200000), 1.5);
}

TEST(RefractionSampling, LeavesTheMeanWhereAWallCoversAndTouchesTheGlass) {
  const std::string wall = R"(
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ 0 -3 -3  0 -3 3  .4 3 3  .4 3 -3 ])";
  compare_refraction(glass_ball(kMilk + wall, 1.5, kMilkInside), 100000);
}

TEST(RefractionSampling, LeavesTheMeanOfMilkInABubble) { compare_refraction(glass_ball(kMilk, 0.8, kMilkInside), 200000); }

TEST(RefractionSamplingPlan, EmptyGlassAndRoughGlassAreLeftToChance) {
  const auto effects = [](const std::string& text) { return glass_world(text)->effects & kRefractedLight; };
  EXPECT_EQ(effects(glass_ball("", 1.5)), 0u);
  EXPECT_EQ(effects(glass_ball(kMilk, 1, kMilkInside)), 0u);
  EXPECT_EQ(effects(glass_ball(kMilk, 1.5, kMilkInside + "Material \"dielectric\" \"float roughness\" .2\n")), 0u);
  EXPECT_EQ(effects(glass_ball(kMilk, 1.5, kMilkInside + "Scale 1 1 .9\n")), 0u);
  EXPECT_NE(effects(glass_ball(kMilk, 1.5, kMilkInside + "Scale .9 .9 .9\n")), 0u);
}

}  // namespace
}  // namespace woodcock::testing
