// Choosing a light by what arrives at the point: a loop for a few lights, a tree for many.
#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>
#include <numbers>

#include "renderer/lights/light_selection.h"
#include "tests/lights/light_fixtures.h"
#include "tests/support/chi_square.h"

namespace woodcock::test {
namespace {

double uniform(Stream& random, double a, double b) { return a + (b - a) * random.uniform_double(); }
DVec3 in_box(Stream& random, double half) {
  return {uniform(random, -half, half), uniform(random, -half, half), uniform(random, -half, half)};
}

struct Lamps {
  SceneDescription scene;
  std::vector<Shape> shapes;
  Lights lights() const { return lights_of(scene, shapes); }
};

/// Points, spots, quads and disks on one side or two, spheres, and with `unbounded` a sun and two skies.
Lamps lamps(int count, uint64_t seed, bool unbounded) {
  Lamps all;
  Stream random(seed);
  const auto add = [&](const LightKind& kind) {
    LightDescription light;
    light.kind = kind;
    all.scene.lights.push_back(light);
  };
  for (int i = 0; i < count; ++i) {
    const Rgb bright(static_cast<float>(std::exp2(uniform(random, -6, 6))));
    const DVec3 at = in_box(random, 4);
    const DMat4 turn = glm::rotate(glm::translate(DMat4(1), at), uniform(random, 0, 6.3), in_box(random, 1));
    if (i % 5 == 0) {
      PointLightDescription point;
      point.intensity = bright;
      point.position = at;
      add(point);
      continue;
    }
    if (i % 5 == 1) {
      SpotLightDescription spot;
      spot.intensity = bright;
      spot.from = at;
      spot.to = at + in_box(random, 1);
      spot.cone_angle = static_cast<float>(uniform(random, 5, 120));
      spot.cone_delta_angle = i % 2 == 0 ? 0 : static_cast<float>(uniform(random, 0, 5));
      add(spot);
      continue;
    }
    ShapeDescription shape;
    AreaLightDescription light;
    light.radiance = bright;
    light.two_sided = random.uniform() < 0.3f;
    shape.area_light = light;
    shape.alpha = {i % 3 == 0 ? 0.0f : 1.0f, kNone};
    all.scene.shapes.push_back(shape);
    if (i % 5 == 2) {
      // A bent strip of two triangles.
      Mesh mesh;
      const double bend = uniform(random, -1, 1);
      for (const DVec3 p : {DVec3(0), DVec3(1, 0, 0), DVec3(0, 1, 0), DVec3(1, 1, bend)})
        mesh.positions.push_back(DVec3(turn * glm::dvec4(0.3 * p, 1)));
      mesh.triangles = {{0, 1, 2}, {1, 3, 2}};
      all.shapes.push_back(triangle_shape(mesh, random.uniform() < 0.5f));
    } else {
      Quadric q = quadric(i % 5 == 3 ? Quadric::Kind::kDisk : Quadric::Kind::kSphere);
      q.radius = uniform(random, 0.01, 0.4);
      q.z_min = i % 5 == 3 ? 0 : -q.radius;
      q.z_max = q.radius;
      all.shapes.push_back(quadric_shape(q, turn, random.uniform() < 0.5f));
    }
  }
  if (unbounded) {
    DistantLightDescription sun;
    sun.radiance = Rgb(0.5f);
    add(sun);
    InfiniteLightDescription sky;
    add(sky);
    sky.image_file = picture("half.pfm", 2, {{{0, 0}, Rgb(1)}, {{1, 0}, Rgb(1)}});
    add(sky);
  }
  return all;
}

/// The centre of the lights, and points near them, behind them and far away.
DVec3 anywhere(Stream& random) { return in_box(random, std::exp2(uniform(random, -8, 8))); }

TEST(LightSelection, ProbabilitiesSumToOneAndNoLightThatArrivesIsLeftOut) {
  for (const int count : {2, 5, 16, 40, 300})
    for (const bool unbounded : {false, true}) {
      const Lamps all = lamps(count, static_cast<uint64_t>(count), unbounded);
      const Lights lights = all.lights();
      Stream random(7);
      int arrived = 0;
      for (int i = 0; i < 400; ++i) {
        const DVec3 ref = anywhere(random);
        double sum = 0;
        bool some = false;
        for (int light = 0; light < lights.size(); ++light) {
          const float pmf = lights.pmf(light, ref);
          ASSERT_GE(pmf, 0);
          sum += static_cast<double>(pmf);
          if (!lights.is_sampled(light)) {
            EXPECT_EQ(pmf, 0);
          }
          for (int k = 0; k < 4; ++k) {
            const Vec2 u = random.uniform2();
            const double primitive = random.uniform_double();
            if (pmf > 0 || !lights.is_sampled(light)) continue;
            const auto sample = lights.sample(light, ref, u, primitive);
            EXPECT_FALSE(sample && !is_black(sample->radiance)) << "light " << light << " of " << count;
          }
          some = some || pmf > 0;
        }
        const auto choice = lights.choose(random.uniform_double(), ref);
        EXPECT_EQ(choice.has_value(), some);
        if (!some) continue;
        ++arrived;
        EXPECT_NEAR(sum, 1, 1e-5);
        EXPECT_GT(choice->pmf, 0);
        EXPECT_FLOAT_EQ(choice->pmf, lights.pmf(choice->light, ref));
      }
      EXPECT_GT(arrived, 100);
    }
}

// χ² over the lights at a few points. False alarm: 1e-6 each, of 24.
TEST(LightSelection, ChoicesFollowTheirProbabilities) {
  constexpr int kDraws = 20000;
  for (const int count : {3, 16, 60})
    for (const bool unbounded : {false, true}) {
      const Lamps all = lamps(count, static_cast<uint64_t>(count) + 100, unbounded);
      const Lights lights = all.lights();
      Stream random(8);
      for (int i = 0; i < 4; ++i) {
        const DVec3 ref = in_box(random, 4);
        std::vector<int> drawn(static_cast<size_t>(lights.size()));
        for (int k = 0; k < kDraws; ++k)
          if (const auto choice = lights.choose((k + random.uniform_double()) / kDraws, ref)) ++drawn[static_cast<size_t>(choice->light)];
        double statistic = 0, rest = 0;
        int degrees = -1, rest_drawn = 0;
        for (int light = 0; light < lights.size(); ++light) {
          const double expected = kDraws * static_cast<double>(lights.pmf(light, ref));
          const int observed = drawn[static_cast<size_t>(light)];
          if (expected == 0) {
            EXPECT_EQ(observed, 0);
          }
          if (expected < 10) {
            rest += expected;
            rest_drawn += observed;
            continue;
          }
          statistic += (observed - expected) * (observed - expected) / expected;
          ++degrees;
        }
        if (rest > 10) {
          statistic += (rest_drawn - rest) * (rest_drawn - rest) / rest;
          ++degrees;
        }
        if (degrees > 0) {
          EXPECT_GT(testing::chi_square_p_value(statistic, degrees), 1e-6) << statistic << " for " << degrees;
        }
      }
    }
}

TEST(LightSelection, TheNearOfManyEqualLampsIsChosen) {
  // A thousand lamps in a lattice of unit width: beside one of them it is chosen ten times as often as by power. (Not nearly always:
  // inside the bounds of both children a node cannot tell which of them holds the near one.)
  SceneDescription scene;
  for (int i = 0; i < 1000; ++i) {
    LightDescription light;
    PointLightDescription point;
    point.position = DVec3(i % 10, i / 10 % 10, i / 100);
    light.kind = point;
    scene.lights.push_back(light);
  }
  const Lights lights = lights_of(scene);
  for (const int i : {0, 555, 999}) {
    const DVec3 ref = DVec3(i % 10, i / 10 % 10, i / 100) + DVec3(0.03, 0.02, 0.04);
    EXPECT_GT(lights.pmf(i, ref), 10 * lights.pmf(i, ref, ChooseBy::kPower)) << i;
    EXPECT_NEAR(lights.pmf(i, ref, ChooseBy::kPower), 0.001, 1e-6);
  }
}

TEST(LightSelection, ASkyTakesWhatItBringsToThePoint) {
  // However large the scene is: a sky of fluence 0.75π (what exceeds the mean of one lit pixel of four) and a lamp of intensity 1.
  SceneDescription scene;
  LightDescription light;
  InfiniteLightDescription sky;
  sky.image_file = picture("quarter.pfm", 2, {{{0, 0}, Rgb(1)}});
  light.kind = sky;
  scene.lights.push_back(light);
  light.kind = PointLightDescription{};
  scene.lights.push_back(light);
  Mesh ground;
  ground.positions = {{-1e4, 0, 0}, {1e4, 0, 0}, {0, 1e4, 0}};
  ground.triangles = {{0, 1, 2}};
  scene.shapes.emplace_back();
  const Lights lights = lights_of(scene, {triangle_shape(ground)});
  const double at_one = 0.9 * 0.75 * std::numbers::pi / (0.75 * std::numbers::pi + 1) + 0.05;
  EXPECT_NEAR(lights.pmf(0, DVec3(1, 0, 0)), at_one, 1e-5);
  EXPECT_GT(lights.pmf(1, DVec3(0.1, 0, 0)), 0.9f) << "by power a tenth";
  EXPECT_GT(lights.pmf(0, DVec3(100, 0, 0)), 0.9f);
  EXPECT_GT(lights.pmf(0, DVec3(1), ChooseBy::kPower), 0.89f);
}

TEST(LightSelection, ALampThatShinesAwayIsNotChosen) {
  AreaLightDescription light;
  SceneDescription scene = emitting(light);
  scene.shapes.push_back(scene.shapes[0]);
  const Quadric disk = quadric(Quadric::Kind::kDisk);
  const Lights lights = lights_of(scene, {quadric_shape(disk, DMat4(1)), quadric_shape(disk, DMat4(1), true)});
  EXPECT_EQ(lights.pmf(0, DVec3(0, 0, 5)), 1);
  EXPECT_EQ(lights.pmf(1, DVec3(0, 0, 5)), 0);
  EXPECT_EQ(lights.pmf(1, DVec3(0, 0, -5)), 1);
}

}  // namespace
}  // namespace woodcock::test
