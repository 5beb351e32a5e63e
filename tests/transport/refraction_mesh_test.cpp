// Light sampled through closed meshes of smooth glass: the picture is that of chance, whatever the solver finds.
#include <gtest/gtest.h>

#include "renderer/world/effects.h"
#include "tests/transport/refraction_comparison.h"

namespace woodcock::testing {
namespace {

/// The corners of a box, as "point3 P".
std::string corners(double half) {
  std::string text = "\"point3 P\" [";
  for (int i = 0; i < 8; ++i)
    for (int axis = 0; axis < 3; ++axis) {
      text += ' ';
      text += std::to_string((i >> axis & 1) != 0 ? half : -half);
    }
  text += " ]";
  return text;
}

const std::string kBox =
    "Rotate 20 .2 .5 1\nShape \"trianglemesh\" \"integer indices\" [ 0 2 1 1 2 3  4 5 6 5 7 6  0 1 4 1 5 4  2 6 3 3 6 7  0 4 2 2 4 6  1 3 "
    "5 3 "
    "7 5 ] " +
    corners(.75);
const std::string kQuads =
    "Rotate 20 .2 .5 1\nShape \"bilinearmesh\" \"integer indices\" [ 0 2 1 3  4 5 6 7  0 1 4 5  2 6 3 7  0 4 2 6  1 3 5 7 ] " +
    corners(.75);
/// A face a shape.
std::string faces() {
  std::string text = "Rotate 20 .2 .5 1\n";
  for (const char* face : {"0 2 1 1 2 3", "4 5 6 5 7 6", "0 1 4 1 5 4", "2 6 3 3 6 7", "0 4 2 2 4 6", "1 3 5 3 7 5"})
    text += std::string("Shape \"trianglemesh\" \"integer indices\" [ ") + face + " ] " + corners(.75) + "\n";
  return text;
}

TEST(RefractionThroughMeshes, LeavesTheMeanOfMilkInABoxWhateverWaysAreFound) {
  EXPECT_GT(compare_refraction(glass_body(kBox, kMilk, 1.5, kMilkInside), 200000), 1.5);
}

TEST(RefractionThroughMeshes, LeavesTheMeanOfABallInABoxOfQuadrilateralsTurnedInsideOut) {
  EXPECT_GT(compare_refraction(glass_body(kQuads, kBallInside, 1 / 1.4, "ReverseOrientation\n"), 200000), 1.2);
}

TEST(RefractionThroughMeshes, LeavesTheMeanOfMilkInABoxOfSixShapesInABubble) {
  compare_refraction(glass_body(faces(), kMilk, 0.8, kMilkInside), 200000);
}

TEST(RefractionThroughMeshes, LeavesTheMeanInAMirroredInstance) {
  const std::string object = "ObjectBegin \"o\"\nRotate 20 .2 .5 1\n" + kBox + "\nObjectEnd\nScale .9 -1 1.1\nObjectInstance \"o\"";
  EXPECT_GT(compare_refraction(glass_body(object, kMilk, 1.5, kMilkInside), 200000), 1.5);
}

TEST(RefractionThroughMeshes, LeavesTheMeanWhereAWallCoversAndTouchesTheGlass) {
  const std::string wall = R"(
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ 0 -3 -3  0 -3 3  .4 3 3  .4 3 -3 ])";
  compare_refraction(glass_body(kBox, kMilk + wall, 1.5, kMilkInside), 100000);
}

TEST(RefractionThroughMeshesPlan, OpenOrEmptyOrRoughGlassIsLeftToChance) {
  const auto effects = [](const std::string& text) { return glass_world(text)->effects & kRefractedLight; };
  EXPECT_NE(effects(glass_body(kBox, kMilk, 1.5, kMilkInside)), 0u);
  EXPECT_NE(effects(glass_body(kBox, kBallInside, 1.5)), 0u);
  EXPECT_EQ(effects(glass_body(kBox, "", 1.5)), 0u);
  EXPECT_EQ(effects(glass_body(kBox, kMilk, 1, kMilkInside)), 0u);
  EXPECT_EQ(effects(glass_body(kBox, kMilk, 1.5, kMilkInside + "Material \"dielectric\" \"float roughness\" .2\n")), 0u);
  std::string open = kBox;
  open.replace(open.find("0 2 1 1 2 3"), 11, "0 2 1");
  EXPECT_EQ(effects(glass_body(open, kMilk, 1.5, kMilkInside)), 0u);
}

}  // namespace
}  // namespace woodcock::testing
