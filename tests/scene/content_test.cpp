#include <gmock/gmock.h>

#include "renderer/scene/colorimetry.h"
#include "tests/scene/scene_folder.h"

namespace woodcock {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

template <typename Kind>
Kind material(const std::string& text, const std::string& before = "") {
  const SceneDescription scene = read_world(before + "Material " + text + " Shape \"sphere\"");
  return std::get<Kind>(scene.materials[static_cast<size_t>(scene.shapes[0].material)].kind);
}

TEST(Camera, DefaultsArePbrts) {
  const SceneDescription scene = read_text("WorldBegin");
  EXPECT_EQ(scene.camera.kind, CameraDescription::Kind::kPerspective);
  EXPECT_EQ(scene.camera.fov, 90);
  EXPECT_EQ(scene.camera.world_from_camera, DMat4(1));
  EXPECT_EQ(scene.film.x_resolution, 1280);
  EXPECT_EQ(scene.film.y_resolution, 720);
  EXPECT_EQ(scene.film.image_scale, 1);
  EXPECT_EQ(scene.film.max_component_value, kInf);
  EXPECT_EQ(scene.film.filter.kind, FilterDescription::Kind::kGaussian);
  EXPECT_EQ(scene.film.filter.x_radius, 1.5);
  EXPECT_EQ(scene.settings.samples_per_pixel, 16);
  EXPECT_EQ(scene.settings.max_depth, 5);
}

TEST(Camera, ReadsItsParameters) {
  const SceneDescription scene = read_text(
      "Camera \"orthographic\" \"float screenwindow\" [-1 1 -2 2] \"float lensradius\" .1 \"float focaldistance\" 3 \"float "
      "frameaspectratio\" 2 WorldBegin");
  EXPECT_EQ(scene.camera.kind, CameraDescription::Kind::kOrthographic);
  EXPECT_EQ(scene.camera.screen_window, (std::array<double, 4>{-1, 1, -2, 2}));
  EXPECT_EQ(scene.camera.frame_aspect_ratio, 2);
  EXPECT_EQ(scene.camera.lens_radius, .1);
  EXPECT_EQ(scene.camera.focal_distance, 3);
  EXPECT_THAT(text_error("Camera \"spherical\" WorldBegin"), HasSubstr("not supported"));
  EXPECT_THAT(text_error("Camera \"perspective\" \"float fov\" 180 WorldBegin"), HasSubstr("fov = 180"));
}

TEST(Film, ExposureIsShutterTimeTimesIso) {
  EXPECT_EQ(read_text("Film \"rgb\" \"float iso\" 200 WorldBegin").film.image_scale, 2);
  EXPECT_EQ(read_text("Film \"rgb\" \"float iso\" 200 Camera \"perspective\" \"float shutterclose\" .25 WorldBegin").film.image_scale,
            0.5f);
  EXPECT_THAT(text_error("Camera \"perspective\" \"float shutterclose\" 0 WorldBegin"), HasSubstr("shutter"));
  EXPECT_THAT(text_error("Film \"rgb\" \"string sensor\" \"canon_eos_5d\" WorldBegin"), HasSubstr("not supported"));
  EXPECT_NO_THROW(read_text("Film \"rgb\" \"string sensor\" \"cie1931\" WorldBegin"));
  EXPECT_THAT(text_error("Film \"rgb\" \"float exposuretime\" 2 WorldBegin"), HasSubstr("shutterclose"));
}

TEST(Film, CropsAsPbrtDoes) {
  const auto bounds = [](const std::string& text) {
    return read_text("Film \"rgb\" \"integer xresolution\" 10 \"integer yresolution\" 5 " + text + " WorldBegin").film.pixel_bounds;
  };
  EXPECT_EQ(bounds(""), (std::array<int, 4>{0, 10, 0, 5}));
  EXPECT_EQ(bounds("\"float cropwindow\" [.25 .75 .5 1]"), (std::array<int, 4>{3, 8, 3, 5}));
  EXPECT_EQ(bounds("\"integer pixelbounds\" [2 99 1 3]"), (std::array<int, 4>{2, 10, 1, 3}));
  EXPECT_THAT(text_error("Film \"rgb\" \"integer pixelbounds\" [5 5 0 1] WorldBegin"), HasSubstr("empty part"));
}

TEST(Film, ImpossibleSizesAreRefused) {
  EXPECT_THAT(text_error("\nFilm \"rgb\" \"integer xresolution\" 1000000000 WorldBegin"),
              AllOf(StartsWith("test.pbrt:2:12"), HasSubstr("65536")));
  EXPECT_THAT(text_error("Film \"rgb\" \"integer yresolution\" 0 WorldBegin"), HasSubstr("from 1"));
  EXPECT_THAT(text_error("Sampler \"independent\" \"integer pixelsamples\" 0 WorldBegin"), HasSubstr("pixelsamples = 0"));
  EXPECT_THAT(text_error("Sampler \"stratified\" \"integer xsamples\" 2000000000 \"integer ysamples\" 2000000000 WorldBegin"),
              HasSubstr("samples per pixel"));
}

TEST(Settings, SamplersAndIntegratorsBecomeSettings) {
  EXPECT_EQ(read_text("Sampler \"independent\" WorldBegin").settings.samples_per_pixel, 4);
  EXPECT_EQ(read_text("Sampler \"stratified\" \"integer xsamples\" 3 WorldBegin").settings.samples_per_pixel, 12);
  EXPECT_EQ(read_text("Sampler \"zsobol\" \"integer pixelsamples\" 99 \"integer seed\" 7 WorldBegin").settings.seed, 7u);
  const RenderSettings settings = read_text("Integrator \"bdpt\" \"integer maxdepth\" 17 \"bool regularize\" false WorldBegin").settings;
  EXPECT_EQ(settings.max_depth, 17);
  EXPECT_EQ(settings.integrator, "bdpt");
  EXPECT_THAT(text_error("Integrator \"ambientocclusion\" WorldBegin"), HasSubstr("not supported"));
  EXPECT_THAT(text_error("Integrator \"volpath\" \"bool regularize\" true WorldBegin"), HasSubstr("not supported"));
  EXPECT_THAT(text_error("Integrator \"volpth\" WorldBegin"), HasSubstr("Did you mean \"volpath\"?"));
}

TEST(Filter, EachHasItsOwnDefaults) {
  EXPECT_EQ(read_text("PixelFilter \"box\" WorldBegin").film.filter.x_radius, 0.5);
  EXPECT_EQ(read_text("PixelFilter \"triangle\" WorldBegin").film.filter.x_radius, 2);
  EXPECT_EQ(read_text("PixelFilter \"mitchell\" \"float B\" .5 WorldBegin").film.filter.b, .5);
  EXPECT_EQ(read_text("PixelFilter \"sinc\" WorldBegin").film.filter.x_radius, 4);
  EXPECT_EQ(read_text("PixelFilter \"sinc\" Film \"rgb\" WorldBegin").film.filter.tau, 3);
}

TEST(Shapes, MeshesAreCheckedIndexByIndex) {
  const std::string p = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] ";
  EXPECT_EQ(std::get<std::shared_ptr<const TriangleMesh>>(read_world(p).shapes[0].kind)->triangles.size(), 1u);
  EXPECT_THAT(world_error(p + "\"integer indices\" [0 1 3]"), HasSubstr("index 3 at position 2"));
  EXPECT_THAT(world_error(p + "\"integer indices\" [0 1 -1]"), HasSubstr("index -1"));
  EXPECT_THAT(world_error(p + "\"integer indices\" [0 1]"), HasSubstr("multiple of 3"));
  EXPECT_THAT(world_error(p + "\"normal N\" [0 0 1]"), HasSubstr("1 normals for 3 vertices"));
  EXPECT_THAT(world_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1]"), HasSubstr("multiple of 3"));
  EXPECT_THAT(world_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 1e30]"), HasSubstr("vertex 2"));
  EXPECT_THAT(world_error("Shape \"trianglemesh\""), HasSubstr("indices"));
}

