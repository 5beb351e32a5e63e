// Media of which only some terms of the transfer equation count.
#include <gtest/gtest.h>

#include "renderer/media/majorant_iterator.h"
#include "tests/media/grids.h"

namespace woodcock {
namespace {

/// All sixteen subsets of the four terms.
std::vector<TransferTerms> all_subsets() {
  std::vector<TransferTerms> result;
  for (int i = 0; i < 16; ++i) result.push_back({(i & 1) != 0, (i & 2) != 0, (i & 4) != 0, (i & 8) != 0});
  return result;
}

/// A homogeneous, a grid, an RGB grid and a cloud, the first three emitting.
std::vector<MediumKind> kinds() {
  const Rgb a(0.5f, 0.25f, 1), s(1, 2, 3);
  GridMediumDescription grid = grid_medium(random_dense(IVec3(12), 3, 0.8f), a, s);
  grid.emission = Rgb(2, 1, 0.5f);
  Stream random(4);
  const auto value = [&](IVec3) { return 0.1f + Rgb(random.uniform(), random.uniform(), random.uniform()); };
  RgbGridMediumDescription rgb;
  rgb.sigma_a = rgb_volume(IVec3(12), value);
  rgb.sigma_s = rgb_volume(IVec3(12), value);
  rgb.emission = rgb_volume(IVec3(12), value);
  CloudMediumDescription cloud;
  cloud.sigma_a = a;
  cloud.sigma_s = s;
  cloud.p1 = DVec3(12);
  return {HomogeneousDescription{a, s, Rgb(3), {}}, grid, rgb, cloud};
}

TEST(Terms, each_leaves_out_exactly_its_own_part_of_the_coefficients) {
  for (const MediumKind& kind : kinds()) {
    const Medium whole = make_medium(kind);
    for (const TransferTerms& terms : all_subsets()) {
      const Medium m = make_medium(kind, DMat4(1), DMat4(1), 1, terms);
      Stream random(5);
      for (int i = 0; i < 200; ++i) {
        const Vec3 p = 14.0f * Vec3(random.uniform(), random.uniform(), random.uniform()) - 1.0f;
        const MediumPoint all = whole.at(p), got = m.at(p);
        const Rgb sigma_a = all.sigma_t - all.sigma_s;
        const Rgb want = (terms.absorption ? sigma_a : Rgb(0)) + (terms.out_scattering ? all.sigma_s : Rgb(0));
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(got.sigma_t[c], want[c], 1e-6f * (1 + all.sigma_t[c]));
        EXPECT_EQ(got.sigma_s, terms.in_scattering ? all.sigma_s : Rgb(0));
        EXPECT_EQ(got.emission, terms.emission ? all.emission : Rgb(0));
        EXPECT_EQ(m.sigma_t(p), got.sigma_t);
        if (m.is_grey()) {
          EXPECT_EQ(Rgb(m.grey_sigma_t(p)), got.sigma_t);
        }
      }
      EXPECT_EQ(m.scatters(), terms.in_scattering);
      EXPECT_EQ(m.emits(), whole.emits() && terms.emission);
      EXPECT_EQ(m.attenuates(), terms.absorption || terms.out_scattering);
    }
  }
}

TEST(Terms, upper_bounds_hold_for_the_whole_extinction_and_lower_ones_for_what_is_left_of_it) {
  for (const MediumKind& kind : kinds()) {
    const Medium whole = make_medium(kind);
    for (const TransferTerms& terms : all_subsets()) {
      const Medium m = make_medium(kind, DMat4(1), DMat4(1), 1, terms);
      EXPECT_EQ(m.maximum_sigma_t(), whole.maximum_sigma_t());
      Stream random(6);
      for (int i = 0; i < 50; ++i) {
        const Ray ray{14.0f * Vec3(random.uniform(), random.uniform(), random.uniform()) - 1.0f, awkward_direction(random)};
        MajorantIterator walk(m, ray, 30), all(whole, ray, 30);
        while (const auto s = walk.next()) {
          EXPECT_EQ(s->sigma, all.next()->sigma);
          const Vec3 p = ray.at(s->t0 + (s->t1 - s->t0) * random.uniform());
          EXPECT_GE(s->sigma, max_component(whole.sigma_t(p)));
          EXPECT_GE(s->sigma, max_component(m.at(p).sigma_s));
          EXPECT_LE(s->lower, min_component(m.sigma_t(p)));
        }
        EXPECT_FALSE(all.next());
      }
    }
  }
}

TEST(Terms, extinction_is_grey_where_what_counts_of_it_is) {
  const HomogeneousDescription d{Rgb(2), Rgb(1, 2, 3), Rgb(0), {}};
  EXPECT_FALSE(make_medium(d).is_grey());
  EXPECT_TRUE(make_medium(d, DMat4(1), DMat4(1), 1, {true, true, false, true}).is_grey());
  RgbGridMediumDescription rgb;
  rgb.sigma_a = rgb_volume(IVec3(3), [](IVec3) { return Rgb(2); });
  rgb.sigma_s = rgb_volume(IVec3(3), [](IVec3) { return Rgb(1, 2, 3); });
  EXPECT_FALSE(make_medium(rgb).is_grey());
  EXPECT_TRUE(make_medium(rgb, DMat4(1), DMat4(1), 1, {true, true, false, true}).is_grey());
}

TEST(Terms, media_honour_the_settings_of_the_scene) {
  SceneDescription scene;
  scene.media.push_back(describe(HomogeneousDescription{Rgb(1), Rgb(2), Rgb(4), {}}));
  scene.settings.terms = {true, false, false, true};
  const Media media(scene, DMat4(1), 1);
  EXPECT_EQ(media[0].homogeneous().sigma_t, Rgb(1));
  EXPECT_EQ(media[0].homogeneous().sigma_s, Rgb(2));
  EXPECT_FALSE(media[0].emits());
}

}  // namespace
}  // namespace woodcock
