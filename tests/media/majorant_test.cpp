// Majorants bound the interpolant, and the walk misses nothing; N08 … N11 of the hard cases.
#include "renderer/media/majorant_grid.h"
#include "renderer/media/majorant_iterator.h"

#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>

#include "tests/media/grids.h"
#include "tests/support/optical_depth.h"

namespace woodcock {
namespace {

/// A grid in its own cell coordinates, whose bricks all have a positive bound unless `filled` says otherwise.
MajorantGrid bricks(IVec3 voxels, int edge, float filled = 1, uint64_t seed = 1) {
  MajorantGrid grid(voxels, {DVec3(0), DVec3(voxels)}, GridMap(DMat4(1)), edge);
  Stream random(seed);
  for (int z = 0; z < voxels.z; ++z)
    for (int y = 0; y < voxels.y; ++y)
      for (int x = 0; x < voxels.x; ++x)
        if (random.uniform() < filled) grid.add_voxel({x, y, z}, 1);
  return grid;
}

/// Where a ray is inside the closed box, in double; empty when a > b.
std::pair<double, double> clip(DVec3 o, DVec3 d, DVec3 lower, DVec3 upper, double t_max) {
  double a = 0, b = t_max;
  for (int i = 0; i < 3; ++i) {
    if (d[i] == 0) {
      if (o[i] < lower[i] || o[i] > upper[i]) return {1, 0};
      continue;
    }
    double x = (lower[i] - o[i]) / d[i], y = (upper[i] - o[i]) / d[i];
    if (x > y) std::swap(x, y);
    a = std::max(a, x);
    b = std::min(b, y);
  }
  return {a, b};
}

TEST(BrickIterator, N10_segments_tile_the_part_of_the_ray_in_the_box) {
  Stream random(21);
  MajorantGrid grid;
  IVec3 voxels;
  for (int i = 0; i < 20000; ++i) {
    if (i % 200 == 0) {
      voxels = {1 + random.next_u32() % 40, 1 + random.next_u32() % 40, 1 + random.next_u32() % 40};
      grid = bricks(voxels, 1 << (random.next_u32() % 4));
    }
    Vec3 o;
    // Half of the origins on integer points: corners, edges and faces of bricks.
    for (int k = 0; k < 3; ++k) o[k] = (random.uniform() * 2 - 0.5f) * static_cast<float>(voxels[k]);
    if (i % 2) o = glm::round(o);
    const Vec3 d = awkward_direction(random);
    const float t_max = i % 3 ? kInf : 10 * random.uniform();
    const auto [a, b] = clip(DVec3(o), DVec3(d), DVec3(0), DVec3(voxels), t_max);
    BrickIterator walk(grid, {o, d}, t_max);
    // Quotients and products with a reciprocal differ in the last digits.
    const double rounding = 1e-14 * (1 + std::abs(a) + (std::isfinite(b) ? std::abs(b) : 0));
    std::optional<double> end;
    const double want = b;
    int steps = 0;
    while (const auto s = walk.next()) {
      if (end) {
        ASSERT_EQ(s->t0, *end);
      } else {
        ASSERT_NEAR(s->t0, a, rounding);
      }
      ASSERT_LT(s->t0, s->t1);
      end = s->t1;
      ASSERT_LE(++steps, voxels.x + voxels.y + voxels.z);
    }
    if (a + rounding < want) {
      ASSERT_TRUE(end);
      ASSERT_NEAR(*end, want, rounding);
    } else if (!(a < want)) {
      ASSERT_EQ(steps, 0);
    }
  }
}

TEST(BrickIterator, N10_each_segment_lies_in_the_brick_whose_bound_it_carries) {
  const IVec3 voxels{24, 17, 9};
  for (const int edge : {1, 2, 4, 8}) {
    MajorantGrid grid(voxels, {DVec3(0), DVec3(voxels)}, GridMap(DMat4(1)), edge);
    Stream random(22);
    for (int z = 0; z < voxels.z; ++z)
      for (int y = 0; y < voxels.y; ++y)
        for (int x = 0; x < voxels.x; ++x) grid.add_voxel({x, y, z}, random.uniform());
    int segments = 0;
    for (int i = 0; i < 5000; ++i) {
      const Vec3 o = Vec3(voxels) * (Vec3(random.uniform(), random.uniform(), random.uniform()) * 3.0f - 1.0f);
      const Vec3 d = glm::normalize(Vec3(voxels) * Vec3(random.uniform(), random.uniform(), random.uniform()) - o);
      BrickIterator walk(grid, {o, d}, kInf);
      while (const auto s = walk.next()) {
        const DVec3 middle = DVec3(o) + 0.5 * (double(s->t0) + double(s->t1)) * DVec3(d);
        // Segments shorter than the rounding of t say nothing about the place.
        if (s->t1 - s->t0 < 1e-4f) continue;
        const IVec3 brick = glm::clamp(IVec3(glm::floor(middle / double(edge))), IVec3(0), grid.size() - 1);
        EXPECT_EQ(s->sigma, grid.bound(brick));
        ++segments;
      }
    }
    EXPECT_GT(segments, 2500);
  }
}

TEST(BrickIterator, N11_rays_in_faces_of_the_box_with_zeros_of_both_signs_are_inside) {
  const MajorantGrid grid = bricks({4, 4, 4}, 2);
  for (const float zero : {0.0f, -0.0f})
    for (const float face : {0.0f, 4.0f, -0.0f, 2.0f}) {
      BrickIterator walk(grid, {{face, -1, face}, {zero, 1, zero}}, kInf);
      const auto first = walk.next(), second = walk.next();
      ASSERT_TRUE(first && second);
      EXPECT_EQ(first->t0, 1);
      EXPECT_EQ(first->t1, 3);
      EXPECT_EQ(second->t1, 5);
      EXPECT_FALSE(walk.next());
    }
  // Just outside the face: nothing.
  EXPECT_FALSE(BrickIterator(grid, {{-1e-6f, -1, 1}, {0.0f, 1, -0.0f}}, kInf).next());
  EXPECT_FALSE(BrickIterator(grid, {{4.0001f, -1, 1}, {-0.0f, 1, 0.0f}}, kInf).next());
}

TEST(BrickIterator, rays_that_point_away_end_before_or_have_no_length_find_nothing) {
  const MajorantGrid grid = bricks({4, 4, 4}, 2);
  EXPECT_FALSE(BrickIterator(grid, {{-1, 1, 1}, {-1, 0, 0}}, kInf).next());
  EXPECT_FALSE(BrickIterator(grid, {{-1, 1, 1}, {1, 0, 0}}, 0.5f).next());
  EXPECT_FALSE(BrickIterator(grid, {{1, 1, 1}, {1, 0, 0}}, 0).next());
  EXPECT_FALSE(BrickIterator(grid, {{1, 1, 1}, {1, 0, 0}}, std::numeric_limits<float>::quiet_NaN()).next());
  EXPECT_FALSE(BrickIterator().next());
}

TEST(BrickIterator, N09_empty_bricks_are_skipped_and_an_empty_grid_is_vacuum) {
  EXPECT_FALSE(BrickIterator(bricks({16, 16, 16}, 4, 0), {{-1, 5, 5}, {1, 0, 0}}, kInf).next());
  MajorantGrid grid({64, 4, 4}, {DVec3(0), DVec3(64, 4, 4)}, GridMap(DMat4(1)), 4);
  grid.add_voxel({33, 1, 1}, 2);
  BrickIterator walk(grid, {{-1, 2, 2}, {1, 0, 0}}, kInf);
  const auto s = walk.next();
  ASSERT_TRUE(s);
  EXPECT_EQ(s->t0, 33);
  EXPECT_EQ(s->t1, 37);
  EXPECT_FALSE(walk.next());

  const Medium empty = make_medium(grid_medium(make_dense(IVec3(8), DVec3(0), DVec3(8), [](IVec3) { return 0.f; })));
  EXPECT_FALSE(empty.attenuates());
  EXPECT_FALSE(empty.scatters());
  EXPECT_FALSE(MajorantIterator(empty, {{-1, 2, 2}, {1, 0, 0}}, kInf).next());
}

TEST(MajorantGrid, N08_bounds_hold_at_every_point_of_every_segment_even_for_a_spike_of_one_voxel) {
  for (const IVec3 spike : {IVec3(7, 8, 9), IVec3(8, 8, 8), IVec3(0, 0, 0), IVec3(15, 15, 15), IVec3(4, 3, 12)}) {
    // Small σ chooses large bricks, large σ small ones.
    for (const float sigma : {0.01f, 1.0f, 1000.0f}) {
      const Medium m = make_medium(grid_medium(make_dense(IVec3(16), DVec3(0), DVec3(16), [&](IVec3 v) { return v == spike ? 1.f : 0.f; }),
                                               Rgb(sigma), Rgb(sigma, 0, 0)));
      Stream random(31);
      for (int i = 0; i < 2000; ++i) {
        const Vec3 o = Vec3(16) * (Vec3(random.uniform(), random.uniform(), random.uniform()) * 3.0f - 1.0f);
        const Vec3 target = Vec3(spike) + Vec3(random.uniform(), random.uniform(), random.uniform()) * 2.0f - 0.5f;
        const Vec3 d = glm::normalize(glm::clamp(target, Vec3(0.01f), Vec3(15.99f)) - o);
        MajorantIterator walk(m, {o, d}, kInf);
        double end = 0;
        double in_walk = 0;
        while (const auto s = walk.next()) {
          for (int k = 0; k <= 8; ++k) {
            ASSERT_LE(max_component(m.sigma_t(Ray{o, d}.at(s->t0 + (s->t1 - s->t0) * k / 8))), s->sigma);
          }
          // Outside the segments there is nothing.
          for (int k = 1; k < 8 && end < s->t0; ++k) ASSERT_EQ(m.density(Ray{o, d}.at(end + (s->t0 - end) * k / 8)), 0);
          end = s->t1;
          in_walk += s->t1 - s->t0;
        }
        ASSERT_GT(in_walk, 0);
      }
    }
  }
}

TEST(MajorantGrid, bound_of_random_grids_holds_for_all_brick_sizes_and_transforms) {
  Stream random(41);
  for (int i = 0; i < 60; ++i) {
    const IVec3 size{1 + random.next_u32() % 30, 1 + random.next_u32() % 30, 1 + random.next_u32() % 30};
    const DenseGrid<float> grid = random_dense(size, 100 + i, 0.2f);
    DMat4 world = glm::rotate(DMat4(1), 6.28 * random.uniform_double(), glm::normalize(DVec3(1, 2, 3)));
    world = glm::scale(world, DVec3(std::exp2(6 * random.uniform_double() - 3)));
    const Medium m = make_medium(grid_medium(grid, Rgb(0.1f), Rgb(0.1f, 0.2f, 0.3f)), world);
    for (int k = 0; k < 300; ++k) {
      const DVec3 a = DVec3(size) * (DVec3(random.uniform(), random.uniform(), random.uniform()) * 2.0 - 0.5);
      const DVec3 b = DVec3(size) * DVec3(random.uniform(), random.uniform(), random.uniform());
      const Vec3 o{DVec3(world * glm::dvec4(a, 1))}, d = glm::normalize(Vec3(DVec3(world * glm::dvec4(b, 1))) - o);
      MajorantIterator walk(m, {o, d}, kInf);
      while (const auto s = walk.next())
        for (int j = 0; j < 10; ++j)
          ASSERT_LE(max_component(m.sigma_t(Ray{o, d}.at(s->t0 + (s->t1 - s->t0) * static_cast<double>(random.uniform())))), s->sigma);
    }
  }
}

/// Bounds from below and above at points of the segments, ends included; how many segments were constant, and how many not.
struct SegmentKinds {
  int constant = 0, varying = 0;
};
SegmentKinds expect_bounds(const Medium& m, const Ray& ray, Stream& random) {
  SegmentKinds kinds;
  MajorantIterator walk(m, ray, kInf);
  while (const auto s = walk.next()) {
    EXPECT_GE(s->lower, 0);
    EXPECT_LE(s->lower, s->sigma);
    ++(s->lower == s->sigma ? kinds.constant : kinds.varying);
    for (int j = 0; j < 8; ++j) {
      const float t = j < 2 ? (j == 0 ? s->t0 : s->t1) : s->t0 + (s->t1 - s->t0) * random.uniform();
      const Rgb sigma_t = m.sigma_t(ray.at(t));
      EXPECT_LE(max_component(sigma_t), s->sigma);
      EXPECT_GE(min_component(sigma_t), s->lower);
    }
  }
  return kinds;
}

Ray ray_through(const DMat4& render_from_medium, IVec3 size, Stream& random) {
  const DVec3 a = DVec3(size) * (DVec3(random.uniform(), random.uniform(), random.uniform()) * 2.0 - 0.5);
  const DVec3 b = DVec3(size) * DVec3(random.uniform(), random.uniform(), random.uniform());
  const Vec3 o{DVec3(render_from_medium * glm::dvec4(a, 1))};
  return {o, glm::normalize(Vec3(DVec3(render_from_medium * glm::dvec4(b, 1))) - o)};
}

TEST(MajorantGrid, lower_bounds_hold_at_every_point_of_every_segment_for_all_brick_sizes) {
  Stream random(42);
  for (int i = 0; i < 60; ++i) {
    const IVec3 size{4 + random.next_u32() % 40, 4 + random.next_u32() % 40, 4 + random.next_u32() % 40};
    const DenseGrid<float> grid = make_dense(size, DVec3(0), DVec3(size), [&](IVec3) { return 0.25f + random.uniform(); });
    const DMat4 world = glm::scale(glm::rotate(DMat4(1), 6.28 * random.uniform_double(), glm::normalize(DVec3(1, 2, 3))),
                                   DVec3(std::exp2(6 * random.uniform_double() - 3)));
    const Medium m = make_medium(grid_medium(grid, Rgb(0.1f), i % 2 ? Rgb(0.1f, 0.2f, 0.3f) : Rgb(0.2f)), world);
    SegmentKinds kinds;
    for (int k = 0; k < 100; ++k) kinds.constant += expect_bounds(m, ray_through(world, size, random), random).constant;
    EXPECT_EQ(kinds.constant, 0);
  }
}

TEST(MajorantGrid, bounds_of_a_brick_of_equal_voxels_are_equal_to_the_bit_and_zero_below_next_to_the_ends) {
  // Two halves of different density: no brick that reaches the boundary between them, or an end, is constant.
  const IVec3 size(64, 32, 32);
  for (const float sigma : {1.0f, 0.3f, 0.01f}) {
    const Medium m = make_medium(grid_medium(make_dense(size, DVec3(0), DVec3(size), [](IVec3 v) { return v.x < 32 ? 0.7f : 1.3f; }),
                                             Rgb(sigma), Rgb(0.3f * sigma)));
    const MajorantGrid& grid = m.majorants();
    int constant = 0;
    for (int z = 0; z < grid.size().z; ++z)
      for (int y = 0; y < grid.size().y; ++y)
        for (int x = 0; x < grid.size().x; ++x) {
          const IVec3 b{x, y, z}, first = b * grid.edge() - 1, last = b * grid.edge() + grid.edge();
          const bool inner = glm::all(glm::greaterThan(first, IVec3(-1))) && glm::all(glm::lessThan(last, size));
          const bool equal = inner && (last.x < 32 || first.x >= 32);
          EXPECT_EQ(grid.bound(b) == grid.lower(b), equal);
          if (!inner) {
            EXPECT_EQ(grid.lower(b), 0);
          }
          if (equal) {
            EXPECT_EQ(grid.bound(b), m.grey_sigma_t(Vec3(b * grid.edge()) + 1.0f));
          }
          constant += equal;
        }
    if (sigma > 0.1f) {
      EXPECT_GT(constant, 0);
    }
    Stream random(43);
    for (int k = 0; k < 300; ++k) expect_bounds(m, ray_through(DMat4(1), size, random), random);
  }
}

TEST(MajorantGrid, a_voxel_of_zero_anywhere_in_reach_leaves_no_lower_bound) {
  for (const IVec3 hole : {IVec3(7, 10, 10), IVec3(12, 12, 12), IVec3(9, 9, 9)}) {
    const Medium m = make_medium(
        grid_medium(make_dense(IVec3(24), DVec3(0), DVec3(24), [&](IVec3 v) { return v == hole ? 0.f : 1.f; }), Rgb(1), Rgb(1)));
    ASSERT_EQ(m.majorants().edge(), 4);
    EXPECT_EQ(m.majorants().lower(IVec3(2)), 0);
    EXPECT_EQ(m.majorants().lower(IVec3(3)), hole == IVec3(12) ? 0 : 2);
  }
}

TEST(MajorantGrid, N10_optical_depth_over_the_segments_equals_the_exact_sum_along_axes_and_diagonals) {
  const IVec3 size{16, 16, 16};
  const DenseGrid<float> grid = random_dense(size, 5, 0.1f);
  for (const float sigma : {0.001f, 0.3f, 100.0f}) {
    const Medium m = make_medium(grid_medium(grid, Rgb(sigma), Rgb(0)));
    for (const DVec3 direction : {DVec3(1, 0, 0), DVec3(0, 1, 0), DVec3(0, 0, 1), DVec3(1, 1, 0), DVec3(0, 1, 1), DVec3(1, 1, 1)})
      for (const DVec3 start : {DVec3(0), DVec3(4), DVec3(0.5), DVec3(-3), DVec3(7.25, 4, 8)}) {
        const DVec3 d = glm::normalize(direction);
        const double want = reference_depth(grid, start, d, 0, 100);
        double sum = 0;
        MajorantIterator walk(m, {Vec3(start), Vec3(d)}, 100);
        while (const auto s = walk.next()) sum += reference_depth(grid, start, d, s->t0, s->t1);
        EXPECT_NEAR(testing::optical_depth_exact(m, {Vec3(start), Vec3(d)}, 0, 100).x, sigma * want, 1e-5 * sigma * (1 + want));
        EXPECT_NEAR(sum, want, 1e-5 * (1 + want)) << sigma << ' ' << start.x << ' ' << direction.x << direction.y << direction.z;
      }
  }
}

TEST(MajorantGrid, brick_edge_follows_the_optical_depth) {
  const auto edge = [](float sigma) {
    return make_medium(grid_medium(make_dense(IVec3(64), DVec3(0), DVec3(64), [](IVec3) { return 1.f; }), Rgb(sigma), Rgb(0)))
        .majorants()
        .edge();
  };
  EXPECT_EQ(edge(1), 4);
  EXPECT_EQ(edge(1.0f / 16), 16);
  EXPECT_EQ(edge(1e-6f), 64);
}

}  // namespace
}  // namespace woodcock
