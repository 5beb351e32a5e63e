// RGB grids and procedural clouds.
#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>

#include "renderer/media/majorant_iterator.h"
#include "renderer/scene/scene_error.h"
#include "tests/media/grids.h"

namespace woodcock {
namespace {

TEST(RgbGridMedium, interpolates_the_coefficients_of_each_channel_as_a_grid_of_its_own) {
  Stream random(1);
  const IVec3 size(4, 5, 3);
  const auto value = [&](IVec3) { return Rgb(random.uniform(), random.uniform(), random.uniform()); };
  RgbGridMediumDescription d;
  d.scale = 3;
  d.sigma_a = rgb_volume(size, value);
  d.sigma_s = rgb_volume(size, value);
  d.emission = rgb_volume(size, value);
  d.emission_scale = 0.5f;
  d.phase = HenyeyGreensteinDescription{0.25f};
  const Medium m = make_medium(d, DMat4(1), glm::scale(DMat4(1), DVec3(2)), 2);
  EXPECT_TRUE(m.scatters());
  EXPECT_TRUE(m.emits());
  EXPECT_FALSE(m.is_grey());
  EXPECT_FALSE(m.is_separable());
  EXPECT_EQ(m.phase_at(Vec3(4)).pdf({0, 0, 1}, {1, 0, 0}), HenyeyGreenstein{0.25f}.eval(Vec3(0, 0, 1), {1, 0, 0}));
  const auto channel = [&](const RgbVolume& grid, int c, DVec3 p) {
    return reference_density(make_dense(size, DVec3(0), DVec3(size), [&](IVec3 v) { return grid.at(v.x, v.y, v.z)[c]; }), p);
  };
  for (int i = 0; i < 300; ++i) {
    const DVec3 p = DVec3(size) * (DVec3(random.uniform(), random.uniform(), random.uniform()) * 1.2 - 0.1);
    const MediumPoint point = m.at(Vec3(2.0 * p));
    for (int c = 0; c < 3; ++c) {
      const double a = 1.5 * channel(*d.sigma_a, c, p), s = 1.5 * channel(*d.sigma_s, c, p);
      EXPECT_NEAR(point.sigma_t[c], a + s, 1e-5);
      EXPECT_NEAR(point.sigma_s[c], s, 1e-5);
      EXPECT_NEAR(m.sigma_t(Vec3(2.0 * p))[c], a + s, 1e-5);
      EXPECT_NEAR(point.emission[c], a * 0.5 * channel(*d.emission, c, p), 1e-5);
    }
  }
}

TEST(RgbGridMedium, bounds_hold_in_all_channels) {
  Stream random(2);
  const IVec3 size(13, 9, 20);
  RgbGridMediumDescription d;
  d.sigma_a = rgb_volume(size, [&](IVec3) { return random.uniform() < 0.9f ? Rgb(0) : Rgb(random.uniform(), 3 * random.uniform(), 0); });
  d.sigma_s = rgb_volume(size, [&](IVec3) { return random.uniform() < 0.9f ? Rgb(0) : Rgb(random.uniform(), 0, random.uniform()); });
  for (const float scale : {0.01f, 5.0f}) {
    d.scale = scale;
    const Medium m = make_medium(d);
    for (int i = 0; i < 3000; ++i) {
      const Vec3 o = Vec3(size) * (Vec3(random.uniform(), random.uniform(), random.uniform()) * 2.0f - 0.5f);
      const Vec3 d_unit = awkward_direction(random);
      MajorantIterator walk(m, {o, d_unit}, kInf);
      while (const auto s = walk.next())
        for (int k = 0; k < 4; ++k)
          ASSERT_LE(max_component(m.sigma_t(Ray{o, d_unit}.at(s->t0 + (s->t1 - s->t0) * static_cast<double>(random.uniform())))), s->sigma);
    }
  }
}

TEST(RgbGridMedium, an_absent_coefficient_is_one_inside_the_box_and_zero_outside) {
  RgbGridMediumDescription d;
  d.scale = 2;
  d.sigma_s = rgb_volume(IVec3(2), [](IVec3) { return Rgb(0.5f); });
  const Medium m = make_medium(d);
  EXPECT_EQ(m.at({0, 0, 0}).sigma_t - m.at({0, 0, 0}).sigma_s, Rgb(2));
  EXPECT_EQ(m.at({1, 1, 1}).sigma_t, Rgb(3));
  EXPECT_EQ(m.at({1, 1, 1}).sigma_s, Rgb(1));
  EXPECT_EQ(m.at({2.1f, 1, 1}).sigma_t, Rgb(0));
  EXPECT_TRUE(m.is_grey());
  EXPECT_EQ(m.grey_sigma_t({1, 1, 1}), 3);
  d.sigma_s = nullptr;
  EXPECT_THROW(make_medium(d), SceneError);
}

TEST(RgbGridMedium, grids_of_different_resolution_are_refused) {
  RgbGridMediumDescription d;
  d.sigma_a = rgb_volume(IVec3(2), [](IVec3) { return Rgb(1); });
  d.sigma_s = rgb_volume(IVec3(3), [](IVec3) { return Rgb(1); });
  EXPECT_THROW(make_medium(d), SceneError);
}

TEST(PerlinNoise, is_zero_at_integer_points_continuous_and_periodic) {
  Stream random(3);
  double largest = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec3 p = 50.0f * Vec3(random.uniform(), random.uniform(), random.uniform()) - 25.0f;
    EXPECT_EQ(perlin_noise(glm::floor(p)), 0);
    EXPECT_NEAR(perlin_noise(p), perlin_noise(p + 256.0f), 2e-4);
    EXPECT_NEAR(perlin_noise(p), perlin_noise(p + Vec3(1e-4f, 0, 0)), 1e-3);
    EXPECT_NEAR(perlin_noise(glm::floor(p) + Vec3(0, 0.3f, 0.6f) - Vec3(1e-5f, 0, 0)), perlin_noise(glm::floor(p) + Vec3(0, 0.3f, 0.6f)),
                1e-4);
    largest = std::max(largest, static_cast<double>(std::abs(perlin_noise(p))));
  }
  EXPECT_LE(largest, 1.04);
  EXPECT_GT(largest, 0.6);
}

TEST(PerlinNoise, gradients_at_the_first_lattice_points_are_those_of_the_permutation) {
  // The hash of (0, 0, 0) is perm[perm[perm[0]]] = perm[perm[151]] = perm[17] = 36, and 36 & 15 = 4 means the gradient
  // (1, 0, 1); that of (1, 2, 3) is 42, and 10 means (0, 1, −1). Close to a lattice point the noise is the inner
  // product of the offset with the gradient there.
  const Vec3 d(1e-3f, 2e-3f, 5e-4f);
  EXPECT_NEAR(perlin_noise(d), d.x + d.z, 1e-6);
  EXPECT_NEAR(perlin_noise(Vec3(1, 2, 3) + d), d.y - d.z, 1e-6);
}

TEST(CloudMedium, density_lies_in_0_1_is_full_at_the_ground_and_zero_outside) {
  CloudMediumDescription d;
  d.sigma_a = Rgb(1);
  d.sigma_s = Rgb(3);
  const Medium m = make_medium(d, glm::translate(DMat4(1), DVec3(10, 0, 0)));
  Stream random(4);
  double sum = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec3 p = Vec3(random.uniform(), random.uniform(), random.uniform()) + Vec3(10, 0, 0);
    const float density = m.density(p);
    ASSERT_GE(density, 0);
    ASSERT_LE(density, 1);
    ASSERT_LE(max_component(m.sigma_t(p)), m.maximum_sigma_t());
    sum += density;
  }
  // 2 max(0, ½ − y) alone gives ¼.
  EXPECT_GT(sum / 20000, 0.25);
  EXPECT_LT(sum / 20000, 0.6);
  EXPECT_EQ(m.density({10.5f, 0, 0.5f}), 1);
  EXPECT_EQ(m.density({9.99f, 0, 0.5f}), 0);
  EXPECT_EQ(m.density({10.5f, 1.01f, 0.5f}), 0);
  MajorantIterator walk(m, {{5, 0.5f, 0.5f}, {1, 0, 0}}, kInf);
  const auto s = walk.next();
  ASSERT_TRUE(s);
  EXPECT_NEAR(s->t0, 5, 1e-6);
  EXPECT_NEAR(s->t1, 6, 1e-6);
  EXPECT_GE(s->sigma, 4);
  EXPECT_FALSE(walk.next());
}

}  // namespace
}  // namespace woodcock
