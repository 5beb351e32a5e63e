// Textures mean what pbrt-v4's do, and hostile graphs are refused.
#include "renderer/textures/texture.h"

#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>

#include "renderer/scene/scene_error.h"

namespace woodcock {
namespace {

using FloatKind = FloatTextureDescription;

FloatParameter add(SceneDescription& scene, decltype(FloatKind::kind) kind) {
  scene.float_textures.push_back({std::to_string(scene.float_textures.size()), {"scene.pbrt", 7, 2}, std::move(kind)});
  return {0, static_cast<int>(scene.float_textures.size()) - 1};
}
FloatParameter constant(float v) { return {v, kNone}; }

TEST(Textures, ParametersWithoutTextureAreTheirValue) {
  const Textures textures;
  EXPECT_EQ(textures.eval(constant(0.25f), {}), 0.25f);
  EXPECT_EQ(textures.eval(RgbParameter{Rgb(1, 2, 3)}, {}), Rgb(1, 2, 3));
}

TEST(Textures, ScaleMixAndConstantCompose) {
  SceneDescription scene;
  const FloatParameter two = add(scene, FloatKind::Constant{2});
  const FloatParameter scaled = add(scene, FloatKind::Scale{two, constant(3)});
  const FloatParameter mixed = add(scene, FloatKind::Mix{scaled, constant(10), constant(0.25f)});
  scene.rgb_textures.push_back({"tint", {}, RgbTextureDescription::Scale{{Rgb(1, 0.5f, 0)}, scaled}});
  const Textures textures(scene, DMat4(1));
  EXPECT_EQ(textures.eval(scaled, {}), 6);
  EXPECT_EQ(textures.eval(mixed, {}), 7);
  EXPECT_EQ(textures.eval(RgbParameter{Rgb(0), 0}, {}), Rgb(6, 3, 0));
}

TEST(Checkerboard, SquaresHaveSideOneSoThatAPeriodIsTwo) {
  SceneDescription scene;
  FloatKind::Checkerboard c;
  c.tex1 = constant(1);
  c.tex2 = constant(2);
  c.mapping.su = c.mapping.sv = 4;
  const FloatParameter board = add(scene, c);
  const Textures textures(scene, DMat4(1));
  for (int i = -5; i < 5; ++i)
    for (int j = -5; j < 5; ++j) {
      const Vec2 uv{(static_cast<float>(i) + 0.5f) / 4, (static_cast<float>(j) + 0.5f) / 4};
      EXPECT_EQ(textures.eval(board, {uv, {}}), ((i + j) % 2 == 0) ? 1 : 2) << i << " " << j;
    }
}

TEST(Checkerboard, InThreeDimensionsFollowsTexturesSpace) {
  SceneDescription scene;
  FloatKind::Checkerboard c;
  c.tex1 = constant(1);
  c.tex2 = constant(2);
  c.dimension = 3;
  c.mapping.kind = TextureMapping::Kind::kPoint3D;
  c.mapping.texture_from_world = glm::scale(DMat4(1), DVec3(2));
  const FloatParameter board = add(scene, c);
  // Render space is world space moved by 10 along x.
  const Textures textures(scene, glm::translate(DMat4(1), DVec3(10, 0, 0)));
  for (const Vec3 world :
       {Vec3(0.2f, 0.2f, 0.2f), Vec3(0.7f, 0.2f, 0.2f), Vec3(-0.2f, -0.2f, 0.2f), Vec3(-0.2f, -0.7f, -0.7f), Vec3(3.3f, -8.1f, 0.9f)}) {
    const Vec3 cell = glm::floor(2.0f * world);
    const int parity = static_cast<int>(cell.x + cell.y + cell.z);
    EXPECT_EQ(textures.eval(board, {{}, world - Vec3(10, 0, 0)}), parity % 2 == 0 ? 1 : 2) << world.x;
  }
}

TEST(Mapping, PlanarSphericalAndCylindricalAreThoseOfTheFormat) {
  TextureMapping m;
  m.kind = TextureMapping::Kind::kPlanar;
  m.v1 = {2, 0, 0};
  m.v2 = {0, 0, 1};
  m.du = 0.5f;
  EXPECT_EQ(Mapping(m, DMat4(1)).map_2d({{}, {1, 5, 3}}), Vec2(2.5f, 3));
  m.kind = TextureMapping::Kind::kSpherical;
  const Vec2 pole = Mapping(m, DMat4(1)).map_2d({{}, {0, 0, 2}}), equator = Mapping(m, DMat4(1)).map_2d({{}, {0, -3, 0}});
  EXPECT_FLOAT_EQ(pole.x, 0);
  EXPECT_FLOAT_EQ(equator.x, 0.5f);
  EXPECT_FLOAT_EQ(equator.y, 0.75f);
  m.kind = TextureMapping::Kind::kCylindrical;
  const Vec2 side = Mapping(m, DMat4(1)).map_2d({{}, {0, 1, 7}});
  EXPECT_FLOAT_EQ(side.x, 0.75f);
  EXPECT_FLOAT_EQ(side.y, 7);
}

TEST(Textures, FarFromTheOriginCheckerboardsStayFinite) {
  SceneDescription scene;
  FloatKind::Checkerboard c;
  c.tex1 = constant(1);
  c.tex2 = constant(2);
  const FloatParameter board = add(scene, c);
  const Textures textures(scene, DMat4(1));
  for (const float u : {1e9f, -1e20f, 1e38f, kInf, std::numeric_limits<float>::quiet_NaN()}) {
    const float v = textures.eval(board, {{u, 0.5f}, {}});
    EXPECT_TRUE(v == 1 || v == 2);
  }
}

TEST(Textures, AGraphThatDoublesAtEveryStepIsRefused) {
  SceneDescription scene;
  FloatParameter last = add(scene, FloatKind::Constant{1});
  for (int i = 0; i < 40; ++i) last = add(scene, FloatKind::Mix{last, last, constant(0.5f)});
  EXPECT_THROW(Textures(scene, DMat4(1)), SceneError);
}

TEST(Textures, AReferenceForwardsIsRefusedWithItsPlace) {
  SceneDescription scene;
  add(scene, FloatKind::Scale{{0, 0}, constant(1)});  // of itself
  try {
    const Textures textures(scene, DMat4(1));
    FAIL() << "accepted";
  } catch (const SceneError& e) {
    EXPECT_NE(std::string(e.what()).find("scene.pbrt:7:2"), std::string::npos) << e.what();
  }
}

}  // namespace
}  // namespace woodcock