TEST(Shapes, BilinearPatchesKeepTheirCornerOrder) {
  const SceneDescription scene =
      read_world("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0] \"point2 uv\" [0 0 1 0 0 1 1 1]");
  const auto& mesh = std::get<std::shared_ptr<const BilinearMesh>>(scene.shapes[0].kind);
  EXPECT_EQ(mesh->patches, (std::vector<std::array<uint32_t, 4>>{{0, 1, 2, 3}}));
  EXPECT_EQ(mesh->uv[3], Vec2(1, 1));
}

TEST(Shapes, AlphaIsAValueOrATexture) {
  EXPECT_EQ(read_world("Shape \"sphere\" \"float alpha\" .5").shapes[0].alpha.value, .5f);
  const SceneDescription scene = read_world("Texture \"a\" \"float\" \"checkerboard\" Shape \"sphere\" \"texture alpha\" \"a\"");
  EXPECT_EQ(scene.shapes[0].alpha.texture, 0);
  EXPECT_THAT(world_error("Texture \"leaf\" \"float\" \"constant\" Shape \"sphere\" \"texture alpha\" \"lef\""),
              AllOf(HasSubstr("unknown float texture \"lef\""), HasSubstr("\"leaf\"?")));
}

TEST(Materials, DefaultsArePbrts) {
  EXPECT_EQ(material<DiffuseDescription>("\"diffuse\"").reflectance.value, Rgb(.5f));
  EXPECT_EQ(material<DiffuseTransmissionDescription>("\"diffusetransmission\"").transmittance.value, Rgb(.25f));
  EXPECT_EQ(material<DielectricDescription>("\"dielectric\"").eta, 1.5f);
  EXPECT_TRUE(material<DielectricDescription>("\"dielectric\"").roughness.remap);
  EXPECT_EQ(material<ConductorDescription>("\"conductor\"").eta.value, *named_coefficient("metal-Cu-eta"));
  const CoatDescription coat = material<CoatedDiffuseDescription>("\"coateddiffuse\"").coat;
  EXPECT_EQ(coat.thickness.value, .01f);
  EXPECT_EQ(coat.max_depth, 10);
  EXPECT_EQ(coat.samples, 1);
  EXPECT_EQ(coat.eta, 1.5f);
}

