// Parameters that are set from outside the files of a scene.
#include <gmock/gmock.h>

#include "renderer/scene/parameter_edits.h"
#include "tests/scene/scene_folder.h"

namespace woodcock {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

const std::string kScene =
    "Film \"rgb\" \"integer xresolution\" 64 \"integer yresolution\" 32\n"
    "Integrator \"volpath\" \"integer maxdepth\" 7\n"
    "WorldBegin\n"
    "Texture \"wood\" \"spectrum\" \"constant\" \"rgb value\" [ 0.1 0.2 0.3 ]\n"
    "Attribute \"medium\" \"rgb sigma_a\" [ 1 1 1 ]\n"
    "MakeNamedMedium \"a.b\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ 1 2 3 ] \"float g\" 0.1\n"
    "MakeNamedMaterial \"wall\" \"string type\" \"diffuse\" \"texture reflectance\" \"wood\"\n"
    "LightSource \"point\" \"rgb I\" [ 1 1 1 ]\n"
    "LightSource \"point\" \"rgb I\" [ 2 2 2 ]\n"
    "Material \"diffuse\"\n"
    "Shape \"sphere\" \"float radius\" 2\n"
    "Shape \"sphere\"\n";

SceneDescription read_with(const std::vector<std::string>& set) {
  ReadOptions options;
  options.set = set;
  return read_text(kScene, options);
}

const HomogeneousDescription& medium_of(const SceneDescription& scene) { return std::get<HomogeneousDescription>(scene.media.at(0).kind); }

TEST(Set, ReplacesWhatTheFileSays) {
  EXPECT_EQ(read_with({}).settings.max_depth, 7);
  EXPECT_EQ(read_with({"integrator.maxdepth=3"}).settings.max_depth, 3);
  EXPECT_EQ(read_with({"film.xresolution=128"}).film.x_resolution, 128);
  EXPECT_EQ(medium_of(read_with({"medium.a.b.sigma_s=4 5 6"})).sigma_s, Rgb(4, 5, 6));
  EXPECT_EQ(medium_of(read_with({"medium.a.b.sigma_s=4"})).sigma_s, Rgb(4)) << "one number stands for all three";
  EXPECT_EQ(medium_of(read_with({"medium.a.b.sigma_a=4"})).sigma_a, Rgb(4)) << "over the value of an Attribute";
  EXPECT_EQ(std::get<SphereDescription>(read_with({"shape.0.radius=5"}).shapes[0].kind).radius, 5);
}

TEST(Set, GivesWhatTheFileLeavesToItsDefault) {
  const SceneDescription scene = read_with({"shape.1.radius=0.5", "shape.1.phimax=90"});
  EXPECT_EQ(std::get<SphereDescription>(scene.shapes[1].kind).radius, 0.5f);
  EXPECT_EQ(std::get<SphereDescription>(scene.shapes[1].kind).phi_max, 90);
  EXPECT_EQ(std::get<SphereDescription>(scene.shapes[0].kind).phi_max, 360);
}

TEST(Set, TakesATypeThatFits) {
  const auto reflectance = [](const SceneDescription& scene, size_t i) {
    return std::get<DiffuseDescription>(scene.materials.at(i).kind).reflectance;
  };
  const SceneDescription plain = read_with({});
  const auto unnamed = static_cast<size_t>(plain.shapes.at(0).material);
  const auto named =
      static_cast<size_t>(std::find_if(plain.materials.begin(), plain.materials.end(), [](const auto& m) { return m.name == "wall"; }) -
                          plain.materials.begin());
  EXPECT_NE(reflectance(read_with({}), named).texture, kNone);
  const RgbParameter number = reflectance(read_with({"material.wall.reflectance=0.5"}), named);
  EXPECT_EQ(number.texture, kNone) << "a number where the file has a texture";
  EXPECT_EQ(number.value, Rgb(0.5f));
  EXPECT_NE(reflectance(read_with({"material.0.reflectance=wood"}), unnamed).texture, kNone) << "a texture where the file has nothing";
}

TEST(Set, ChangesTheDigestByWhatItMeans) {
  const std::string plain = read_with({}).digest, g = read_with({"medium.a.b.g=0.5"}).digest;
  EXPECT_NE(plain, g);
  EXPECT_NE(g, read_with({"medium.a.b.g=0.6"}).digest);
  EXPECT_EQ(g, read_with({"medium.a.b.g=0.50"}).digest);
  EXPECT_EQ(read_with({"medium.a.b.g=0.5", "light.0.scale=2"}).digest, read_with({"light.0.scale=2", "medium.a.b.g=0.5"}).digest);
  EXPECT_EQ(read_with({"light.0.scale=2", "medium.a.b.g=5e-1"}).set, "light.0.scale=2; medium.a.b.g=0.5");
}

TEST(Set, ReachesIncludedFiles) {
  SceneFolder folder;
  folder.write("part.pbrt", "MakeNamedMedium \"gas\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ 1 1 1 ]\n");
  ReadOptions options;
  options.set = {"medium.gas.sigma_s=3"};
  EXPECT_EQ(medium_of(folder.read("WorldBegin\nInclude \"part.pbrt\"\n", options)).sigma_s, Rgb(3));
}

TEST(Set, ErrorsListWhatThereIs) {
  EXPECT_THAT(error_of([] { read_with({"medium.fog.g=1"}); }),
              AllOf(HasSubstr("--set medium.fog.g: found no \"medium.fog\""), HasSubstr("medium.a.b"), HasSubstr("light.0 to light.1"),
                    HasSubstr("shape.0 to shape.1"), HasSubstr("material.wall"), HasSubstr("integrator"), Not(HasSubstr(":0:0"))));
  EXPECT_THAT(error_of([] { read_with({"medium.a.b.h=1"}); }),
              AllOf(HasSubstr("--set medium.a.b.h: found the unknown parameter \"h\""), HasSubstr("\"g\"")));
  EXPECT_THAT(error_of([] { read_with({"medium.a.b.g=high"}); }), HasSubstr("does not fit \"g\""));
  EXPECT_THAT(error_of([] { read_with({"integrator.maxdepth=1.5"}); }), HasSubstr("expected one of type integer"));
  EXPECT_THAT(error_of([] { read_with({"medium.a.b.sigma_s=1 2"}); }), HasSubstr("does not fit"));
  EXPECT_THAT(error_of([] { read_with({"medium.a.b.g=7"}); }), HasSubstr("--set medium.a.b.g: found g = 7"));
  EXPECT_THAT(error_of([] { read_with({"shape.2.radius=1"}); }), HasSubstr("shape.0 to shape.1"));
}

TEST(Set, TextsThatAreNoneAreRefused) {
  for (const char* text : {"", "g=1", "medium.g", "medium.=1", ".g=1", "medium.a.g=", "medium.a.g= ", "nothing.a.g=1", "medium.a.g=1 x",
                           "medium.a.g=1;2", "medium.a.g=1\n"})
    EXPECT_THROW(parse_edit(text), std::invalid_argument) << text;
  EXPECT_THROW(ParameterEdits({"camera.fov=1", "camera.fov=2"}), std::invalid_argument);
  EXPECT_THROW(ParameterEdits(std::vector<std::string>(33, "camera.fov=1")), std::invalid_argument);
  EXPECT_THROW(ParameterEdits({"camera.fov=" + std::string(3000, 'x')}), std::invalid_argument);
}

}  // namespace
}  // namespace woodcock
