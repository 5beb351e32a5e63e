// Environment lights: constant ones and equal-area octahedral images.
#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>
#include <numbers>

#include "renderer/core/warp.h"
#include "renderer/lights/octahedral.h"
#include "renderer/scene/scene_error.h"
#include "tests/lights/light_fixtures.h"
#include "tests/support/chi_square.h"

namespace woodcock::test {
namespace {

TEST(Octahedral, MapIsItsInverseAndKeepsArea) {
  Stream random(1);
  for (int i = 0; i < 100000; ++i) {
    const DVec2 p(random.uniform_double(), random.uniform_double());
    const DVec3 w = octahedral_to_sphere(p);
    EXPECT_NEAR(glm::length(w), 1, 1e-14);
    EXPECT_LT(glm::distance(sphere_to_octahedral(w), p), 1e-7);
  }
  // Area: the Jacobian by central differences is 4π wherever the map is smooth.
  constexpr double kStep = 1e-5;
  for (int i = 0; i < 1000; ++i) {
    const DVec2 p(0.01 + 0.98 * random.uniform_double(), 0.01 + 0.98 * random.uniform_double());
    const DVec2 q = glm::abs(2.0 * p - 1.0);
    if (std::abs(q.x + q.y - 1) < 1e-3 || q.x < 1e-3 || q.y < 1e-3) continue;
    const DVec3 du = octahedral_to_sphere(p + DVec2(kStep, 0)) - octahedral_to_sphere(p - DVec2(kStep, 0));
    const DVec3 dv = octahedral_to_sphere(p + DVec2(0, kStep)) - octahedral_to_sphere(p - DVec2(0, kStep));
    EXPECT_NEAR(glm::length(glm::cross(du, dv)) / (4 * kStep * kStep), 4 * std::numbers::pi, 1e-4);
  }
}

TEST(Octahedral, AxesLieWhereTheFormatSays) {
  EXPECT_EQ(sphere_to_octahedral({0, 0, 1}), DVec2(0.5, 0.5));
  EXPECT_LT(glm::distance(sphere_to_octahedral({1, 0, 0}), DVec2(1, 0.5)), 1e-15);
  EXPECT_LT(glm::distance(sphere_to_octahedral({0, 1, 0}), DVec2(0.5, 1)), 1e-15);
  EXPECT_LT(glm::distance(sphere_to_octahedral({-1, 0, 0}), DVec2(0, 0.5)), 1e-15);
  for (const double x : {0.0, -0.0})
    for (const double y : {0.0, -0.0}) {
      const DVec2 pole = sphere_to_octahedral({x, y, -1});  // the four corners are one point
      EXPECT_EQ(pole.x, std::signbit(x) ? 0 : 1);
      EXPECT_EQ(pole.y, std::signbit(y) ? 0 : 1);
    }
  EXPECT_LT(glm::distance(octahedral_to_sphere({0, 0}), DVec3(0, 0, -1)), 1e-15);
}

TEST(InfiniteLight, SamplesFollowTheImageUnderAnyTransform) {
  std::vector<std::pair<IVec2, Rgb>> lit;
  Stream pixels(9);
  for (int y = 0; y < 5; ++y)
    for (int x = 0; x < 5; ++x) lit.push_back({{x, y}, Rgb(pixels.uniform(), pixels.uniform(), x == 2 && y == 1 ? 50.0f : 0.1f)});
  const std::string file = picture("random.pfm", 5, lit);
  const DMat4 turned = glm::rotate(DMat4(1), 1.1, DVec3(1, 2, 3));
  for (const DMat4& m :
       {DMat4(1), turned, glm::scale(turned, DVec3(-1, 1, 1)), glm::scale(turned, DVec3(1, 0.4, 2)), glm::scale(DMat4(1), DVec3(7))}) {
    const Lights lights = image_light(file, m);
    Stream random(12);
    Estimate by_light[3], by_ray[3], density;
    for (int i = 0; i < 200000; ++i) {
      const auto s = lights.sample(0, Vec3(0), random.uniform2(), 0);
      const Vec3 w = square_to_sphere(random.uniform2());
      density.add(static_cast<double>(lights.environment_pdf(w, DVec3(0))) * 4 * std::numbers::pi);
      for (int k = 0; k < 3; ++k) {
        Vec3 axis(0);
        axis[k] = 1;
        by_light[k].add(s ? static_cast<double>(s->radiance.b / s->pdf) * (1 + (s->wi[k] > 0)) : 0.0);
        // What is below the mean is left to scattering.
        const bool sampled = lights.environment_pdf(w, DVec3(0)) > 0;
        by_ray[k].add(sampled ? static_cast<double>(lights.environment(w).b) * (1 + (w[k] > 0)) * 4 * std::numbers::pi : 0);
      }
      if (s) {
        EXPECT_EQ(s->radiance, lights.environment(s->wi));
        EXPECT_EQ(s->pdf, lights.environment_pdf(s->wi, DVec3(0)));
        EXPECT_FALSE(s->is_bounded);
      }
    }
    EXPECT_TRUE(agree(density, 1)) << density.mean();
    for (int k = 0; k < 3; ++k) EXPECT_TRUE(agree(by_light[k], by_ray[k])) << by_light[k].mean() << " against " << by_ray[k].mean();
  }
}

// χ² over the pixels, whose solid angles are equal and over which the density is constant. False alarm: 1e-6.
TEST(InfiniteLight, DirectionsFollowTheDensity) {
  constexpr int kSize = 12, kSamples = 200000;
  std::vector<std::pair<IVec2, Rgb>> lit;
  Stream pixels(19);
  for (int i = 0; i < kSize * kSize; ++i) lit.push_back({{i % kSize, i / kSize}, Rgb(i % 7 == 0 ? 0 : std::exp2(6 * pixels.uniform()))});
  const Lights lights = image_light(picture("chi.pfm", kSize, lit));
  std::vector<double> count(kSize * kSize);
  Stream random(20);
  for (int i = 0; i < kSamples; ++i) {
    const auto s = lights.sample(0, Vec3(0), random.uniform2(), 0);
    if (!s) continue;  // a direction on the border of a pixel, rounded into a dark neighbour
    const DVec2 p = sphere_to_octahedral(DVec3(s->wi)) * static_cast<double>(kSize);
    count[std::min<size_t>(static_cast<size_t>(p.y), kSize - 1) * kSize + std::min<size_t>(static_cast<size_t>(p.x), kSize - 1)] += 1;
  }
  double statistic = 0, total = 0;
  int degrees = -1;
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x) {
      const DVec2 centre((x + 0.5) / kSize, (y + 0.5) / kSize);
      const double p = static_cast<double>(lights.environment_pdf(Vec3(octahedral_to_sphere(centre)), DVec3(0))) * 4 * std::numbers::pi /
                       (kSize * kSize);
      const double observed = count[static_cast<size_t>(y * kSize + x)], expected = p * kSamples;
      total += p;
      if (expected == 0) {
        EXPECT_EQ(observed, 0);
        continue;
      }
      statistic += (observed - expected) * (observed - expected) / expected;
      ++degrees;
    }
  EXPECT_NEAR(total, 1, 1e-5);
  EXPECT_GT(testing::chi_square_p_value(statistic, degrees), 1e-6) << statistic << " for " << degrees;
}

TEST(InfiniteLight, PicturePointsWhereTheFormatSays) {
  // 4x4 pixels: the four in the middle are the cap around +z, the corners the one around −z.
  const Lights lights = image_light(picture("up.pfm", 4, {{{1, 1}, Rgb(1)}, {{2, 1}, Rgb(2)}, {{1, 2}, Rgb(3)}, {{2, 2}, Rgb(4)}}));
  EXPECT_EQ(lights.environment(glm::normalize(Vec3(-0.1f, -0.1f, 1))).g, 1);
  EXPECT_EQ(lights.environment(glm::normalize(Vec3(0.1f, -0.1f, 1))).g, 2);
  EXPECT_EQ(lights.environment(glm::normalize(Vec3(-0.1f, 0.1f, 1))).g, 3);
  EXPECT_EQ(lights.environment(glm::normalize(Vec3(0.1f, 0.1f, 1))).g, 4);
  EXPECT_EQ(lights.environment(Vec3(0, 0, -1)).g, 0);
}

TEST(InfiniteLight, IlluminanceSetsTheIrradianceOfAConstantSky) {
  InfiniteLightDescription light;
  light.illuminance = 10;
  EXPECT_NEAR(one_light(light).environment({0, 0, 1}).g, 10 / kPi, 1e-5f);
  // A white picture of 4 × 4 pixels in pbrt-v4's measure: four centres above the equator, with cosines of 3/4 and a
  // solid angle of 2π/16 each.
  std::vector<std::pair<IVec2, Rgb>> all;
  for (int i = 0; i < 16; ++i) all.push_back({{i % 4, i / 4}, Rgb(1)});
  EXPECT_NEAR(image_light(picture("white.pfm", 4, all), DMat4(1), 10).environment({0, 0, 1}).g, 80 / (3 * kPi), 1e-4);
}

TEST(InfiniteLight, RefusesPicturesThatAreNotSquare) {
  InfiniteLightDescription light;
  light.image_file = write_pfm("tall.pfm", 1, 2, {Rgb(1), Rgb(1)});
  EXPECT_THROW(one_light(light), SceneError);
  // The shape of most pictures of skies is named, with what to do about it.
  light.image_file = write_pfm("wide.pfm", 2, 1, {Rgb(1), Rgb(1)});
  try {
    one_light(light);
    ADD_FAILURE();
  } catch (const SceneError& error) {
    for (const char* words : {"wide.pfm", "2x1", "latitude-longitude", "octahedral", "makeequiarea"})
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
  }
}

TEST(InfiniteLight, NegativePixelsAreZeroAndSaidSo) {
  const Lights lights = image_light(picture("dark.pfm", 2, {{{0, 0}, Rgb(-1, 2, 0)}, {{1, 1}, Rgb(3)}}));
  ASSERT_EQ(lights.notes().size(), 1u);
  EXPECT_NE(lights.notes()[0].find("negative values in 1 of 4 pixels are read as 0"), std::string::npos) << lights.notes()[0];
  EXPECT_TRUE(image_light(picture("bright.pfm", 2, {{{0, 0}, Rgb(1)}})).notes().empty());
}

TEST(InfiniteLight, DensityIsWhatExceedsTheMean) {
  // Sixteen pixels of mean 4: what exceeds it is 16 and 4, but for a remainder below a sixteenth of its pixel.
  std::vector<std::pair<IVec2, Rgb>> lit = {{{0, 0}, Rgb(20)}, {{1, 0}, Rgb(8)}, {{2, 0}, Rgb(4.1f)}};
  for (int i = 3; i < 16; ++i) lit.push_back({{i % 4, i / 4}, Rgb((64 - 32.1f) / 13)});
  const Lights lights = image_light(picture("mean.pfm", 4, lit));
  const auto density = [&](int x, int y) {
    return static_cast<double>(lights.environment_pdf(Vec3(octahedral_to_sphere({(x + 0.5) / 4, (y + 0.5) / 4})), DVec3(0))) * 4 *
           std::numbers::pi / 16;
  };
  EXPECT_NEAR(density(0, 0), 0.8, 1e-5);
  EXPECT_NEAR(density(1, 0), 0.2, 1e-5);
  EXPECT_EQ(density(2, 0), 0);
  for (int i = 3; i < 16; ++i) EXPECT_EQ(density(i % 4, i / 4), 0);
}

TEST(InfiniteLight, ConstantSkiesAreNeverSampled) {
  InfiniteLightDescription sky;
  sky.radiance = Rgb(2);
  const Lights alone = one_light(sky);
  EXPECT_EQ(alone.environment({0, 1, 0}).g, 2);
  EXPECT_EQ(alone.environment_pdf({0, 1, 0}, DVec3(0)), 0);
  EXPECT_EQ(alone.pmf(0, DVec3(0)), 0);
  EXPECT_FALSE(alone.choose(0.5, DVec3(0)));
  // Beside a lamp every sample is the lamp's; a picture of one value is a constant sky.
  SceneDescription scene;
  LightDescription light;
  light.kind = sky;
  scene.lights.push_back(light);
  sky.image_file = picture("grey.pfm", 2, {{{0, 0}, Rgb(0.1f)}, {{1, 0}, Rgb(0.1f)}, {{0, 1}, Rgb(0.1f)}, {{1, 1}, Rgb(0.1f)}});
  light.kind = sky;
  scene.lights.push_back(light);
  light.kind = PointLightDescription{};
  scene.lights.push_back(light);
  const Lights lights = lights_of(scene);
  EXPECT_EQ(lights.pmf(0, DVec3(0)), 0);
  EXPECT_EQ(lights.pmf(1, DVec3(0)), 0);
  EXPECT_EQ(lights.pmf(2, DVec3(0)), 1);
}

TEST(InfiniteLight, SeveralSkiesAddUp) {
  SceneDescription scene;
  LightDescription light;
  InfiniteLightDescription sky;
  sky.radiance = Rgb(1);
  light.kind = sky;
  scene.lights.push_back(light);
  sky.radiance = Rgb(3);
  light.kind = sky;
  scene.lights.push_back(light);
  const Lights lights = lights_of(scene);
  EXPECT_EQ(lights.environment({0, 1, 0}).g, 4);
  EXPECT_TRUE(lights.has_environment());
  EXPECT_FALSE(Lights().has_environment());
}

}  // namespace
}  // namespace woodcock::test