TEST(Materials, ReadTheirParameters) {
  const auto conductor = material<ConductorDescription>(
      "\"conductor\" \"spectrum eta\" \"metal-Au-eta\" \"spectrum k\" \"metal-Au-k\" \"float uroughness\" .1 \"float roughness\" .2 \"bool "
      "remaproughness\" false");
  EXPECT_EQ(conductor.eta.value, *named_coefficient("metal-Au-eta"));
  EXPECT_EQ(conductor.roughness.u.value, .1f);
  EXPECT_EQ(conductor.roughness.v.value, .2f);
  EXPECT_FALSE(conductor.roughness.remap);
  EXPECT_FLOAT_EQ(material<DielectricDescription>("\"dielectric\" \"spectrum eta\" \"glass-BK7\"").eta, 1.5168f);
  const auto coated = material<CoatedConductorDescription>(
      "\"coatedconductor\" \"float interface.roughness\" .1 \"rgb reflectance\" [.9 .8 .7] \"float conductor.roughness\" .3");
  EXPECT_EQ(coated.coat.roughness.u.value, .1f);
  EXPECT_EQ(coated.conductor.roughness.v.value, .3f);
  EXPECT_EQ(coated.conductor.reflectance->value, Rgb(.9f, .8f, .7f));
  material<InterfaceDescription>("\"interface\"");
  material<InterfaceDescription>("\"\"");
}

