// Homogeneous and dense grid media.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>

#include "renderer/media/majorant_iterator.h"
#include "renderer/scene/colorimetry.h"
#include "renderer/scene/scene_error.h"
#include "tests/media/grids.h"

namespace woodcock {
namespace {

TEST(HomogeneousMedium, coefficients_are_per_render_unit) {
  HomogeneousDescription d{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, HenyeyGreensteinDescription{0.5f}};
  const Medium m = make_medium(d, DMat4(1), glm::scale(DMat4(1), DVec3(4)), 4);
  EXPECT_TRUE(m.is_homogeneous());
  EXPECT_EQ(m.homogeneous().sigma_t, Rgb(1.25f, 1.75f, 2.25f));
  EXPECT_EQ(m.homogeneous().sigma_s, Rgb(1, 1.25f, 1.5f));
  EXPECT_EQ(m.homogeneous().emission, Rgb(0.25f * 7, 0.5f * 8, 0.75f * 9));
  EXPECT_EQ(m.phase_at(Vec3(0)).pdf({0, 0, 1}, {1, 0, 0}), HenyeyGreenstein{0.5f}.eval(Vec3(0, 0, 1), {1, 0, 0}));
  EXPECT_TRUE(m.scatters());
  EXPECT_TRUE(m.emits());
  EXPECT_FALSE(m.is_grey());
  EXPECT_EQ(m.maximum_sigma_t(), 2.25f);
  EXPECT_EQ(albedo(m, Vec3(0)), Rgb(1 / 1.25f, 1.25f / 1.75f, 1.5f / 2.25f));
}

TEST(HomogeneousMedium, walk_is_one_segment_even_without_an_end) {
  const Medium m = make_medium(HomogeneousDescription{});
  MajorantIterator walk(m, {{1, 2, 3}, {0, 0, 1}}, kInf);
  const auto segment = walk.next();
  ASSERT_TRUE(segment);
  EXPECT_EQ(segment->t0, 0);
  EXPECT_EQ(segment->t1, kInf);
  EXPECT_EQ(segment->sigma, 2);
  EXPECT_FALSE(walk.next());
}

TEST(HomogeneousMedium, vacuum_has_no_segments) {
  HomogeneousDescription d;
  d.sigma_a = d.sigma_s = Rgb(0);
  const Medium m = make_medium(d);
  EXPECT_FALSE(MajorantIterator(m, {{0, 0, 0}, {0, 0, 1}}, 10).next());
  EXPECT_EQ(albedo(m, Vec3(0)), Rgb(0));
}

TEST(Medium, values_without_meaning_are_refused_with_their_place) {
  HomogeneousDescription d;
  d.phase = HenyeyGreensteinDescription{1};
  EXPECT_THROW(make_medium(d), SceneError);
  d.phase = {};
  d.sigma_a.y = -1;
  EXPECT_THROW(make_medium(d), SceneError);
  d.sigma_a.y = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(make_medium(d), SceneError);
  EXPECT_THROW(make_medium(HomogeneousDescription{}, glm::scale(DMat4(1), DVec3(1, 0, 1))), SceneError);
  EXPECT_THROW(make_medium(grid_medium(make_dense(IVec3(2), DVec3(0), DVec3(1), [](IVec3) { return kInf; }))), SceneError);
  // So deep that a ray would never get through, and deep but finite.
  EXPECT_THROW(make_medium(grid_medium(make_dense(IVec3(2), DVec3(0), DVec3(1), [](IVec3) { return 1e30f; }))), SceneError);
  EXPECT_NO_THROW(make_medium(grid_medium(make_dense(IVec3(2), DVec3(0), DVec3(1), [](IVec3) { return 1e7f; }))));
}

TEST(Medium, a_grid_without_its_values_is_refused) {
  DenseGrid<float> grid = random_dense(IVec3(3), 1);
  grid.values.pop_back();
  EXPECT_THROW(make_medium(grid_medium(grid)), SceneError);
}

TEST(Medium, negative_densities_are_read_as_zero_and_reported) {
  std::vector<std::string> notes;
  const auto grid = make_dense(IVec3(2), DVec3(0), DVec3(1), [](IVec3 v) { return v.x == 0 ? -1.f : 1.f; });
  const Medium m(describe(grid_medium(grid)), DMat4(1), 1, notes);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_THAT(notes[0], testing::HasSubstr("4 negative"));
  EXPECT_EQ(m.density({0.25f, 0.25f, 0.25f}), 0);
}

TEST(GridMedium, density_equals_the_slow_reference) {
  const DenseGrid<float> grid = random_dense({5, 3, 7}, 1, 0.9f);
  const Medium m = make_medium(grid_medium(grid));
  Stream random(2);
  for (int i = 0; i < 20000; ++i) {
    const Vec3 p = Vec3(grid.size) * (Vec3(random.uniform(), random.uniform(), random.uniform()) * 1.4f - 0.2f);
    EXPECT_NEAR(m.density(p), reference_density(grid, DVec3(p)), 3e-6);
  }
}

TEST(GridMedium, a_constant_grid_equals_the_homogeneous_medium_inside_and_fades_over_the_outer_half_voxel) {
  const Rgb a{0.1f, 0.2f, 0.3f}, s{1, 2, 3};
  const Medium grid = make_medium(grid_medium(make_dense(IVec3(8), DVec3(0), DVec3(8), [](IVec3) { return 1.f; }), a, s));
  const Medium constant = make_medium(HomogeneousDescription{a, s, Rgb(0), {}});
  Stream random(3);
  for (int i = 0; i < 1000; ++i) {
    const Vec3 p = Vec3(0.5f) + 7.0f * Vec3(random.uniform(), random.uniform(), random.uniform());
    EXPECT_EQ(grid.at(p).sigma_t, constant.at(p).sigma_t);
    EXPECT_EQ(grid.at(p).sigma_s, constant.at(p).sigma_s);
  }
  EXPECT_EQ(grid.density({4, 4, 0.25f}), 0.75f);
  EXPECT_EQ(grid.density({4, 4, 0}), 0.5f);
  EXPECT_EQ(grid.density({4, 4, 8}), 0.5f);
  EXPECT_EQ(grid.density({4, 4, -1e-6f}), 0);
  EXPECT_EQ(grid.density({4, 4, 8.00001f}), 0);
  EXPECT_EQ(grid.density({std::numeric_limits<float>::quiet_NaN(), 4, 4}), 0);
}

TEST(GridMedium, emission_is_sigma_a_times_le_times_the_interpolated_scale) {
  GridMediumDescription d = grid_medium(make_dense({2, 1, 1}, DVec3(0), DVec3(2, 1, 1), [](IVec3) { return 2.f; }), Rgb(3), Rgb(0));
  d.emission = {1, 2, 4};
  d.emission_scale = 0.5f;
  EXPECT_EQ(make_medium(d).at({1, 0.5f, 0.5f}).emission, 3.0f * Rgb(1, 2, 4));
  d.emission_grid =
      std::make_shared<const FloatVolume>(make_dense({2, 1, 1}, DVec3(0), DVec3(2, 1, 1), [](IVec3 v) { return v.x == 0 ? 1.f : 3.f; }));
  EXPECT_EQ(make_medium(d).at({0.5f, 0.5f, 0.5f}).emission, 3.0f * Rgb(1, 2, 4));
  EXPECT_EQ(make_medium(d).at({1, 0.5f, 0.5f}).emission, 6.0f * Rgb(1, 2, 4));
  EXPECT_TRUE(make_medium(d).emits());
  d.emission = Rgb(0);
  EXPECT_FALSE(make_medium(d).emits());
}

TEST(GridMedium, temperatures_emit_a_blackbody_above_the_cutoff) {
  const auto constant = [](float value) { return make_dense(IVec3(2), DVec3(0), DVec3(2), [=](IVec3) { return value; }); };
  GridMediumDescription d = grid_medium(constant(2), Rgb(3), Rgb(0));
  d.emission = Rgb(1);
  d.emission_scale = 0.25f;
  d.temperature = std::make_shared<const FloatVolume>(constant(4000));
  d.temperature_scale = 2;
  d.temperature_offset = 1000;
  d.temperature_cutoff = 100;
  const Rgb want = 6.0f * 0.25f * blackbody_emission(6000);
  const Rgb got = make_medium(d).at({1, 1, 1}).emission;
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(got[c], want[c], 1e-5 * want[c]);
  // ∫ of a 6500 K blackbody with peak 1 against the luminous efficiency.
  d.temperature_offset = 750;
  EXPECT_NEAR(luminance(make_medium(d).at({1, 1, 1}).emission), 6 * 0.25 * 94.7, 0.5);
  d.temperature_offset = 3960;
  EXPECT_FALSE(make_medium(d).emits());
  EXPECT_EQ(make_medium(d).at({1, 1, 1}).emission, Rgb(0));
  // Stored values may be negative before the offset is taken away.
  d.temperature = std::make_shared<const FloatVolume>(constant(-100));
  d.temperature_offset = -3100;
  d.temperature_scale = 1;
  EXPECT_NEAR(make_medium(d).at({1, 1, 1}).emission.x, 6 * 0.25 * blackbody_emission(3000).x, 1e-3);
}

TEST(GridMedium, N55_rotated_and_unevenly_scaled_transforms_look_up_the_same_points) {
  const DenseGrid<float> grid = random_dense({6, 5, 4}, 11);
  DMat4 world = glm::translate(DMat4(1), DVec3(3, -2, 5));
  world = glm::rotate(world, 0.7, glm::normalize(DVec3(1, 2, 3)));
  world = glm::scale(world, DVec3(0.1, -2, 0.5));
  const DMat4 render = glm::scale(glm::translate(DMat4(1), DVec3(0.5, 0.25, -1)), DVec3(0.25));
  const Medium m = make_medium(grid_medium(grid), world, render, 0.25);
  EXPECT_EQ(m.unit().sigma_t - m.unit().sigma_s, Rgb(2));
  Stream random(12);
  for (int i = 0; i < 5000; ++i) {
    const DVec3 p = DVec3(grid.size) * (DVec3(random.uniform(), random.uniform(), random.uniform()) * 0.98 + 0.01);
    const Vec3 q{DVec3(render * world * glm::dvec4(p, 1))};
    EXPECT_NEAR(m.density(q), reference_density(grid, p), 1e-4);
  }
}

TEST(GridMedium, N66_a_grid_stored_at_1e5_is_as_good_as_at_the_origin) {
  const DenseGrid<float> grid = random_dense({6, 5, 4}, 13);
  DenseGrid<float> far = grid;
  const DVec3 shift(1e5, -2e5, 3e5);
  far.p0 += shift;
  far.p1 += shift;
  const Medium a = make_medium(grid_medium(grid));
  const Medium b = make_medium(grid_medium(far), DMat4(1), glm::translate(DMat4(1), -shift));
  Stream random(14);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 p = Vec3(grid.size) * Vec3(random.uniform(), random.uniform(), random.uniform());
    EXPECT_NEAR(a.density(p), b.density(p), 2e-6);
  }
}

}  // namespace
}  // namespace woodcock
