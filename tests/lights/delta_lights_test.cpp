// Point, spot and distant lights, and the choice among lights.
#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>
#include <numbers>

#include "renderer/core/warp.h"
#include "renderer/scene/scene_error.h"
#include "tests/lights/light_fixtures.h"

namespace woodcock::test {
namespace {

TEST(PointLight, FallsOffWithTheSquareOfTheDistance) {
  PointLightDescription light;
  light.position = {1, 0, 0};
  light.intensity = Rgb(8, 4, 2);
  const auto s = one_light(light).sample(0, {1, 0, -2}, {0, 0}, 0);
  ASSERT_TRUE(s);
  EXPECT_EQ(s->radiance, Rgb(2, 1, 0.5f));
  EXPECT_EQ(s->wi, Vec3(0, 0, 1));
  EXPECT_TRUE(s->is_bounded);
  EXPECT_EQ(s->p, DVec3(1, 0, 0));
  EXPECT_EQ(s->pdf, 1);
  EXPECT_TRUE(s->delta);
  EXPECT_FALSE(one_light(light).sample(0, {1, 0, 0}, {0, 0}, 0));
}

TEST(PointLight, IrradianceDoesNotDependOnTheScaleOfRenderSpace) {
  PointLightDescription light;
  light.intensity = Rgb(3);
  for (const double scale : {1.0, 1.0 / 1024, 64.0}) {
    const auto s = one_light(light, glm::translate(DMat4(1), DVec3(0, 0, 5)), scale).sample(0, Vec3(0), {0, 0}, 0);
    EXPECT_FLOAT_EQ(s->radiance.g, 3.0f / 25);
    EXPECT_NEAR(glm::length(s->p), 5 * scale, 1e-12 * scale);
  }
}

TEST(PointLight, PowerReplacesTheScaleOfTheIntensity) {
  PointLightDescription light;
  light.power = 100;
  const Lights lights = one_light(light);
  EXPECT_NEAR(lights.power(0).g, 100, 1e-4);
  EXPECT_NEAR(lights.sample(0, {0, 0, 2}, {0, 0}, 0)->radiance.g, 100 / (16 * kPi), 1e-5);
}

SpotLightDescription spot(float angle, float delta) {
  SpotLightDescription light;
  light.from = {0, 0, 1};
  light.to = {0, 0, 0};
  light.cone_angle = angle;
  light.cone_delta_angle = delta;
  return light;
}

/// Radiance one unit of length away from the light, `degrees` off its axis.
float radiance_at(const Lights& lights, double degrees) {
  const double a = degrees * std::numbers::pi / 180;
  const auto s = lights.sample(0, {static_cast<float>(std::sin(a)), 0, static_cast<float>(1 - std::cos(a))}, {0, 0}, 0);
  return s ? s->radiance.g : 0;
}

TEST(SpotLight, FallsOffWithASmoothstepOfTheCosine) {
  const Lights lights = one_light(spot(30, 10));
  EXPECT_NEAR(radiance_at(lights, 0), 1, 1e-6);
  EXPECT_NEAR(radiance_at(lights, 19.9), 1, 1e-5);
  EXPECT_EQ(radiance_at(lights, 30.1), 0);
  const auto cosine = [](double degrees) { return std::cos(degrees * std::numbers::pi / 180); };
  const double t = (cosine(26) - cosine(30)) / (cosine(20) - cosine(30));
  EXPECT_NEAR(radiance_at(lights, 26), t * t * (3 - 2 * t), 1e-5);
}

TEST(SpotLight, DeltaOfZeroIsASharpEdge) {
  const Lights lights = one_light(spot(30, 0));
  EXPECT_NEAR(radiance_at(lights, 29.99), 1, 1e-5);
  EXPECT_EQ(radiance_at(lights, 30.01), 0);
}

TEST(SpotLight, PowerIsWhatLeavesIt) {
  SpotLightDescription light = spot(40, 25);
  light.power = 7;
  const Lights lights = one_light(light, DMat4(1), 2);
  EXPECT_NEAR(lights.power(0).g, 7 * 4, 1e-4);
  // On the unit sphere around the light (radius 2 in this render space): ∫ I dω by uniform directions.
  Stream random(5);
  Estimate power;
  for (int i = 0; i < 200000; ++i) {
    const auto s = lights.sample(0, Vec3(0, 0, 2) + 2.0f * square_to_sphere(random.uniform2()), {0, 0}, 0);
    power.add(s ? static_cast<double>(s->radiance.g) * 4 * std::numbers::pi : 0.0);
  }
  EXPECT_TRUE(agree(power, 7)) << power.mean();
}

TEST(DistantLight, ArrivesFromEverywhereWithTheSameIrradiance) {
  DistantLightDescription light;
  light.from = {0, 0, 3};
  light.to = {0, 0, 1};
  light.radiance = Rgb(2);
  light.illuminance = 5;
  const auto s = one_light(light, glm::rotate(DMat4(1), std::numbers::pi / 2, DVec3(1, 0, 0)), 0.5).sample(0, {4, 5, 6}, {0, 0}, 0);
  ASSERT_TRUE(s);
  EXPECT_NEAR(glm::distance(s->wi, Vec3(0, -1, 0)), 0, 1e-6);
  EXPECT_EQ(s->radiance, Rgb(10));
  EXPECT_FALSE(s->is_bounded);
  EXPECT_TRUE(s->delta);
}

TEST(DeltaLights, RefuseDirectionsOfNoLength) {
  SpotLightDescription light = spot(30, 5);
  light.to = light.from;
  EXPECT_THROW(one_light(light), SceneError);
  DistantLightDescription distant;
  distant.to = distant.from;
  EXPECT_THROW(one_light(distant), SceneError);
}

TEST(LightChoice, FollowsItsProbabilitiesAndNeverChoosesABlackLight) {
  SceneDescription scene;
  for (const float intensity : {1.0f, 0.0f, 10.0f, 1e-12f}) {
    LightDescription light;
    PointLightDescription point;
    point.intensity = Rgb(intensity);
    light.kind = point;
    light.where = {"scene.pbrt", static_cast<int>(scene.lights.size()) + 1, 1};
    scene.lights.push_back(light);
  }
  const Lights lights = lights_of(scene);
  constexpr int kDraws = 1 << 16;
  const DVec3 ref(1, 2, 3);
  std::vector<int> count(4);
  for (int i = 0; i < kDraws; ++i) {
    const auto choice = lights.choose(static_cast<float>(i) / kDraws, ref);
    ASSERT_TRUE(choice);
    EXPECT_EQ(choice->pmf, lights.pmf(choice->light, ref));
    ++count[static_cast<size_t>(choice->light)];
  }
  float sum = 0;
  for (int i = 0; i < 4; ++i) {
    sum += lights.pmf(i, ref);
    EXPECT_NEAR(count[static_cast<size_t>(i)], kDraws * static_cast<double>(lights.pmf(i, ref)), 2) << i;
  }
  EXPECT_FLOAT_EQ(sum, 1);
  EXPECT_EQ(count[1], 0);
  EXPECT_GT(lights.pmf(3, ref), 0.03f) << "a faint light keeps a share";
  EXPECT_EQ(lights.choose(kOneMinusEpsilon, ref)->light, 3);
  EXPECT_EQ(lights.where(2).line, 3);
  EXPECT_FALSE(Lights().choose(0.5f, ref));
}

TEST(Lights, RefuseAreaLightsInObjects) {
  SceneDescription scene;
  ObjectDescription object;
  object.name = "lamp";
  object.shapes.emplace_back().area_light.emplace();
  scene.objects.push_back(object);
  EXPECT_THROW(lights_of(scene), SceneError);
}

}  // namespace
}  // namespace woodcock::test