TEST(Materials, ImpossibleOnesAreRefused) {
  EXPECT_THAT(world_error("Material \"diffuse\" \"rgb reflectance\" [1.5 0 0]"), HasSubstr("from 0 to 1"));
  EXPECT_THAT(world_error("Material \"diffuse\" \"rgb reflectance\" [-1 0 0]"), HasSubstr("at least 0"));
  EXPECT_THAT(world_error("Material \"conductor\" \"rgb reflectance\" [1 0 0] \"rgb k\" [1 1 1]"), HasSubstr("both \"reflectance\""));
  EXPECT_THAT(world_error("Material \"dielectric\" \"float eta\" 0"), HasSubstr("index of refraction"));
  EXPECT_THAT(world_error("Material \"hair\""), HasSubstr("not supported"));
  EXPECT_THAT(world_error("Material \"diffuse\" \"float sigma\" 3"), HasSubstr("unknown parameter"));
  EXPECT_THAT(world_error("Material \"coateddiffuse\" \"float g\" 1"), HasSubstr("0.9999"));
}

TEST(Materials, MixesNameTheirPartsInAnyOrder) {
  const SceneDescription scene = read_world(
      "MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"a\" \"b\"] \"float amount\" .25 MakeNamedMaterial \"a\" "
      "\"string type\" \"diffuse\" "
      "MakeNamedMaterial \"b\" \"string type\" \"conductor\" NamedMaterial \"m\" Shape \"sphere\"");
  const auto& mix = std::get<MixDescription>(scene.materials[static_cast<size_t>(scene.shapes[0].material)].kind);
  EXPECT_EQ(scene.materials[static_cast<size_t>(mix.material1)].name, "a");
  EXPECT_EQ(scene.materials[static_cast<size_t>(mix.material2)].name, "b");
  EXPECT_EQ(mix.amount.value, .25f);
}

TEST(Materials, AMixOfItselfIsRefused) {
  EXPECT_THAT(world_error("\nMakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"m\" \"m\"]"),
              AllOf(StartsWith("test.pbrt:3:1"), HasSubstr("contains itself")));
  EXPECT_THAT(world_error("MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"n\" \"n\"] MakeNamedMaterial \"n\" "
                          "\"string type\" \"mix\" \"string materials\" [\"m\" \"m\"]"),
              HasSubstr("contains itself"));
  EXPECT_THAT(world_error("MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"n\" \"o\"]"),
              HasSubstr("unknown material \"n\""));
  EXPECT_THAT(world_error("Material \"mix\" \"string materials\" [\"n\"]"), HasSubstr("expected 2"));
}

TEST(Materials, SubsurfaceIsADielectricWithAMediumInside) {
  const SceneDescription scene = read_world(
      "Material \"subsurface\" \"string name\" \"Skin1\" \"float scale\" 10 Shape \"sphere\" Material \"diffuse\" Shape \"sphere\"");
  const ShapeDescription& shape = scene.shapes[0];
  EXPECT_EQ(std::get<DielectricDescription>(scene.materials[static_cast<size_t>(shape.material)].kind).eta, 1.33f);
  ASSERT_NE(shape.media.inside, kNone);
  EXPECT_TRUE(shape.media.given);
  const auto& medium = std::get<HomogeneousDescription>(scene.media[static_cast<size_t>(shape.media.inside)].kind);
  EXPECT_NEAR(medium.sigma_s.r, 7.4f, 1e-5f);
  EXPECT_NEAR(medium.sigma_a.b, 4.8f, 1e-5f);
  EXPECT_FALSE(scene.shapes[1].media.given);
}

