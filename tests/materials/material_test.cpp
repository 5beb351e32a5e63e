// Descriptions become scattering models: textures, mixes, interfaces, normal maps and bumps.
#include "renderer/materials/material.h"

#include <gtest/gtest.h>

#include "renderer/scene/scene_error.h"

namespace woodcock {
namespace {

int add(SceneDescription& scene, MaterialKind kind) {
  scene.materials.push_back({std::to_string(scene.materials.size()), {"scene.pbrt", 3, 1}, std::move(kind)});
  return static_cast<int>(scene.materials.size()) - 1;
}
int add_texture(SceneDescription& scene, FloatTextureDescription::Checkerboard kind) {
  scene.float_textures.push_back({"t", {"scene.pbrt", 1, 1}, kind});
  return static_cast<int>(scene.float_textures.size()) - 1;
}
DiffuseDescription diffuse(float r) { return {{Rgb(r)}}; }

/// A scene's materials with the textures they look at.
struct Compiled {
  explicit Compiled(const SceneDescription& scene) : textures(scene, DMat4(1)), materials(scene, textures) {}
  Textures textures;
  Materials materials;
};

TEST(Materials, ClampReflectancesToWhatIsPossible) {
  SceneDescription scene;
  const int bright = add(scene, DiffuseDescription{{Rgb(3, 0.5f, -1)}});
  const int sheet = add(scene, DiffuseTransmissionDescription{{Rgb(0.6f)}, {Rgb(0.3f)}, 2});
  const Compiled c(scene);
  Stream choice(1);
  EXPECT_EQ(std::get<DiffuseBsdf>(*c.materials.bsdf(bright, {}, choice)).reflectance, Rgb(1, 0.5f, 0));
  const auto t = std::get<DiffuseTransmissionBsdf>(*c.materials.bsdf(sheet, {}, choice));
  EXPECT_EQ(t.reflectance, Rgb(1));
  EXPECT_EQ(t.transmittance, Rgb(0.6f));
}

TEST(Materials, RemapRoughnessToItsSquareRoot) {
  SceneDescription scene;
  const int remapped = add(scene, DielectricDescription{1.5f, {{0.25f}, {0.04f}, true}});
  const int plain = add(scene, DielectricDescription{1.5f, {{0.25f}, {0.04f}, false}});
  const int smooth = add(scene, DielectricDescription{1.5f, {{0}, {0}, true}});
  const Compiled c(scene);
  Stream choice(1);
  const auto a = std::get<DielectricBsdf>(*c.materials.bsdf(remapped, {}, choice)).roughness;
  EXPECT_FLOAT_EQ(a.alpha_x, 0.5f);
  EXPECT_FLOAT_EQ(a.alpha_y, 0.2f);
  EXPECT_FLOAT_EQ(std::get<DielectricBsdf>(*c.materials.bsdf(plain, {}, choice)).roughness.alpha_x, 0.25f);
  EXPECT_TRUE(is_specular(*c.materials.bsdf(smooth, {}, choice)));
}

TEST(Materials, AConductorGivenByReflectanceHasItAtNormalIncidence) {
  SceneDescription scene;
  ConductorDescription d;
  d.reflectance = RgbParameter{Rgb(0.9f, 0.5f, 0)};
  const int m = add(scene, d);
  const Compiled c(scene);
  Stream choice(1);
  const Rgb r = albedo(*c.materials.bsdf(m, {}, choice), {0, 0, 1});
  EXPECT_NEAR(r.r, 0.9f, 1e-5);
  EXPECT_NEAR(r.g, 0.5f, 1e-5);
  EXPECT_NEAR(r.b, 0, 1e-6);
}

TEST(Materials, ACoatedMetalIsSeenThroughTheCoatsIndex) {
  SceneDescription scene;
  CoatedConductorDescription d;
  d.conductor.eta = {Rgb(0.3f)};
  d.conductor.k = {Rgb(3)};
  d.coat.eta = 1.5f;
  d.coat.thickness = {0.01f};
  const int m = add(scene, d);
  const Compiled c(scene);
  Stream choice(1);
  const auto b = std::get<CoatedConductorBsdf>(*c.materials.bsdf(m, {}, choice));
  EXPECT_FLOAT_EQ(b.base.eta.g, 0.2f);
  EXPECT_FLOAT_EQ(b.base.k.g, 2);
}

// False alarms: six standard errors of a binomial.
TEST(Materials, AMixTakesItsSecondPartWithTheGivenProbability) {
  SceneDescription scene;
  const int a = add(scene, diffuse(0.1f)), b = add(scene, diffuse(0.9f));
  const int mix = add(scene, MixDescription{a, b, {0.3f}});
  const int nested = add(scene, MixDescription{mix, b, {0.5f}});
  const Compiled c(scene);
  Stream choice(2);
  int second = 0, nested_second = 0;
  const int n = 100000;
  for (int i = 0; i < n; ++i) {
    second += c.materials.resolve(mix, {}, choice) == b;
    nested_second += c.materials.resolve(nested, {}, choice) == b;
  }
  EXPECT_NEAR(second / static_cast<double>(n), 0.3, 6 * 0.5 / std::sqrt(n));
  EXPECT_NEAR(nested_second / static_cast<double>(n), 0.65, 6 * 0.5 / std::sqrt(n));
}

TEST(Materials, AMixAtItsEndsIsNotRandom) {
  SceneDescription scene;
  const int a = add(scene, diffuse(0.1f)), b = add(scene, diffuse(0.9f));
  const int first = add(scene, MixDescription{a, b, {0}}), second = add(scene, MixDescription{a, b, {1}});
  const Compiled c(scene);
  Stream choice(3);
  for (int i = 0; i < 1000; ++i) {
    EXPECT_EQ(c.materials.resolve(first, {}, choice), a);
    EXPECT_EQ(c.materials.resolve(second, {}, choice), b);
  }
}

TEST(Materials, AnInterfaceHasNoScatteringModelAndAMixDecidesPerHit) {
  SceneDescription scene;
  const int interface = add(scene, InterfaceDescription{}), solid = add(scene, diffuse(0.5f));
  FloatTextureDescription::Checkerboard checker;
  checker.tex1 = {0};
  checker.tex2 = {1};
  FloatParameter amount;
  amount.texture = add_texture(scene, checker);
  const int mix = add(scene, MixDescription{interface, solid, amount}), empty = add(scene, MixDescription{interface, interface, {0.5f}});
  const Compiled c(scene);
  Stream choice(4);
  EXPECT_TRUE(c.materials.is_interface(interface));
  EXPECT_TRUE(c.materials.is_interface(empty));
  EXPECT_FALSE(c.materials.is_interface(mix));
  EXPECT_FALSE(c.materials.bsdf(interface, {}, choice));
  EXPECT_FALSE(c.materials.bsdf(mix, {{0.5f, 0.5f}, {}}, choice));
  EXPECT_TRUE(c.materials.bsdf(mix, {{1.5f, 0.5f}, {}}, choice));
}

TEST(Materials, AMixThatContainsItselfIsRefusedWithItsPlace) {
  SceneDescription scene;
  add(scene, MixDescription{1, 1, {0.5f}});
  add(scene, MixDescription{0, 0, {0.5f}});
  const Textures textures;
  try {
    const Materials materials(scene, textures);
    FAIL() << "accepted";
  } catch (const SceneError& e) {
    EXPECT_NE(std::string(e.what()).find("scene.pbrt:3:1"), std::string::npos) << e.what();
  }
}

TEST(ShadingNormal, AFlatMapLeavesItAlone) {
  SceneDescription scene;
  scene.rgb_textures.push_back({"up", {}, RgbTextureDescription::Constant{Rgb(0.5f, 0.5f, 1)}});
  const int m = add(scene, diffuse(0.5f));
  scene.materials[0].normal_map = 0;
  const Compiled c(scene);
  EXPECT_TRUE(c.materials.has_normal_map(m));
  const ShadingGeometry g{glm::normalize(Vec3(0.2f, 0.3f, 0.9f)), {1, 0.1f, 0}, {0, 1, 0}};
  EXPECT_NEAR(glm::length(c.materials.shading_normal(m, {}, g) - g.n), 0, 1e-6);
}

TEST(ShadingNormal, AMapTiltsAlongDpdu) {
  SceneDescription scene;
  scene.rgb_textures.push_back({"tilted", {}, RgbTextureDescription::Constant{0.5f * (Rgb(0.6f, 0, 0.8f) + 1.0f)}});
  const int m = add(scene, diffuse(0.5f));
  scene.materials[0].normal_map = 0;
  const Compiled c(scene);
  const Vec3 n = c.materials.shading_normal(m, {}, {{0, 0, 1}, {0, 2, 0}, {-1, 0, 0}});
  EXPECT_NEAR(glm::length(n - Vec3(0, 0.6f, 0.8f)), 0, 1e-6);
}

/// A diffuse material with a bump: a step of 0.001 at u = 1.
int add_step(SceneDescription& scene) {
  FloatTextureDescription::Checkerboard steps;  // 0 for u < 1, 1 beyond
  steps.tex1 = {0};
  steps.tex2 = {0.001f};
  const int height = add_texture(scene, steps), m = add(scene, diffuse(0.5f));
  scene.materials[static_cast<size_t>(m)].displacement = height;
  return m;
}

TEST(ShadingNormal, ABumpTiltsByItsSlope) {
  SceneDescription scene;
  const int m = add_step(scene);
  const Compiled c(scene);
  const ShadingGeometry g{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}};
  EXPECT_EQ(c.materials.shading_normal(m, {{0.5f, 0.5f}, {}}, g), Vec3(0, 0, 1));
  // Across the step the forward difference over 0.0005 sees a slope of 2.
  const Vec3 n = c.materials.shading_normal(m, {{0.9999f, 0.5f}, {}}, g);
  EXPECT_NEAR(glm::length(n - glm::normalize(Vec3(-2, 0, 1))), 0, 1e-4);
}

// Heights are lengths of the world, tangents those of render space.
TEST(ShadingNormal, ABumpHasTheSameSlopeWhateverTheScaleOfRenderSpace) {
  SceneDescription scene;
  const int m = add_step(scene);
  const Textures textures(scene, DMat4(1));
  for (const float scale : {1.0f, 0.125f, 64.0f}) {
    const Materials materials(scene, textures, static_cast<double>(scale));
    const Vec3 n = materials.shading_normal(m, {{0.9999f, 0.5f}, {}}, {{0, 0, 1}, {scale, 0, 0}, {0, scale, 0}});
    EXPECT_NEAR(glm::length(n - glm::normalize(Vec3(-2, 0, 1))), 0, 1e-4) << scale;
  }
}

TEST(ShadingNormal, DegenerateGeometryKeepsTheNormal) {
  SceneDescription scene;
  scene.rgb_textures.push_back({"tilted", {}, RgbTextureDescription::Constant{Rgb(0.8f, 0.5f, 0.9f)}});
  const int m = add(scene, diffuse(0.5f));
  scene.materials[0].normal_map = 0;
  const Compiled c(scene);
  EXPECT_EQ(c.materials.shading_normal(m, {}, {{0, 0, 1}, {0, 0, 0}, {0, 0, 0}}), Vec3(0, 0, 1));
  EXPECT_EQ(c.materials.shading_normal(m, {}, {{0, 0, 1}, {0, 0, 5}, {0, 1, 0}}), Vec3(0, 0, 1));
}

}  // namespace
}  // namespace woodcock
