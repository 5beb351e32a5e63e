// What a scene says and does not mean is said at load; a scene that is right says nothing.
#include "renderer/world/scene_notes.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "renderer/scene/read_scene.h"
#include "renderer/world/media_overlap.h"

namespace woodcock {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::string> notes_of(const std::string& world, const std::string& before = "") {
  return build_world(
             read_scene_text(before + "LookAt 0 0 -50 0 0 0 0 1 0\nCamera \"perspective\"\nWorldBegin\n" + world, "test.pbrt", ".", {}))
      ->notes;
}

const std::string kMedia =
    "MakeNamedMedium \"a\" \"string type\" \"homogeneous\"\nMakeNamedMedium \"b\" \"string type\" \"homogeneous\"\n"
    "MakeNamedMedium \"c\" \"string type\" \"homogeneous\"\n"
    "MakeNamedMedium \"grid\" \"string type\" \"uniformgrid\" \"float density\" 1 \"point3 p0\" [ -.5 -.5 -.5 ] \"point3 p1\" [ .5 .5 .5 "
    "]\n"
    "MakeNamedMedium \"sum\" \"string type\" \"sum\" \"string media\" [ \"a\" \"grid\" ]\n";

/// A boundary of the unit box (edge 1) moved and scaled, turned a little so that no ray runs along its edges.
std::string box(const std::string& inside, const std::string& outside, double x, double size = 1,
                const std::string& material = "interface") {
  return fmt::format(
      "AttributeBegin\nMaterial \"{}\"\nMediumInterface \"{}\" \"{}\"\nTranslate {} 0 0\nScale {} {} {}\nShape \"trianglemesh\" \"point3 "
      "P\" [ -.5 -.5 "
      "-.5 .5 -.5 -.5 .5 .5 -.5 -.5 .5 -.5 -.5 -.5 .5 .5 -.5 .5 .5 .5 .5 -.5 .5 .5 ] \"integer indices\" [ 0 2 1 0 3 2 4 5 6 4 6 7 0 1 5 0 "
      "5 4 3 "
      "7 6 3 6 2 0 4 7 0 7 3 1 2 6 1 6 5 ]\nAttributeEnd\n",
      material, inside, outside, x, size, size, size);
}
std::string ball(const std::string& inside, const std::string& outside, double x, double radius = 1,
                 const std::string& material = "interface", const std::string& before = "") {
  return fmt::format(
      "AttributeBegin\nMaterial \"{}\"\nMediumInterface \"{}\" \"{}\"\nTranslate {} 0 0\n{}\nShape \"sphere\" \"float radius\" "
      "{}\nAttributeEnd\n",
      material, inside, outside, x, before, radius);
}

// --- overlaps

TEST(Overlap, MediaThatOverlapAreSaidWithBothPlaces) {
  for (const std::string& second : {box("b", "", 0.5), box("a", "", 0.5), ball("b", "", 0.5, 0.5)})
    EXPECT_THAT(notes_of(kMedia + box("a", "", 0) + second),
                ElementsAre(AllOf(HasSubstr("media overlap"), HasSubstr("\"a\" of the shape at test.pbrt:"), HasSubstr("\"sum\""))))
        << second;
  // Nested without naming the outer medium: behind the inner one the outer is lost.
  EXPECT_THAT(notes_of(kMedia + box("a", "", 0, 4) + ball("b", "", 0)), ElementsAre(HasSubstr("media overlap")));
  EXPECT_THAT(notes_of(kMedia + box("a", "", 0, 4) + ball("b", "c", 0)), ElementsAre(HasSubstr("media overlap")));
  // Glass is passed, too.
  EXPECT_THAT(notes_of(kMedia + box("a", "", 0, 4) + ball("b", "", 0, 1, "dielectric")), ElementsAre(HasSubstr("media overlap")));
  // Several pairs are one sentence with their number.
  EXPECT_THAT(notes_of(kMedia + box("a", "", 0) + box("b", "", 0.5) + box("a", "", 5) + box("c", "", 5.5)),
              ElementsAre(HasSubstr("2 pairs of boundaries overlap so")));
  // Two bodies of one mesh.
  EXPECT_THAT(
      notes_of(
          kMedia +
          "Material \"interface\" MediumInterface \"a\" \"\" Shape \"trianglemesh\" \"point3 P\" [ -1 -1 -1 3 -1 -1 -1 3 -1 -1 -1 3 "
          "-.5 -.5 -.9 3.5 -.5 -.9 -.5 3.5 -.9 -.5 -.5 3.1 ] \"integer indices\" [ 0 2 1 0 1 3 0 3 2 1 2 3 4 6 5 4 5 7 4 7 6 5 6 7 ]\n"),
      ElementsAre(HasSubstr("media overlap")));
}

TEST(Overlap, MediaThatAreNestedOrTouchSayNothing) {
  EXPECT_THAT(notes_of(kMedia + box("a", "", 0, 4) + ball("b", "a", 0)), IsEmpty());
  EXPECT_THAT(notes_of(kMedia + box("a", "", 0, 4) + ball("b", "a", 0) + ball("c", "b", 0, 0.5)), IsEmpty());
  EXPECT_THAT(notes_of(kMedia + box("a", "", 0, 4) + ball("", "a", 0) + ball("c", "", 0, 0.5)), IsEmpty());
  EXPECT_THAT(notes_of(kMedia + box("a", "", 0) + box("b", "", 1) + box("c", "", 3)), IsEmpty());
  // Around the camera: the same outside everywhere.
  EXPECT_THAT(notes_of(kMedia + ball("b", "a", 0) + ball("", "a", 2.5), "MakeNamedMedium \"z\" \"string type\" \"homogeneous\"\n"),
              IsEmpty());
  // A shared face: the inner box ends where the outer one does.
  EXPECT_THAT(notes_of(kMedia + box("a", "", 0, 2) + box("b", "a", 0.5, 1)), IsEmpty());
  // Liquid in glass, with one boundary between them.
  EXPECT_THAT(notes_of(kMedia + ball("", "", 0, 2, "dielectric") + ball("b", "", 0, 1, "dielectric")), IsEmpty());
  // A sum where two are meant.
  EXPECT_THAT(notes_of(kMedia + box("a", "", 0, 4) + ball("sum", "a", 0)), IsEmpty());
}

TEST(Overlap, WhatNoRayCanSeeIsNotSaid) {
  // Two fogs reach into a wall from both sides and overlap within it only.
  const std::string wall = box("", "", 0, 1, "diffuse");
  EXPECT_THAT(notes_of(kMedia + box("a", "", -1.9, 4) + box("b", "", 1.9, 4)), ElementsAre(HasSubstr("media overlap")));
  EXPECT_THAT(notes_of(kMedia + box("a", "", -1.9, 4) + box("b", "", 1.9, 4) + "AttributeBegin Material \"diffuse\" Scale 1 9 9\n" +
                       wall.substr(wall.find("Translate"))),
              IsEmpty());
  // An opaque shape that stands in a fog and does not name it ends every path that could tell.
  EXPECT_THAT(notes_of(kMedia + box("a", "", 0, 4) + ball("", "", 0, 1, "diffuse")), IsEmpty());
}

// --- mirrors

TEST(Mirrors, QuadricsTurnedInsideOutAreSaidWhereTheSideMatters) {
  const std::string mirror = "Scale -1 1 1";
  const auto lamp = [&](const std::string& before, const std::string& extra) {
    return "AttributeBegin AreaLightSource \"diffuse\" " + extra + " " + before + " Shape \"sphere\" AttributeEnd\n";
  };
  for (const std::string& shape : {ball("a", "", 0, 1, "interface", mirror), ball("", "", 0, 1, "dielectric", mirror), lamp(mirror, "")})
    EXPECT_THAT(notes_of(kMedia + shape),
                ElementsAre(AllOf(HasSubstr("inside out"), HasSubstr("test.pbrt:"), HasSubstr("ReverseOrientation"))))
        << shape;
  for (const std::string& shape :
       {ball("a", "", 0, 1, "interface"), ball("a", "", 0, 1, "interface", mirror + " ReverseOrientation"),
        ball("", "a", 0, 1, "interface", mirror), ball("a", "a", 0, 1, "interface", mirror), ball("", "", 0, 1, "diffuse", mirror),
        lamp(mirror, "\"bool twosided\" true"), lamp("", ""), lamp(mirror + " ReverseOrientation", ""),
        std::string("Scale -1 1 1 Material \"dielectric\" Shape \"disk\"\n"), "Scale -1 1 1\n" + box("a", "", 0)})
    EXPECT_THAT(notes_of(kMedia + shape), IsEmpty()) << shape;
  // Sides that were exchanged in the file to make up for it, within another medium.
  EXPECT_THAT(notes_of(kMedia + box("c", "", 0, 4) + ball("c", "a", 0, 1, "interface", mirror)), IsEmpty());
  // An instance that mirrors turns nothing.
  EXPECT_THAT(notes_of(kMedia + "ObjectBegin \"o\"\n" + ball("a", "", 0) + "ObjectEnd\nScale -1 1 1\nObjectInstance \"o\"\n"), IsEmpty());
}

// --- instances

TEST(Instances, GridsThatStayBehindAreSaidWithTheirCount) {
  const std::string object = kMedia + "ObjectBegin \"puff\"\n" + box("grid", "", 0, 1.2) + "ObjectEnd\n";
  const auto placed = [](const std::string& transform) {
    return "AttributeBegin " + transform + " ObjectInstance \"puff\" AttributeEnd\n";
  };
  EXPECT_THAT(notes_of(object + placed("Translate -2 0 0") + placed("Translate 2 0 0") + placed("")),
              ElementsAre(AllOf(HasSubstr("the grid of the medium \"grid\" stays"), HasSubstr("2 of 3 instances of \"puff\""))));
  for (const char* transform : {"Rotate 30 0 0 1", "Scale 2 2 2", "Scale -1 1 1"})
    EXPECT_THAT(notes_of(object + placed(transform)), ElementsAre(HasSubstr("1 of 1"))) << transform;
  // A sum holds the grid of its part.
  EXPECT_THAT(notes_of(kMedia + "ObjectBegin \"puff\"\n" + box("sum", "", 0, 1.2) + "ObjectEnd\n" + placed("Translate 2 0 0")),
              ElementsAre(HasSubstr("\"sum\"")));
}

TEST(Instances, WhatHasNoPlaceOrStaysInPlaceSaysNothing) {
  const auto placed = [](const std::string& transform) {
    return "AttributeBegin " + transform + " ObjectInstance \"puff\" AttributeEnd\n";
  };
  const std::string grid = "ObjectBegin \"puff\"\n" + box("grid", "", 0, 1.2) + "ObjectEnd\n";
  EXPECT_THAT(notes_of(kMedia + grid), IsEmpty());
  EXPECT_THAT(notes_of(kMedia + grid + placed("")), IsEmpty());
  EXPECT_THAT(notes_of(kMedia + "ObjectBegin \"puff\"\n" + box("a", "", 0, 1.2) + "ObjectEnd\n" + placed("Translate 2 0 0") +
                       placed("Translate -2 0 0")),
              IsEmpty());
  // Windows into one large grid.
  EXPECT_THAT(notes_of(kMedia + "ObjectBegin \"puff\"\n" + box("grid", "", 0, 0.1) + "ObjectEnd\n" + placed("Translate .3 0 0") +
                       placed("Translate -.3 0 0")),
              IsEmpty());
}

// --- reflectances

TEST(Reflectances, WhatIsCutToOneIsSaidOnceWithTheLargest) {
  const std::string bright = "Texture \"t\" \"spectrum\" \"constant\" \"rgb value\" [ 2 1 .5 ]\n";
  EXPECT_THAT(notes_of(bright + "Material \"diffuse\" \"texture reflectance\" \"t\" Shape \"sphere\"\nMaterial \"coateddiffuse\" \"texture "
                                "reflectance\" \"t\" Shape \"sphere\"\n"),
              ElementsAre(AllOf(HasSubstr("reflectance by texture \"t\" reaches 2"), HasSubstr("cut to 1"), HasSubstr("test.pbrt:5:"))));
  EXPECT_THAT(notes_of("Material \"diffusetransmission\" \"float scale\" 5 \"rgb reflectance\" [ .1 .1 .1 ] Shape \"sphere\"\n"),
              ElementsAre(AllOf(HasSubstr("transmittance reaches 1.25"), HasSubstr("cut to 1"))));
  EXPECT_THAT(notes_of(bright + "Texture \"half\" \"spectrum\" \"scale\" \"texture tex\" \"t\" \"float scale\" .5\n"
                                "Material \"diffuse\" \"texture reflectance\" \"half\" Shape \"sphere\"\n"),
              IsEmpty());
  // Not a reflectance.
  EXPECT_THAT(notes_of(bright + "Material \"conductor\" \"texture eta\" \"t\" \"texture k\" \"t\" Shape \"sphere\"\n"), IsEmpty());
}

}  // namespace
}  // namespace woodcock