TEST(Materials, SubsurfaceReflectanceBecomesAnAlbedo) {
  const SceneDescription scene = read_world("Material \"subsurface\" \"rgb reflectance\" [.2 .5 .9] \"rgb mfp\" [2 2 2] Shape \"sphere\"");
  const auto& medium = std::get<HomogeneousDescription>(scene.media[0].kind);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(medium.sigma_a[c] + medium.sigma_s[c], .5f, 1e-6f);
  EXPECT_LT(medium.sigma_s.r, medium.sigma_s.g);
  EXPECT_LT(medium.sigma_s.g, medium.sigma_s.b);
  EXPECT_THAT(world_error("Material \"subsurface\" \"rgb sigma_a\" [1 1 1] Shape \"sphere\""), HasSubstr("only one of"));
  EXPECT_THAT(world_error("Material \"subsurface\" \"string name\" \"Skin3\" Shape \"sphere\""), HasSubstr("\"Skin1\""));
}

TEST(Textures, EachKindIsRead) {
  const SceneFolder folder;
  folder.write("i.png", "pixels");
  const SceneDescription scene = folder.read(
      "WorldBegin Texture \"c\" \"float\" \"constant\" \"float value\" .25 Texture \"s\" \"spectrum\" \"scale\" \"rgb tex\" [1 2 3] "
      "\"texture scale\" \"c\" "
      "Texture \"m\" \"spectrum\" \"mix\" \"texture tex1\" \"s\" \"float amount\" .75 Texture \"b\" \"float\" \"checkerboard\" \"float "
      "uscale\" 8 \"float vdelta\" .5 "
      "Translate 1 0 0 Texture \"i\" \"spectrum\" \"imagemap\" \"string filename\" \"i.png\" \"string wrap\" \"clamp\" \"bool invert\" "
      "true \"float scale\" 2 \"string mapping\" \"spherical\" "
      "\"string encoding\" \"gamma 2.2\" Material \"diffuse\" \"texture reflectance\" \"i\" \"texture displacement\" \"b\" \"string "
      "normalmap\" \"i.png\" Shape \"sphere\"");
  ASSERT_EQ(scene.float_textures.size(), 2u);
  EXPECT_EQ(std::get<FloatTextureDescription::Constant>(scene.float_textures[0].kind).value, .25f);
  EXPECT_EQ(std::get<RgbTextureDescription::Scale>(scene.rgb_textures[0].kind).scale.texture, 0);
  EXPECT_EQ(std::get<RgbTextureDescription::Mix>(scene.rgb_textures[1].kind).amount.value, .75f);
  const auto& board = std::get<FloatTextureDescription::Checkerboard>(scene.float_textures[1].kind);
  EXPECT_EQ(board.mapping.su, 8);
  EXPECT_EQ(board.mapping.dv, .5f);
  const auto& image = std::get<RgbTextureDescription::Image>(scene.rgb_textures[2].kind);
  EXPECT_EQ(image.file, (folder.path() / "i.png").string());
  EXPECT_EQ(image.encoding, "gamma 2.2");
  EXPECT_TRUE(image.invert);
  EXPECT_EQ(image.mapping.texture_from_world[3], glm::dvec4(-1, 0, 0, 1));
  const MaterialDescription& m = scene.materials[static_cast<size_t>(scene.shapes[0].material)];
  EXPECT_EQ(m.displacement, 1);
  ASSERT_NE(m.normal_map, kNone);
  EXPECT_EQ(std::get<RgbTextureDescription::Image>(scene.rgb_textures[static_cast<size_t>(m.normal_map)].kind).encoding, "linear");
}

TEST(Textures, UnsupportedAndWrongOnesAreRefused) {
  for (const char* kind : {"fbm", "wrinkled", "windy", "marble", "dots", "bilerp", "directionmix", "ptex"})
    EXPECT_THAT(world_error("Texture \"t\" \"float\" \"" + std::string(kind) + "\""), HasSubstr("not supported")) << kind;
  EXPECT_THAT(world_error("Texture \"t\" \"color\" \"constant\""), HasSubstr("\"spectrum\""));
  EXPECT_THAT(world_error("Texture \"t\" \"float\" \"constant\" Texture \"t\" \"float\" \"constant\""), HasSubstr("second time"));
  EXPECT_THAT(world_error("Texture \"t\" \"float\" \"checkerboard\" \"string mapping\" \"cubic\""), HasSubstr("\"planar\""));
  EXPECT_THAT(world_error("Texture \"t\" \"float\" \"imagemap\""), HasSubstr("without \"string filename\""));
  EXPECT_THAT(world_error("Texture \"t\" \"float\" \"constant\" Material \"diffuse\" \"texture reflectance\" \"t\" Shape \"sphere\""),
              HasSubstr("unknown spectrum texture"));
}

