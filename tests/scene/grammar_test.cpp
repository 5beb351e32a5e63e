#include <gmock/gmock.h>

#include <glm/gtc/matrix_transform.hpp>

#include "renderer/scene/lexer.h"
#include "tests/scene/scene_folder.h"

namespace woodcock {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const SphereDescription& sphere(const SceneDescription& scene, size_t i = 0) {
  return std::get<SphereDescription>(scene.shapes.at(i).kind);
}

void expect_near(const DMat4& a, const DMat4& b) {
  for (int c = 0; c < 4; ++c)
    for (int r = 0; r < 4; ++r) EXPECT_NEAR(a[c][r], b[c][r], 1e-12) << "column " << c << " row " << r;
}

TEST(Grammar, ReadsCommentsBracketsBareValuesAndArraysOverLines) {
  const SceneDescription scene = read_world(
      "# a comment \"with a string\n"
      "Shape \"sphere\" \"float radius\" 2 # bare\n"
      "Shape \"sphere\" \"float radius\" [\n 3\n] \"float phimax\"[180]\n"
      "Shape\"sphere\"\"float radius\"+.4e1");
  ASSERT_EQ(scene.shapes.size(), 3u);
  EXPECT_EQ(sphere(scene, 0).radius, 2);
  EXPECT_EQ(sphere(scene, 1).radius, 3);
  EXPECT_EQ(sphere(scene, 1).phi_max, 180);
  EXPECT_EQ(sphere(scene, 2).radius, 4);
}

TEST(Grammar, ReadsEscapesAndSpacesInStrings) {
  const SceneDescription scene = read_text("Film \"rgb\" \"string filename\" \"a b \\\"c\\\" \\\\ d.exr\" WorldBegin");
  EXPECT_EQ(scene.film.file_name, "a b \"c\" \\ d.exr");
}

TEST(Grammar, ReadsBooleansWithAndWithoutQuotes) {
  EXPECT_TRUE(read_world("AreaLightSource \"diffuse\" \"bool twosided\" true Shape \"sphere\"").shapes[0].area_light->two_sided);
  EXPECT_TRUE(read_world("AreaLightSource \"diffuse\" \"bool twosided\" [ \"true\" ] Shape \"sphere\"").shapes[0].area_light->two_sided);
  EXPECT_FALSE(read_world("AreaLightSource \"diffuse\" \"bool twosided\" \"false\" Shape \"sphere\"").shapes[0].area_light->two_sided);
}

TEST(Grammar, OldNamesOfTypesMeanTheSame) {
  const SceneDescription scene = read_world("LightSource \"point\" \"point from\" [1 2 3]");
  EXPECT_EQ(std::get<PointLightDescription>(scene.lights[0].kind).position, DVec3(1, 2, 3));
}

TEST(Grammar, AByteOrderMarkIsNoDirective) { EXPECT_EQ(read_text("\xef\xbb\xbfWorldBegin Shape \"sphere\"").shapes.size(), 1u); }

TEST(Grammar, MessagesStayShortHoweverLongTheNames) {
  EXPECT_LT(world_error("NamedMaterial \"" + std::string(1000000, 'x') + "\" Shape \"sphere\"").size(), 5000u);
}

TEST(Grammar, NumbersAreStrict) {
  double value = 0;
  for (const char* good : {"1", "-1", "+1", ".5", "1.", "1e5", "1E-5", "-0"}) EXPECT_TRUE(parse_number(good, value)) << good;
  for (const char* bad : {"", "+", "++1", "1x", "nan", "inf", "-inf", "1e999", "0x10", "1,5"})
    EXPECT_FALSE(parse_number(bad, value)) << bad;
  EXPECT_TRUE(parse_number("1e-999", value));
  EXPECT_EQ(value, 0);
}

TEST(Grammar, TransformsActOnTheCurrentMatrix) {
  const SceneDescription scene = read_world("Translate 1 2 3 Scale 2 2 2 Rotate 90 0 0 1 Shape \"sphere\"");
  const DMat4 expected =
      glm::translate(DMat4(1), DVec3(1, 2, 3)) * glm::scale(DMat4(1), DVec3(2)) * glm::rotate(DMat4(1), glm::radians(90.0), DVec3(0, 0, 1));
  expect_near(scene.shapes[0].world_from_object, expected);
}

TEST(Grammar, TransformIsGivenColumnByColumn) {
  const SceneDescription scene =
      read_world("Transform [1 0 0 0  0 1 0 0  0 0 1 0  5 6 7 1] ConcatTransform [2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1] Shape \"sphere\"");
  expect_near(scene.shapes[0].world_from_object, glm::translate(DMat4(1), DVec3(5, 6, 7)) * glm::scale(DMat4(1), DVec3(2)));
}

TEST(Grammar, LookAtPlacesALeftHandedCamera) {
  const SceneDescription scene = read_text("LookAt 1 2 3  1 2 8  0 1 0 Camera \"perspective\" WorldBegin");
  const DMat4& m = scene.camera.world_from_camera;
  expect_near(m, glm::translate(DMat4(1), DVec3(1, 2, 3)));
  EXPECT_NEAR(glm::determinant(glm::dmat3(m)), 1, 1e-12);
}

TEST(Grammar, ScaleBeforeLookAtMirrorsTheCamera) {
  const SceneDescription scene = read_text("Scale -1 1 1 LookAt 0 0 5 0 0 0 0 1 0 Camera \"perspective\" WorldBegin");
  EXPECT_NEAR(glm::determinant(glm::dmat3(scene.camera.world_from_camera)), -1, 1e-12);
}

TEST(Grammar, CoordinateSystemsAreRemembered) {
  const SceneDescription scene = read_text(
      "Translate 0 0 -4 Camera \"perspective\" WorldBegin Translate 1 0 0 CoordinateSystem \"here\" Identity "
      "CoordSysTransform \"camera\" Shape \"sphere\" CoordSysTransform \"here\" Shape \"sphere\" CoordSysTransform \"world\" Shape "
      "\"sphere\"");
  expect_near(scene.shapes[0].world_from_object, glm::translate(DMat4(1), DVec3(0, 0, 4)));
  expect_near(scene.shapes[1].world_from_object, glm::translate(DMat4(1), DVec3(1, 0, 0)));
  expect_near(scene.shapes[2].world_from_object, DMat4(1));
}

TEST(Grammar, AttributeBlocksRestoreTheState) {
  const SceneDescription scene = read_world(
      "AttributeBegin Translate 1 0 0 ReverseOrientation Material \"conductor\" AreaLightSource \"diffuse\" Shape \"sphere\" AttributeEnd "
      "Shape \"sphere\"");
  EXPECT_TRUE(scene.shapes[0].reverse_orientation);
  EXPECT_TRUE(scene.shapes[0].area_light.has_value());
  EXPECT_FALSE(scene.shapes[1].reverse_orientation);
  EXPECT_FALSE(scene.shapes[1].area_light.has_value());
  expect_near(scene.shapes[1].world_from_object, DMat4(1));
  EXPECT_TRUE(std::holds_alternative<DiffuseDescription>(scene.materials[static_cast<size_t>(scene.shapes[1].material)].kind));
}

TEST(Grammar, TransformBeginIsAnOldWordForAttributeBegin) {
  std::vector<std::string> warnings;
  const SceneDescription scene = read_world("TransformBegin Translate 1 0 0 TransformEnd Shape \"sphere\"", collecting(warnings));
  expect_near(scene.shapes[0].world_from_object, DMat4(1));
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_THAT(warnings[0], AllOf(StartsWith("test.pbrt:2:1"), HasSubstr("deprecated")));
}

TEST(Grammar, AttributeGivesDefaultsThatShapesOverride) {
  const SceneDescription scene = read_world(
      "AttributeBegin Attribute \"shape\" \"float radius\" 7 Shape \"sphere\" Shape \"sphere\" \"float radius\" 3 Shape \"disk\" "
      "AttributeEnd Shape \"sphere\"");
  EXPECT_EQ(sphere(scene, 0).radius, 7);
  EXPECT_EQ(sphere(scene, 1).radius, 3);
  EXPECT_EQ(std::get<DiskDescription>(scene.shapes[2].kind).radius, 7);
  EXPECT_EQ(sphere(scene, 3).radius, 1);
}

TEST(Grammar, InstancesTakeTheTransformWhereTheyStand) {
  const SceneDescription scene = read_world(
      "ObjectInstance \"later\" AttributeBegin Translate 1 0 0 ObjectBegin \"later\" Translate 0 1 0 Shape \"sphere\" ObjectEnd "
      "AttributeEnd Translate 0 0 1 ObjectInstance \"later\"");
  ASSERT_EQ(scene.objects.size(), 1u);
  EXPECT_TRUE(scene.shapes.empty());
  expect_near(scene.objects[0].shapes[0].world_from_object, glm::translate(DMat4(1), DVec3(1, 1, 0)));
  ASSERT_EQ(scene.instances.size(), 2u);
  EXPECT_EQ(scene.instances[0].object, 0);
  expect_near(scene.instances[1].world_from_instance, glm::translate(DMat4(1), DVec3(0, 0, 1)));
}

TEST(Grammar, WorldBeginForgetsTheCameraTransform) {
  const SceneDescription scene = read_text("Translate 1 2 3 Camera \"perspective\" WorldBegin Shape \"sphere\"");
  expect_near(scene.shapes[0].world_from_object, DMat4(1));
}

TEST(Grammar, MediumBeforeWorldBeginTakesTheCameraTransform) {
  const SceneDescription scene = read_text(
      "Translate 1 2 3 MakeNamedMedium \"m\" \"string type\" \"homogeneous\" MediumInterface \"\" \"m\" Camera \"perspective\" WorldBegin");
  expect_near(scene.media[0].world_from_medium, glm::translate(DMat4(1), DVec3(1, 2, 3)));
  EXPECT_EQ(scene.camera.media.outside, 0);
  EXPECT_EQ(scene.camera.media.inside, kNone);
  EXPECT_TRUE(scene.camera.media.given);
}

TEST(Grammar, MediumInterfaceTakesOneOrTwoNames) {
  const std::string media = "MakeNamedMedium \"a\" \"string type\" \"homogeneous\" MakeNamedMedium \"b\" \"string type\" \"homogeneous\" ";
  const SceneDescription scene = read_world("Shape \"sphere\" " + media +
                                            "MediumInterface \"a\" \"b\" Shape \"sphere\" LightSource \"point\" MediumInterface \"a\" "
                                            "Shape \"sphere\" MediumInterface \"\" \"\" Shape \"sphere\"");
  EXPECT_FALSE(scene.shapes[0].media.given);
  EXPECT_EQ(scene.shapes[1].media.inside, 0);
  EXPECT_EQ(scene.shapes[1].media.outside, 1);
  EXPECT_EQ(scene.lights[0].medium, 1);
  EXPECT_EQ(scene.shapes[2].media.inside, 0);
  EXPECT_EQ(scene.shapes[2].media.outside, 0);
  EXPECT_EQ(scene.shapes[3].media.inside, kNone);
}

/// pbrt-v4: only an interface with IsMediumTransition() replaces the medium of the ray.
TEST(Grammar, TheSameMediumOnBothSidesLeavesTheRaysMediumAsItIs) {
  const SceneDescription scene = read_text(
      "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" MediumInterface \"\" \"fog\" Camera \"perspective\" WorldBegin "
      "Shape \"sphere\" MediumInterface \"\" \"\" Shape \"sphere\" MediumInterface \"fog\" Shape \"sphere\"");
  EXPECT_TRUE(scene.shapes[0].media.given) << "the camera's interface holds behind WorldBegin";
  EXPECT_EQ(scene.shapes[0].media.outside, 0);
  EXPECT_FALSE(scene.shapes[1].media.given);
  EXPECT_FALSE(scene.shapes[2].media.given);
}

TEST(Grammar, IncludeResolvesAgainstTheIncludingFilesFolder) {
  const SceneFolder folder;
  folder.write("parts/a.pbrt", "Include \"b.pbrt\" Translate 1 0 0");
  folder.write("parts/b.pbrt", "Shape \"sphere\" \"float radius\" 9");
  const SceneDescription scene = folder.read("WorldBegin Include \"parts/a.pbrt\" Shape \"sphere\"");
  EXPECT_EQ(sphere(scene, 0).radius, 9);
  EXPECT_EQ(scene.shapes[0].where.file, "parts/b.pbrt");
  expect_near(scene.shapes[1].world_from_object, glm::translate(DMat4(1), DVec3(1, 0, 0)));
}

TEST(Grammar, ImportKeepsItsStateToItself) {
  const SceneFolder folder;
  folder.write("a.pbrt", "Translate 1 0 0 Shape \"sphere\"");
  const SceneDescription scene = folder.read("WorldBegin Import \"a.pbrt\" Shape \"sphere\"");
  expect_near(scene.shapes[0].world_from_object, glm::translate(DMat4(1), DVec3(1, 0, 0)));
  expect_near(scene.shapes[1].world_from_object, DMat4(1));
}

TEST(Grammar, AnimatedTransformsAreRefusedOnlyWhereTheyDiffer) {
  EXPECT_NO_THROW(
      read_world("TransformTimes 0 1 ActiveTransform StartTime Translate 1 0 0 ActiveTransform EndTime Translate 1 0 0 ActiveTransform All "
                 "Shape \"sphere\""));
  EXPECT_THAT(world_error("ActiveTransform EndTime Translate 1 0 0 ActiveTransform All\n Shape \"sphere\""),
              AllOf(StartsWith("test.pbrt:3:2:"), HasSubstr("changes over time"), HasSubstr("--allow-unsupported")));
}

struct Bad {
  const char* text;
  const char* place;
  std::vector<const char*> words;
};

class GrammarErrors : public ::testing::TestWithParam<Bad> {};

TEST_P(GrammarErrors, NamePlaceFindingAndExpectation) {
  const std::string message = text_error(GetParam().text);
  EXPECT_THAT(message, StartsWith(std::string("test.pbrt:") + GetParam().place + ": "));
  for (const char* word : GetParam().words) EXPECT_THAT(message, HasSubstr(word));
}

INSTANTIATE_TEST_SUITE_P(
    All, GrammarErrors,
    ::testing::Values(
        Bad{"WorldBegin\nShpe \"sphere\"", "2:1", {"unknown directive \"Shpe\"", "Did you mean \"Shape\"?"}},
        Bad{"WorldBegin WorldEnd", "1:12", {"pbrt-v3"}}, Bad{"\"stray\"", "1:1", {"the string \"stray\"", "expected a directive"}},
        Bad{"WorldBegin Shape", "1:17", {"the end of the file", "in quotes"}}, Bad{"WorldBegin Shape \"sphere", "1:18", {"closing quote"}},
        Bad{"WorldBegin Shape \"sph\nere\"", "1:18", {"closing quote"}},
        Bad{"Film \"rgb\" \"string filename\" \"a\\q\"", "1:30", {"escape"}},
        Bad{"WorldBegin Shape \"sphere\"\n  \"float radius\" 1 \"float raduis\" 2",
            "2:20",
            {"unknown parameter", "raduis", "Did you mean \"radius\"?"}},
        Bad{"WorldBegin Shape \"sphere\" \"integer radius\" 1", "1:27", {"\"integer radius\"", "expected type float"}},
        Bad{"WorldBegin Shape \"sphere\" \"float radius\" [1 2]", "1:27", {"found 2 values", "expected 1"}},
        Bad{"WorldBegin Shape \"sphere\" \"float radius\" []", "1:27", {"found 0 values"}},
        Bad{"WorldBegin Shape \"sphere\" \"float radius\" x", "1:42", {"\"x\"", "finite number"}},
        Bad{"WorldBegin Shape \"sphere\" \"float radius\" nan", "1:42", {"finite number"}},
        Bad{"WorldBegin Shape \"sphere\" \"float radius\" [1", "1:44", {"the end of the file"}},
        Bad{"WorldBegin Shape \"sphere\" \"float radius\" 1 \"float radius\" 2", "1:44", {"second time"}},
        Bad{"WorldBegin Shape \"sphere\" \"float radius\" -1", "1:27", {"radius = -1"}},
        Bad{"WorldBegin Shape \"sphere\" \"radius\" 1", "1:27", {"\"type name\""}},
        Bad{"WorldBegin Shape \"sphere\" \"flot radius\" 1", "1:27", {"parameter type \"flot\"", "Did you mean \"float\"?"}},
        Bad{"WorldBegin LightSource \"point\" \"color I\" [1 1 1]", "1:32", {"Write \"rgb\""}},
        Bad{"WorldBegin Shape \"spere\"", "1:12", {"unknown type \"spere\"", "Did you mean \"sphere\"?"}},
        Bad{"WorldBegin AreaLightSource \"diffuse\" \"bool twosided\" 1", "1:54", {"true or false"}},
        Bad{"Film \"rgb\" \"integer xresolution\" 1.5", "1:34", {"whole number"}},
        Bad{"Film \"rgb\" \"integer xresolution\" 99999999999", "1:34", {"32 bits"}},
        Bad{"Film \"rgb\" \"string filename\" name", "1:30", {"string in quotes"}}, Bad{"Translate 1 2", "1:14", {"expected 3 numbers"}},
        Bad{"Transform [1 2 3]", "1:17", {"expected 16 numbers"}}, Bad{"Rotate 30 0 0 0", "1:1", {"axis"}},
        Bad{"WorldBegin Scale 1 0 1\n Shape \"sphere\"", "2:2", {"singular"}},
        Bad{"Transform [1 0 0 0 0 1 0 0 0 0 1 1 0 0 0 1]", "1:1", {"projective"}}, Bad{"LookAt 0 0 0 0 0 1 0 0 1", "1:1", {"parallel"}},
        Bad{"LookAt 0 0 0 0 0 0 0 1 0", "1:1", {"parallel"}}, Bad{"CoordSysTransform \"x\"", "1:1", {"unknown coordinate system \"x\""}},
        Bad{"Shape \"sphere\"", "1:1", {"before WorldBegin"}}, Bad{"WorldBegin\nCamera \"perspective\"", "2:1", {"after WorldBegin"}},
        Bad{"WorldBegin WorldBegin", "1:12", {"after WorldBegin"}}, Bad{"Camera \"perspective\"", "1:1", {"before WorldBegin"}},
        Bad{"WorldBegin\nAttributeBegin", "2:1", {"without its end"}}, Bad{"WorldBegin AttributeEnd", "1:12", {"without AttributeBegin"}},
        Bad{"WorldBegin ObjectBegin \"o\"\nAttributeEnd", "2:1", {"expected the end of ObjectBegin", "line 1"}},
        Bad{"WorldBegin ObjectBegin \"o\" ObjectBegin \"p\"", "1:28", {"inside ObjectBegin"}},
        Bad{"WorldBegin ObjectBegin \"o\" ObjectEnd ObjectBegin \"o\"", "1:38", {"second time"}},
        Bad{"WorldBegin\n ObjectInstance \"o\"", "2:2", {"unknown object \"o\""}},
        Bad{"WorldBegin\n NamedMaterial \"red\" Shape \"sphere\" MakeNamedMaterial \"rad\" \"string type\" \"diffuse\"",
            "2:2",
            {"unknown material \"red\"", "Did you mean \"rad\"?"}},
        Bad{"WorldBegin\n MediumInterface \"fog\" \"\"", "2:2", {"unknown medium \"fog\""}},
        Bad{"WorldBegin Attribute \"shapes\" \"float radius\" 1", "1:12", {"\"shape\""}},
        Bad{"ColorSpace \"rec2020\"", "1:1", {"not supported"}}, Bad{"ColorSpace \"rgb\"", "1:1", {"unknown type \"rgb\""}},
        Bad{"ActiveTransform Start", "1:1", {"StartTime"}}, Bad{"Option \"bool nonsense\" true", "1:8", {"unknown parameter"}},
        Bad{"WorldBegin \x01", "1:12", {"control character"}}));

TEST(Grammar, UnsupportedThingsAreRecordedWhenAllowed) {
  ReadOptions options;
  options.allow_unsupported = true;
  const SceneDescription scene =
      read_world("Shape \"curve\" \"float width\" 1 Shape \"sphere\" LightSource \"goniometric\" \"string filename\" \"x\"", options);
  EXPECT_EQ(scene.shapes.size(), 1u);
  EXPECT_TRUE(scene.lights.empty());
  ASSERT_EQ(scene.ignored.size(), 2u);
  EXPECT_TRUE(scene.ignored[0].changes_picture);
  EXPECT_THAT(scene.ignored[0].what, HasSubstr("curve"));
  EXPECT_EQ(scene.ignored[0].where.line, 2);
}

TEST(Grammar, ThingsWithoutEffectAreWarnedAboutAndRecorded) {
  std::vector<std::string> warnings;
  const SceneDescription scene =
      read_text("Accelerator \"kdtree\" \"integer maxdepth\" 3 Film \"rgb\" \"bool savefp16\" true WorldBegin", collecting(warnings));
  EXPECT_EQ(scene.ignored.size(), 3u);
  EXPECT_EQ(warnings.size(), 3u);
  for (const IgnoredDirective& ignored : scene.ignored) EXPECT_FALSE(ignored.changes_picture);
}

}  // namespace
}  // namespace woodcock
