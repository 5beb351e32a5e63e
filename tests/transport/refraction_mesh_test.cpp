// Light sampled through closed meshes of smooth glass: the picture is that of chance, whatever the solver finds.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

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

TEST(RefractionThroughMeshes, N69_milk_in_a_box_of_glass_looks_as_by_chance_whatever_ways_are_found) {
  EXPECT_GT(compare_refraction(glass_body(kBox, kMilk, 1.5, kMilkInside), 60000), 1.5);
}

TEST(RefractionThroughMeshes, LeavesTheMeanOfABallInABoxOfQuadrilateralsTurnedInsideOut) {
  EXPECT_GT(compare_refraction(glass_body(kQuads, kBallInside, 1 / 1.4, "ReverseOrientation\n"), 60000), 1.2);
}

TEST(RefractionThroughMeshes, LeavesTheMeanOfMilkInABoxOfSixShapesInABubble) {
  compare_refraction(glass_body(faces(), kMilk, 0.8, kMilkInside), 60000);
}

TEST(RefractionThroughMeshes, LeavesTheMeanInAMirroredInstance) {
  const std::string object = "ObjectBegin \"o\"\nRotate 20 .2 .5 1\n" + kBox + "\nObjectEnd\nScale .9 -1 1.1\nObjectInstance \"o\"";
  EXPECT_GT(compare_refraction(glass_body(object, kMilk, 1.5, kMilkInside), 60000), 1.5);
}

/// A ball of many triangles; with vertex normals, if it is to be smooth.
std::string refined_ball(int rings, bool smooth) {
  std::string indices, points;
  const auto number = [](double x) { return std::to_string(x) + ' '; };
  const int columns = 2 * rings;
  // Poles, then rings of points.
  points = "0 0 1  0 0 -1  ";
  for (int i = 1; i < rings; ++i)
    for (int j = 0; j < columns; ++j) {
      const double theta = std::numbers::pi * i / rings, phi = std::numbers::pi * (2 * j + i) / columns;
      points += number(std::sin(theta) * std::cos(phi)) + number(std::sin(theta) * std::sin(phi)) + number(std::cos(theta));
    }
  const auto at = [&](int i, int j) { return i == 0 ? 0 : i == rings ? 1 : 2 + (i - 1) * columns + j % columns; };
  const auto triangle = [&](int a, int b, int c) {
    for (const int k : {a, b, c}) indices += std::to_string(k) + ' ';
  };
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < columns; ++j) {
      if (i > 0) triangle(at(i, j), at(i + 1, j), at(i, j + 1));
      if (i + 1 < rings) triangle(at(i, j + 1), at(i + 1, j), at(i + 1, j + 1));
    }
  std::string text = "Shape \"trianglemesh\" \"integer indices\" [ ";
  text += indices + "] \"point3 P\" [ " + points + "]";
  if (smooth) text += " \"normal N\" [ " + points + "]";
  return text;
}

TEST(RefractionThroughMeshes, LeavesTheMeanOfMilkInASmoothMeshWhateverWaysAreFound) {
  EXPECT_GT(compare_refraction(glass_body(refined_ball(12, true), kMilk, 1.5, kMilkInside), 60000), 1.5);
}

TEST(RefractionThroughMeshes, LeavesTheMeanOfABallInASmoothMeshTurnedInsideOut) {
  EXPECT_GT(compare_refraction(glass_body(refined_ball(8, true), kBallInside, 1 / 1.4, "ReverseOrientation\n"), 60000), 1.2);
}

TEST(RefractionThroughMeshes, LeavesTheMeanOfMilkInAMeshOfFlatTrianglesWhateverWaysAreFound) {
  EXPECT_GT(compare_refraction(glass_body(refined_ball(12, false), kMilk, 1.5, kMilkInside), 60000), 1.5);
}

/// A point lamp inside is not part of the roulette of samples through the glass.
TEST(RefractionThroughMeshes, N69_a_lamp_inside_of_glass_takes_no_part_in_the_roulette_of_those_outside) {
  const std::string lamp = "\nLightSource \"point\" \"rgb I\" [ 1 1 1 ] \"point3 from\" [ .1 .2 0 ]";
  const std::string milk =
      R"(MakeNamedMedium "m" "string type" "homogeneous" "rgb sigma_s" [ 6 6 6 ] "rgb sigma_a" [ .1 .1 .2 ] "float g" .6)";
  compare_refraction(glass_body(kBox, milk + lamp, 1.5, kMilkInside), 60000);
  compare_refraction(glass_ball(milk + lamp, 1.5, kMilkInside), 60000);
}

TEST(RefractionThroughMeshes, LeavesTheMeanWhereAWallCoversAndTouchesTheGlass) {
  const std::string wall = R"(
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ 0 -3 -3  0 -3 3  .4 3 3  .4 3 -3 ])";
  compare_refraction(glass_body(kBox, kMilk + wall, 1.5, kMilkInside), 60000);
}

TEST(RefractionThroughMeshes, N69_open_or_empty_or_rough_glass_is_left_to_chance) {
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

TEST(RefractionThroughMeshes, GlassIsNotSearchedWhereNoAreaLightShines) {
  for (std::string text : {glass_body(kBox, kMilk, 1.5, kMilkInside), glass_ball(kMilk, 1.5, kMilkInside)}) {
    const auto lit = glass_world(text);
    EXPECT_EQ(lit->dielectric_meshes.bodies().size() + lit->dielectric_spheres.size(), 1u);
    const std::string radiance = "[ 20 15 10 ]";
    text.replace(text.find(radiance), radiance.size(), "[ 0 0 0 ]");
    const auto dark = glass_world(text);
    EXPECT_TRUE(dark->dielectric_meshes.empty());
    EXPECT_TRUE(dark->dielectric_spheres.empty());
    EXPECT_EQ(dark->effects & kRefractedLight, 0u);
  }
}

}  // namespace
}  // namespace woodcock::testing