TEST(Lights, PowerAndIlluminanceAreWorkedIn) {
  const SceneDescription scene = read_world(
      "LightSource \"point\" \"rgb I\" [1 2 3] \"float scale\" 2 LightSource \"point\" \"float power\" 12.5663706 "
      "LightSource \"distant\" \"rgb L\" [1 1 1] \"float illuminance\" 5 \"point3 from\" [0 0 9] \"point3 to\" [0 0 0] LightSource "
      "\"infinite\" \"rgb L\" [2 2 2] \"float illuminance\" 3.14159265 "
      "LightSource \"spot\" \"float coneangle\" 90 \"float conedeltaangle\" 0 \"float power\" 6.2831853");
  EXPECT_EQ(std::get<PointLightDescription>(scene.lights[0].kind).intensity, Rgb(2, 4, 6));
  EXPECT_NEAR(std::get<PointLightDescription>(scene.lights[1].kind).intensity.g, 1, 1e-6f);
  EXPECT_EQ(std::get<DistantLightDescription>(scene.lights[2].kind).radiance, Rgb(5));
  EXPECT_NEAR(std::get<InfiniteLightDescription>(scene.lights[3].kind).radiance.r, 2, 1e-6f);
  // A hemisphere without falloff: 2π.
  EXPECT_NEAR(std::get<SpotLightDescription>(scene.lights[4].kind).intensity.r, 1, 1e-6f);
}

TEST(Lights, AreaLightsBelongToTheShapesThatFollow) {
  const SceneDescription scene =
      read_world("Shape \"sphere\" AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] \"float scale\" 2 \"float power\" 9 Shape \"sphere\"");
  EXPECT_FALSE(scene.shapes[0].area_light);
  EXPECT_EQ(scene.shapes[1].area_light->radiance, Rgb(1, 2, 3));
  EXPECT_EQ(scene.shapes[1].area_light->scale, 2);
  EXPECT_EQ(scene.shapes[1].area_light->power, 9);
}

TEST(Lights, InterfacesAndInstancesEmitNothingAsInPbrt) {
  std::vector<std::string> warnings;
  const SceneDescription scene =
      read_world("AreaLightSource \"diffuse\" ObjectBegin \"o\" Shape \"sphere\" ObjectEnd Material \"interface\" Shape \"sphere\"",
                 collecting(warnings));
  EXPECT_FALSE(scene.objects[0].shapes[0].area_light);
  EXPECT_FALSE(scene.shapes[0].area_light);
  EXPECT_EQ(scene.ignored.size(), 2u);
}

TEST(Lights, WrongOnesAreRefused) {
  EXPECT_THAT(world_error("LightSource \"projection\""), HasSubstr("not supported"));
  EXPECT_THAT(world_error("LightSource \"infinite\" \"point3 portal\" [0 0 0 1 0 0 1 1 0 0 1 0]"), HasSubstr("portal"));
  EXPECT_THAT(world_error("LightSource \"distant\" \"point3 to\" [0 0 0]"), HasSubstr("same point"));
  EXPECT_THAT(world_error("LightSource \"point\" \"rgb I\" [-1 0 0]"), HasSubstr("at least 0"));
  EXPECT_THAT(world_error("LightSource \"point\" \"rgb I\" [3e38 0 0] \"float scale\" 100"), HasSubstr("too bright"));
  EXPECT_THAT(world_error("LightSource \"point\" \"blackbody I\" -3"), HasSubstr("temperature"));
}

}  // namespace
}  // namespace woodcock
