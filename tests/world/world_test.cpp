// From a description to a world: where the camera stands, what the scene calls for, where render space lies.
#include "renderer/world/world.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "renderer/scene/read_scene.h"
#include "renderer/world/effect_plan.h"

namespace woodcock {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::string kMedia =
    "MakeNamedMedium \"a\" \"string type\" \"homogeneous\"\n"
    "MakeNamedMedium \"b\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [ 1 2 3 ] \"rgb sigma_s\" [ 0 0 0 ]\n"
    "MakeNamedMedium \"c\" \"string type\" \"homogeneous\" \"rgb Le\" [ 1 1 1 ]\n";

SceneDescription read(const std::string& text) { return read_scene_text(text, "test.pbrt", ".", {}); }
std::string at(DVec3 eye) { return fmt::format("LookAt {} {} {} 100 3 7 0 1 0\nCamera \"perspective\"\n", eye.x, eye.y, eye.z); }
std::string ball(const char* inside, const char* outside, double radius, double x = 0) {
  return fmt::format(
      "AttributeBegin\nMaterial \"interface\"\nMediumInterface \"{}\" \"{}\"\nTranslate {} 0 0\nShape \"sphere\" \"float radius\" "
      "{}\nAttributeEnd\n",
      inside, outside, x, radius);
}
/// The name of the medium of the camera, "" for vacuum.
std::string camera_medium(const SceneDescription& scene) {
  const int medium = build_world(scene)->camera_medium;
  return medium == kNone ? "" : scene.media[static_cast<size_t>(medium)].name;
}

TEST(CameraMedium, IsFoundFromTheBoundariesAround) {
  const std::string nested = "WorldBegin\n" + ball("a", "", 2) + ball("b", "a", 1);
  EXPECT_EQ(camera_medium(read(kMedia + at({0, 0, 0.2}) + nested)), "b");
  EXPECT_EQ(camera_medium(read(kMedia + at({0, 1.5, 0}) + nested)), "a");
  EXPECT_EQ(camera_medium(read(kMedia + at({0, 5, 0}) + nested)), "");
  // Beside a ball whose outside is a medium without end.
  EXPECT_EQ(camera_medium(read(kMedia + at({0, 5, 0}) + "WorldBegin\n" + ball("a", "c", 4.9))), "c");
  // Shapes that are no boundaries are looked through; a glass ball of air is none.
  EXPECT_EQ(camera_medium(read(kMedia + at({0, 0, 0.2}) + nested + "Material \"dielectric\"\nShape \"sphere\" \"float radius\" 0.5\n")),
            "b");
  // So is a boundary that is never there.
  EXPECT_EQ(
      camera_medium(read(kMedia + at({0, 0, 0.2}) + nested +
                         "Material \"dielectric\"\nMediumInterface \"c\" \"\"\nShape \"sphere\" \"float radius\" 0.5 \"float alpha\" 0\n")),
      "b");
  // Boundaries of instances count, in the mirrored space of the instance too.
  EXPECT_EQ(camera_medium(read(kMedia + at({10, 0.1, 0}) + "WorldBegin\nObjectBegin \"o\"\n" + ball("a", "", 1) +
                               "ObjectEnd\nTranslate 10 0 0\nScale -2 1 1\nObjectInstance \"o\"\n")),
            "a");
}

TEST(CameraMedium, GivenByTheFileWinsWithANoteWhereBoundariesDisagree) {
  const auto notes = [](const std::string& own, const std::string& shapes) {
    const SceneDescription scene = read(kMedia + "MediumInterface \"\" \"" + own + "\"\n" + at({0, 0, 0.2}) + "WorldBegin\n" + shapes);
    const auto world = build_world(scene);
    EXPECT_EQ(world->camera_medium == kNone ? "" : scene.media[static_cast<size_t>(world->camera_medium)].name, own);
    return world->notes;
  };
  EXPECT_THAT(notes("a", ball("b", "", 1)), ElementsAre(HasSubstr("names the medium \"a\", but the boundaries around it say \"b\"")));
  EXPECT_THAT(notes("a", ball("", "a", 1)), ElementsAre(HasSubstr("say \"\"")));
  EXPECT_THAT(notes("", ball("b", "", 1)), ElementsAre(HasSubstr("say \"b\"")));
  EXPECT_THAT(notes("b", ball("b", "", 1)), IsEmpty());
  // No boundary says anything: an unbounded medium.
  EXPECT_THAT(notes("a", "Shape \"sphere\" \"float radius\" 0.1\n"), IsEmpty());
}

TEST(CameraMedium, OnABoundaryIsOneOfItsSides) {
  for (const DVec3 eye : {DVec3(1, 0, 0), DVec3(0, -1, 0), DVec3(0.6, 0.8, 0)}) {
    const std::string medium = camera_medium(read(kMedia + at(eye) + "WorldBegin\n" + ball("a", "b", 1)));
    EXPECT_TRUE(medium == "a" || medium == "b") << medium;
  }
}

TEST(CameraMedium, OfAWindowInSeveralMediaIsThatOfItsCentreWithANote) {
  const auto notes = [](double half_width) {
    return build_world(read(kMedia + "LookAt 0 0 0 0 0 1 0 1 0\n" +
                            fmt::format("Camera \"orthographic\" \"float screenwindow\" [ {0} {1} {0} {1} ]\n", -half_width, half_width) +
                            "WorldBegin\n" + ball("a", "b", 1) + ball("b", "", 50)))
        ->notes;
  };
  EXPECT_THAT(notes(0.5), IsEmpty());
  EXPECT_THAT(notes(3), ElementsAre(HasSubstr("several media")));
}

TEST(RenderSpace, ScalesWithTheSceneByPowersOfTwo) {
  const auto space = [](double s) {
    return choose_render_space(read(fmt::format(
        "LookAt 0 {} {} 0 0 0 0 1 0\nCamera \"perspective\"\nWorldBegin\nShape \"sphere\" \"float radius\" {}\n", 0.3 * s, 5 * s, s)));
  };
  const RenderSpace one = space(1);
  for (const int k : {-30, -1, 1, 20, 40}) {
    const double s = std::exp2(k);
    EXPECT_EQ(space(s).scale, one.scale / s);
    EXPECT_EQ(space(s).center, one.center * s);
  }
}

TEST(RenderSpace, IsSharedByTheFramesOfAMovingCamera) {
  const auto center = [](double x) {
    return choose_render_space(
               read(
                   fmt::format("LookAt {} 0 5 0 0 0 0 1 0\nCamera \"perspective\"\nWorldBegin\nShape \"sphere\" \"float radius\" 10\n", x)))
        .center;
  };
  EXPECT_EQ(center(0.2), center(1.3));
}

const EffectEntry& entry(const std::vector<EffectEntry>& plan, const std::string& effect) {
  for (const auto& e : plan)
    if (e.effect == effect) return e;
  throw std::runtime_error("no entry " + effect);
}
std::vector<EffectEntry> plan_of(const std::string& text) {
  const SceneDescription scene = read(text);
  return plan_effects(scene, *build_world(scene));
}

TEST(EffectPlan, NeedsNothingInAnEmptyScene) {
  for (const auto& e : plan_of(at(DVec3(0)) + "WorldBegin\n")) {
    EXPECT_FALSE(e.needed) << e.effect;
    EXPECT_FALSE(e.reason.empty()) << e.effect;
    EXPECT_EQ(e.where.line, 0) << e.effect;
  }
}

TEST(EffectPlan, CountsMediaThatRaysCanReachAndNoOthers) {
  const auto declared = plan_of(kMedia + at({0, 0, 9}) + "WorldBegin\n" + ball("a", "", 1));
  EXPECT_TRUE(entry(declared, "homogeneous media").needed);
  EXPECT_EQ(entry(declared, "homogeneous media").where.line, 1);
  EXPECT_TRUE(entry(declared, "volume scattering").needed);
  EXPECT_TRUE(entry(declared, "index-matched interfaces").needed);
  EXPECT_FALSE(entry(declared, "volume emission").needed);  // of "c"
  EXPECT_FALSE(entry(declared, "surfaces").needed);
  const auto none = plan_of(kMedia + at({0, 0, 9}) + "WorldBegin\nMediumInterface \"c\" \"b\"\nLightSource \"point\"\n");
  for (const char* effect : {"homogeneous media", "volume scattering", "volume emission", "chromatic extinction"}) {
    EXPECT_FALSE(entry(none, effect).needed) << effect;
    EXPECT_THAT(entry(none, effect).reason, HasSubstr("declared and not used"));
  }
  const auto camera = plan_of(kMedia + "MediumInterface \"\" \"b\"\n" + at({0, 0, 9}) + "WorldBegin\n");
  EXPECT_TRUE(entry(camera, "chromatic extinction").needed);
  EXPECT_FALSE(entry(camera, "volume scattering").needed);
}

TEST(EffectPlan, CountsObjectsOnlyWhereTheyArePlaced) {
  const std::string object = kMedia + at({0, 0, 9}) + "WorldBegin\nObjectBegin \"o\"\n" + ball("c", "", 1) +
                             "Material \"conductor\"\nShape \"sphere\"\nObjectEnd\n";
  const auto defined = plan_of(object);
  for (const char* effect : {"volume emission", "surfaces", "surfaces other than diffuse", "index-matched interfaces", "instances"})
    EXPECT_FALSE(entry(defined, effect).needed) << effect;
  const auto placed = plan_of(object + "ObjectInstance \"o\"\n");
  for (const char* effect : {"volume emission", "surfaces", "surfaces other than diffuse", "index-matched interfaces", "instances"})
    EXPECT_TRUE(entry(placed, effect).needed) << effect;
}

TEST(EffectPlan, CountsLightsThatShine) {
  const auto dark = plan_of(at({0, 0, 9}) +
                            "WorldBegin\nLightSource \"point\" \"rgb I\" [ 0 0 0 ]\nLightSource \"infinite\" \"rgb L\" [ 0 0 0 ]\n"
                            "AreaLightSource \"diffuse\" \"rgb L\" [ 0 0 0 ]\nShape \"sphere\"\n");
  for (const char* effect : {"point lights", "environment lights", "area lights"}) EXPECT_FALSE(entry(dark, effect).needed) << effect;
  const auto lit =
      plan_of(at({0, 0, 9}) +
              "WorldBegin\nLightSource \"point\" \"rgb I\" [ 0 0 0 ]\nLightSource \"point\"\nLightSource \"spot\"\n"
              "LightSource \"distant\"\nLightSource \"infinite\"\nAreaLightSource \"diffuse\"\nShape \"sphere\" \"float alpha\" 0.5\n");
  for (const char* effect : {"point lights", "spot lights", "distant lights", "environment lights", "area lights", "partial opacity"})
    EXPECT_TRUE(entry(lit, effect).needed) << effect;
  EXPECT_EQ(entry(lit, "point lights").where.line, 5);
  EXPECT_FALSE(entry(lit, "thin lens").needed);
}

}  // namespace
}  // namespace woodcock
