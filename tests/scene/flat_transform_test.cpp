// Transforms that flatten space: what keeps its area is drawn, what loses it is left out with a word.
#include "renderer/scene/flat_transform.h"

#include <gmock/gmock.h>

#include <glm/gtc/matrix_transform.hpp>

#include "tests/scene/scene_folder.h"

namespace woodcock {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

const std::string kSquare =
    "Shape \"trianglemesh\" \"point3 P\" [ -1 -1 3 1 -1 3 1 1 3 -1 1 3 ] \"normal N\" [ 0 0 1 0 0 1 0 0 1 0 0 1 ] "
    "\"integer indices\" [ 0 1 2 0 2 3 ]\n";
const std::string kPatch = "Shape \"bilinearmesh\" \"point3 P\" [ -1 -1 3 1 -1 3 -1 1 3 1 1 3 ]\n";

SceneDescription read(const std::string& text, std::vector<std::string>& warnings) { return read_world(text, collecting(warnings)); }

TEST(FlatTransforms, DimensionsAreCounted) {
  const auto scaled = [](double x, double y, double z) {
    return glm::rotate(DMat4(1), 0.3, DVec3(1, 2, 3)) * glm::scale(DMat4(1), DVec3(x, y, z));
  };
  EXPECT_EQ(dimensions_of(scaled(1, -2, 1e-20)), 3);
  EXPECT_EQ(dimensions_of(scaled(1, 0, 2)), 2);
  EXPECT_EQ(dimensions_of(scaled(0, 0, 2)), 1);
  EXPECT_EQ(dimensions_of(scaled(0, 0, 0)), 0);
  // Flat without a scale of 0: two axes become one.
  DMat4 sheared(1);
  sheared[1] = sheared[0];
  EXPECT_EQ(dimensions_of(sheared), 2);
}

TEST(FlatTransforms, ASquarePressedAlongItsNormalIsTheSameSquare) {
  std::vector<std::string> warnings;
  const SceneDescription scene = read("Translate 5 0 0 Scale 1 1 0\n" + kSquare + kPatch + "Shape \"disk\" \"float height\" 3", warnings);
  ASSERT_EQ(scene.shapes.size(), 3u);
  EXPECT_THAT(warnings, IsEmpty());
  const auto& mesh = *std::get<std::shared_ptr<const TriangleMesh>>(scene.shapes[0].kind);
  EXPECT_EQ(mesh.triangles.size(), 2u);
  EXPECT_EQ(mesh.positions[1], DVec3(6, -1, 0));
  EXPECT_EQ(mesh.normals[1], Vec3(0, 0, 1));
  EXPECT_EQ(std::get<std::shared_ptr<const BilinearMesh>>(scene.shapes[1].kind)->positions[3], DVec3(6, 1, 0));
  const DMat4& disk = scene.shapes[2].world_from_object;
  EXPECT_EQ(std::get<DiskDescription>(scene.shapes[2].kind).height, 0);
  EXPECT_EQ(DVec3(disk[3]), DVec3(5, 0, 0));
  EXPECT_EQ(DVec3(disk[2]), DVec3(0, 0, 1));
  for (const ShapeDescription& shape : scene.shapes) EXPECT_EQ(dimensions_of(shape.world_from_object), 3);
}

TEST(FlatTransforms, ShapesAndInstancesWithoutAreaAreLeftOutWithAWord) {
  for (const char* scale : {"Scale 0 0 0", "Scale 0 1 0", "Scale 0 1 1"}) {
    std::vector<std::string> warnings;
    EXPECT_TRUE(read(std::string(scale) + "\n" + kSquare + kPatch, warnings).shapes.empty()) << scale;
    EXPECT_THAT(warnings, ElementsAre(AllOf(StartsWith("test.pbrt:3:"), HasSubstr("has no area")),
                                      AllOf(StartsWith("test.pbrt:4:"), HasSubstr("has no area"))));
  }
  std::vector<std::string> warnings;
  const std::string round = "Shape \"sphere\" Shape \"cylinder\" Shape \"disk\"\n";
  EXPECT_TRUE(read("Scale 0 0 0\n" + round, warnings).shapes.empty());
  EXPECT_EQ(warnings.size(), 3u);
  warnings.clear();
  const std::string object = "ObjectBegin \"o\" Shape \"sphere\" ObjectEnd ";
  EXPECT_TRUE(read(object + "Scale 0 0 0 ObjectInstance \"o\"", warnings).instances.empty());
  EXPECT_THAT(warnings, ElementsAre(AllOf(HasSubstr("ObjectInstance \"o\""), HasSubstr("left out"))));
  // An unknown name stays an error.
  EXPECT_THAT(world_error("Scale 0 0 0 ObjectInstance \"nobody\""), HasSubstr("unknown object"));
}

TEST(FlatTransforms, WhatNeedsAnInverseIsRefusedWithItsPlace) {
  for (const char* text : {"Shape \"sphere\"", "Shape \"cylinder\"", "LightSource \"infinite\"", "LightSource \"point\"",
                           "MakeNamedMedium \"m\" \"string type\" \"cloud\"", "ObjectBegin \"o\" ObjectEnd ObjectInstance \"o\"",
                           "Texture \"t\" \"float\" \"checkerboard\" \"integer dimension\" 3",
                           "Texture \"t\" \"float\" \"checkerboard\" \"string mapping\" \"planar\""})
    EXPECT_THAT(world_error("Scale 1 1 0\n" + std::string(text)), AllOf(StartsWith("test.pbrt:3:"), HasSubstr("singular"))) << text;
  EXPECT_THAT(text_error("Scale 1 1 0\nCamera \"perspective\" WorldBegin"), AllOf(StartsWith("test.pbrt:2:1"), HasSubstr("singular")));
}

TEST(FlatTransforms, WhatHasNoPlaceDoesNotMind) {
  std::vector<std::string> warnings;
  const SceneDescription scene = read(
      "Scale 1 1 0 MakeNamedMedium \"m\" \"string type\" \"homogeneous\" Texture \"t\" \"float\" \"checkerboard\" CoordinateSystem "
      "\"flat\"",
      warnings);
  EXPECT_THAT(warnings, IsEmpty());
  EXPECT_EQ(scene.media[0].world_from_medium, DMat4(1));
}

}  // namespace
}  // namespace woodcock
