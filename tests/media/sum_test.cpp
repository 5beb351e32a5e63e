// Media of type `sum`; N15 of the hard cases.
#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>

#include "renderer/media/majorant_iterator.h"
#include "tests/media/grids.h"
#include "tests/support/chi_square.h"

namespace woodcock {
namespace {

using Parts = std::vector<std::shared_ptr<const Medium>>;

std::shared_ptr<const Medium> part(MediumKind kind, const DMat4& world_from_medium = DMat4(1), const TransferTerms& terms = {}) {
  return std::make_shared<const Medium>(make_medium(std::move(kind), world_from_medium, DMat4(1), 1, terms));
}

HomogeneousDescription fog(Rgb a, Rgb s, float g = 0) { return {a, s, Rgb(0), HenyeyGreensteinDescription{g}}; }

/// Two grids that overlap in part, turned against each other, an RGB grid, a cloud, and a fog.
Parts mixed_parts(bool with_fog) {
  const DMat4 turned = glm::rotate(glm::translate(DMat4(1), DVec3(5, 2, 1)), 0.4, DVec3(1, 2, 3));
  RgbGridMediumDescription rgb;
  Stream random(7);
  rgb.sigma_a = rgb_volume(IVec3(6), [&](IVec3) { return Rgb(random.uniform(), 0.2f, 0); });
  rgb.sigma_s = rgb_volume(IVec3(6), [&](IVec3) { return Rgb(0, random.uniform(), 1); });
  rgb.phase = HenyeyGreensteinDescription{-0.5f};
  CloudMediumDescription cloud;
  cloud.p1 = DVec3(4);
  Parts parts{part(grid_medium(random_dense(IVec3(16), 1, 0.2f))),
              part(grid_medium(random_dense(IVec3(20), 2, 0.9f), Rgb(0.1f), Rgb(3, 2, 1)), turned),
              part(rgb, glm::translate(DMat4(1), DVec3(9, -2, 3))), part(cloud)};
  if (with_fog) parts.push_back(part(fog(Rgb(0.01f, 0.02f, 0), Rgb(0.03f), 0.8f)));
  return parts;
}

Vec3 point_around(Stream& random) { return 30.0f * Vec3(random.uniform(), random.uniform(), random.uniform()) - 7.0f; }

TEST(SumMedium, N15_coefficients_and_emission_are_those_of_the_parts_added) {
  const Parts parts = mixed_parts(true);
  const Medium sum(parts);
  EXPECT_FALSE(sum.is_homogeneous());
  EXPECT_FALSE(sum.is_separable());
  EXPECT_FALSE(sum.is_grey());
  EXPECT_TRUE(sum.scatters() && sum.attenuates());
  EXPECT_FALSE(sum.emits());
  Stream random(3);
  for (int i = 0; i < 5000; ++i) {
    const Vec3 p = point_around(random);
    Rgb sigma_t(0), sigma_s(0);
    for (const auto& m : parts) {
      sigma_t += m->at(p).sigma_t;
      sigma_s += m->at(p).sigma_s;
    }
    EXPECT_EQ(sum.at(p).sigma_t, sigma_t);
    EXPECT_EQ(sum.at(p).sigma_s, sigma_s);
    EXPECT_EQ(sum.sigma_t(p), sigma_t);
  }
}

TEST(SumMedium, N15_homogeneous_parts_make_a_homogeneous_medium) {
  HomogeneousDescription glow = fog(Rgb(1, 2, 3), Rgb(0));
  glow.emission = Rgb(5, 1, 0);
  const Medium sum({part(fog(Rgb(0.5f), Rgb(1), 0.9f)), part(glow), part(fog(Rgb(0), Rgb(3), -0.3f))});
  EXPECT_TRUE(sum.is_homogeneous());
  EXPECT_EQ(sum.homogeneous().sigma_t, Rgb(5.5f, 6.5f, 7.5f));
  EXPECT_EQ(sum.homogeneous().sigma_s, Rgb(4));
  EXPECT_EQ(sum.homogeneous().emission, Rgb(5, 2, 0));
  EXPECT_EQ(sum.maximum_sigma_t(), 7.5f);
  EXPECT_TRUE(sum.emits());
  EXPECT_EQ(sum.emission_importance(), nullptr);
  EXPECT_NEAR(sum.mean_sigma_t(), 6.5, 1e-6);
  MajorantIterator walk(sum, {{0, 0, 0}, {1, 0, 0}}, 9);
  const auto s = walk.next();
  ASSERT_TRUE(s);
  EXPECT_EQ(s->t1, 9);
  EXPECT_EQ(s->sigma, 7.5f);
  EXPECT_EQ(s->lower, 5.5f);
  EXPECT_FALSE(walk.next());
}

TEST(SumMedium, segments_follow_each_other_without_overlap_and_bound_the_sum_from_both_sides) {
  for (const bool with_fog : {false, true}) {
    const Medium sum(mixed_parts(with_fog));
    Stream random(4);
    int segments = 0, lower = 0;
    for (int i = 0; i < 2000; ++i) {
      const Ray ray{point_around(random), awkward_direction(random)};
      const float t_max = i % 3 ? kInf : 20 * random.uniform();
      MajorantIterator walk(sum, ray, t_max);
      double end = 0;
      while (const auto s = walk.next()) {
        ASSERT_LT(s->t0, s->t1);
        ASSERT_GE(s->t0, end);
        ASSERT_LE(s->t1, t_max);
        ASSERT_GT(s->sigma, 0);
        if (with_fog) {
          ASSERT_EQ(s->t0, end);
        }
        const double length = std::min(s->t1, 100.0) - s->t0;
        for (int k = 0; k < 6; ++k) {
          const Rgb sigma_t = sum.sigma_t(ray.at(s->t0 + length * (k < 2 ? k : static_cast<double>(random.uniform()))));
          ASSERT_LE(max_component(sigma_t), s->sigma);
          ASSERT_GE(min_component(sigma_t), s->lower);
        }
        // Gaps are empty.
        for (int k = 1; k < 4 && s->t0 > end; ++k)
          ASSERT_EQ(max_component(sum.sigma_t(ray.at(end + (s->t0 - end) * static_cast<float>(k) / 4))), 0);
        end = s->t1;
        ++segments;
        lower += s->lower > 0;
      }
      if (with_fog) {
        ASSERT_EQ(end, t_max);
      } else if (t_max == kInf) {
        ASSERT_EQ(max_component(sum.sigma_t(ray.at(end + 0.01f + random.uniform()))), 0);
      }
    }
    EXPECT_GT(segments, 4000);
    if (with_fog) {
      // The fog's blue channel has σt = 0.03: everywhere at least that of its least channel.
      EXPECT_EQ(lower, segments);
    }
  }
}

TEST(SumMedium, bounds_hold_next_to_the_faces_of_a_box_where_rounding_decides_the_side) {
  // A ray that leaves a box whose density is large at the face, many units from the origin.
  const DMat4 far = glm::translate(DMat4(1), DVec3(1000, 0, 0));
  const Medium sum(
      {part(fog(Rgb(0), Rgb(0.1f))), part(grid_medium(make_dense(IVec3(8), DVec3(0), DVec3(8), [](IVec3) { return 5.f; })), far)});
  Stream random(5);
  for (int i = 0; i < 20000; ++i) {
    const Vec3 o(990 + 4 * random.uniform(), 4, 4);
    const Ray ray{o, glm::normalize(Vec3(1000, 8 * random.uniform(), 8 * random.uniform()) - o)};
    MajorantIterator walk(sum, ray, kInf);
    while (const auto s = walk.next())
      for (const float t : {s->t0, s->t1})
        if (std::isfinite(t)) {
          const float sigma_t = sum.sigma_t(ray.at(t)).x;
          ASSERT_LE(sigma_t, s->sigma);
          ASSERT_GE(sigma_t, s->lower);
        }
  }
}

TEST(SumMedium, the_phase_function_is_mixed_by_sigma_s_in_each_channel) {
  const Medium sum({part(fog(Rgb(0), Rgb(1, 3, 0), 0.8f)), part(fog(Rgb(1), Rgb(0), 0.1f)), part(fog(Rgb(0), Rgb(3, 1, 0), -0.6f))});
  const PhaseMix mix = sum.phase_at(Vec3(0));
  const HenyeyGreenstein a{0.8f}, b{-0.6f};
  Stream random(6);
  for (int i = 0; i < 500; ++i) {
    const Vec3 wo = square_to_sphere(random.uniform2()), wi = square_to_sphere(random.uniform2());
    const float pa = a.eval(wo, wi), pb = b.eval(wo, wi);
    const Rgb value = mix.eval(wo, wi);
    EXPECT_FLOAT_EQ(value.x, 0.25f * pa + 0.75f * pb);
    EXPECT_FLOAT_EQ(value.y, 0.75f * pa + 0.25f * pb);
    EXPECT_EQ(value.z, 0);
    EXPECT_FLOAT_EQ(mix.pdf(wo, wi), 0.5f * pa + 0.5f * pb);
    const Vec2 u = random.uniform2();
    const auto s = mix.sample(wo, u, random.uniform());
    EXPECT_EQ(s.pdf, mix.pdf(wo, s.wi));
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(s.weight[c] * s.pdf, mix.eval(wo, s.wi)[c], 1e-6f * s.pdf);
  }
}

TEST(SumMedium, directions_follow_the_mixed_density) {
  // Two tests at level 1e-4 with fixed seeds. The second has lobes within its components, chosen by what is left of a number.
  HomogeneousDescription lobes = fog(Rgb(0), Rgb(1, 2, 0.5f));
  lobes.phase = TwoLobeDescription{0.7f, -0.7f, 0.4f};
  HomogeneousDescription mie = fog(Rgb(0), Rgb(0.5f, 0.1f, 3));
  mie.phase = MieDescription{5};
  const Vec3 wo = glm::normalize(Vec3(0.3f, -0.5f, 0.7f));
  for (const Medium& sum :
       {Medium({part(fog(Rgb(0), Rgb(1, 3, 2), 0.6f)), part(fog(Rgb(0), Rgb(3, 1, 0), -0.4f))}), Medium({part(lobes), part(mie)})}) {
    const PhaseMix mix = sum.phase_at(Vec3(0));
    Stream random(17);
    const auto result = testing::chi_square_sphere(
        [&] {
          const Vec2 u = random.uniform2();
          return std::optional<Vec3>(mix.sample(wo, u, random.uniform()).wi);
        },
        [&](Vec3 wi) { return mix.pdf(wo, wi); });
    EXPECT_GT(result.p_value, 1e-4) << result.describe();
    EXPECT_NEAR(result.total, 1, 2e-3);
  }
}

TEST(SumMedium, a_part_scatters_only_inside_of_its_box) {
  GridMediumDescription grid = grid_medium(make_dense(IVec3(8), DVec3(0), DVec3(8), [](IVec3) { return 1.f; }), Rgb(0), Rgb(3));
  grid.phase = HenyeyGreensteinDescription{0.9f};
  const Medium sum({part(grid), part(fog(Rgb(0), Rgb(1), -0.9f))});
  const Vec3 wo(0, 0, 1), wi(0.6f, 0, -0.8f);
  const float p = HenyeyGreenstein{0.9f}.eval(wo, wi), q = HenyeyGreenstein{-0.9f}.eval(wo, wi);
  EXPECT_FLOAT_EQ(sum.phase_at({4, 4, 4}).pdf(wo, wi), 0.75f * p + 0.25f * q);
  EXPECT_EQ(sum.phase_at({9, 4, 4}).pdf(wo, wi), q);
  EXPECT_EQ(sum.phase_at({9, 4, 4}).sample(wo, {0.3f, 0.2f}, 0.9f).weight, Rgb(1));
  // Nothing scatters here: still a phase function, for points that rounding moved.
  EXPECT_TRUE(std::isfinite(Medium({part(grid), part(grid)}).phase_at({9, 4, 4}).pdf(wo, wi)));
}

TEST(SumMedium, media_may_be_summed_before_they_are_defined) {
  SceneDescription scene;
  scene.media.push_back(describe(SumMediumDescription{{1, 2}}));
  scene.media.push_back(describe(fog(Rgb(1), Rgb(2))));
  scene.media.push_back(describe(fog(Rgb(3), Rgb(4))));
  scene.settings.terms.absorption = false;
  const Media media(scene, DMat4(1), 1);
  EXPECT_EQ(media[0].homogeneous().sigma_t, Rgb(6));
  EXPECT_EQ(media[0].parts().size(), 2u);
  EXPECT_EQ(media[1].homogeneous().sigma_t, Rgb(2));
}

}  // namespace
}  // namespace woodcock
