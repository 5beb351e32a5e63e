// Sparse grids: NanoVDB trees made by OpenVDB, looked up against NanoVDB's own sampler.
#include <gtest/gtest.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <nanovdb/util/SampleFromVoxels.h>
#include <openvdb/openvdb.h>

#include <cstring>
#include <glm/gtc/matrix_transform.hpp>

#include "renderer/media/majorant_iterator.h"
#include "renderer/scene/colorimetry.h"
#include "renderer/scene/scene_error.h"
#include "tests/media/grids.h"

namespace woodcock {
namespace {

SparseGrid to_sparse(openvdb::FloatGrid& grid, const DMat4& medium_from_index = DMat4(1)) {
  const auto handle = nanovdb::openToNanoVDB(grid);
  SparseGrid sparse;
  sparse.bytes = handle.size();
  std::shared_ptr<std::byte[]> buffer(static_cast<std::byte*>(std::aligned_alloc(64, (handle.size() + 63) / 64 * 64)), std::free);
  std::memcpy(buffer.get(), handle.data(), handle.size());
  sparse.buffer = buffer;
  sparse.medium_from_index = medium_from_index;
  const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
  sparse.index_min = {box.min().x(), box.min().y(), box.min().z()};
  sparse.index_max = {box.max().x(), box.max().y(), box.max().z()};
  for (auto it = grid.cbeginValueOn(); it; ++it) sparse.maximum = std::max(sparse.maximum, it.getValue());
  return sparse;
}

/// Random blobs of voxels and, where asked for, active tiles of all levels.
openvdb::FloatGrid::Ptr random_tree(uint64_t seed, IVec3 offset, int extent, bool tiles) {
  openvdb::initialize();
  auto grid = openvdb::FloatGrid::create(0.0f);
  Stream random(seed);
  const auto coordinate = [&](int n) { return static_cast<int>(random.next_u32() % static_cast<uint32_t>(n)); };
  const openvdb::Coord o(offset.x, offset.y, offset.z);
  for (int blob = 0; blob < 6; ++blob) {
    const openvdb::Coord center = o + openvdb::Coord(coordinate(extent), coordinate(extent), coordinate(extent));
    for (int i = 0; i < 500; ++i)
      grid->tree().setValue(center + openvdb::Coord(coordinate(12), coordinate(12), coordinate(12)), random.uniform());
  }
  if (tiles) {
    grid->tree().addTile(1, o + openvdb::Coord(16, 0, 24), 0.75f, true);  // 8³
    grid->tree().addTile(2, o + openvdb::Coord(128, 0, 0), 0.5f, true);   // 128³
    grid->tree().addTile(2, o + openvdb::Coord(256, 0, 0), 0.5f, true);
  }
  return grid;
}

float nano_sample(const SparseGrid& grid, DVec3 index) {
  const auto* nano = reinterpret_cast<const nanovdb::FloatGrid*>(grid.buffer.get());
  const nanovdb::SampleFromVoxels<nanovdb::FloatTree, 1, false> sampler(nano->tree());
  return sampler(nanovdb::Vec3d(index.x, index.y, index.z));
}

bool in_box(const SparseGrid& grid, DVec3 index, double margin) {
  for (int i = 0; i < 3; ++i)
    if (!(index[i] >= grid.index_min[i] + margin && index[i] <= grid.index_max[i] + 1 - margin)) return false;
  return true;
}

/// Compares look-ups and bounds of a sparse medium with NanoVDB's sampler at random points and along random rays.
void expect_equal_to_nanovdb(const SparseGrid& grid, const DMat4& world_from_medium, const DMat4& render_from_world, uint64_t seed) {
  const Medium m = make_medium(grid_medium(grid, Rgb(0.25f), Rgb(0.75f)), world_from_medium, render_from_world);
  const DMat4 render_from_index = render_from_world * world_from_medium * grid.medium_from_index;
  Stream random(seed);
  const DVec3 extent = DVec3(grid.index_max - grid.index_min) + 4.0;
  const auto point = [&] { return DVec3(grid.index_min) - 2.0 + extent * DVec3(random.uniform(), random.uniform(), random.uniform()); };
  // Aims near voxels that are filled, so that sparse trees are met at all.
  const auto* nano = reinterpret_cast<const nanovdb::FloatGrid*>(grid.buffer.get());
  const auto filled_point = [&] {
    const auto* leaf = nano->tree().getFirstLeaf() + random.next_u32() % nano->tree().nodeCount(0);
    const nanovdb::Coord c = leaf->origin();
    return DVec3(c[0], c[1], c[2]) - 1.0 + 10.0 * DVec3(random.uniform(), random.uniform(), random.uniform());
  };
  int hits = 0;
  for (int i = 0; i < 20000; ++i) {
    const DVec3 index = i % 2 ? filled_point() : point();
    const Vec3 p{DVec3(render_from_index * glm::dvec4(index, 1))};
    if (in_box(grid, index, 1e-3)) {
      EXPECT_NEAR(m.density(p), nano_sample(grid, index), 2e-4);
      hits += m.density(p) > 0;
    } else if (!in_box(grid, index, -1e-3)) {
      EXPECT_EQ(m.density(p), 0);
    }
  }
  EXPECT_GT(hits, 1000);
  for (int i = 0; i < 500; ++i) {
    const Vec3 o{DVec3(render_from_index * glm::dvec4(point() + DVec3(random.uniform() - 0.5) * extent, 1))};
    const Vec3 target{DVec3(render_from_index * glm::dvec4(filled_point(), 1))};
    const Vec3 d = glm::normalize(target - o);
    MajorantIterator walk(m, {o, d}, kInf);
    double end = 0;
    while (const auto s = walk.next()) {
      ASSERT_GE(s->t0, end);
      for (int k = 0; k < 8; ++k) {
        const float sigma_t = m.grey_sigma_t(Ray{o, d}.at(s->t0 + (s->t1 - s->t0) * static_cast<double>(random.uniform())));
        ASSERT_LE(sigma_t, s->sigma);
        ASSERT_GE(sigma_t, s->lower);
      }
      // A gap is empty, up to the rounding of positions next to its ends.
      for (int k = 1; k < 8 && end < s->t0; ++k) ASSERT_LE(m.density(Ray{o, d}.at(end + (s->t0 - end) * k / 8)), 1e-5);
      end = s->t1;
    }
  }
}

TEST(SparseMedium, density_equals_nanovdb_and_bounds_hold) {
  expect_equal_to_nanovdb(to_sparse(*random_tree(1, {0, 0, 0}, 40, false)), DMat4(1), DMat4(1), 2);
}

TEST(SparseMedium, N55_negative_index_boxes_give_the_same_as_at_the_origin) {
  expect_equal_to_nanovdb(to_sparse(*random_tree(3, {-301, -77, -5}, 300, false)), DMat4(1), DMat4(1), 4);
}

TEST(SparseMedium, active_tiles_are_filled_with_their_value) {
  const SparseGrid grid = to_sparse(*random_tree(5, {0, -128, 128}, 40, true));
  expect_equal_to_nanovdb(grid, DMat4(1), DMat4(1), 6);
  const Medium m = make_medium(grid_medium(grid));
  EXPECT_EQ(m.density({250, -60, 200}), 0.5f);
  EXPECT_EQ(m.density({255.5f, -60, 200}), 0.5f);  // between two tiles
  EXPECT_EQ(m.density({20, -124, 156}), 0.75f);
}

TEST(SparseMedium, mean_extinction_is_the_average_over_the_box) {
  for (const bool tiles : {false, true}) {
    const SparseGrid grid = to_sparse(*random_tree(7, {-60, 10, 3}, 40, tiles));
    const Medium m = make_medium(grid_medium(grid, Rgb(1), Rgb(2)));
    // Between samples the interpolant is trilinear, whose average over a cell is that of its corners; the box consists of cells.
    double sum = 0;
    const IVec3 size = grid.index_max + 1 - grid.index_min;
    for (int z = 0; z <= size.z; ++z)
      for (int y = 0; y <= size.y; ++y)
        for (int x = 0; x <= size.x; ++x) {
          const IVec3 v(x, y, z);
          const double value = static_cast<double>(m.density(Vec3(grid.index_min + v)));
          double weight = 1;
          for (int i = 0; i < 3; ++i) weight *= v[i] == 0 || v[i] == size[i] ? 0.5 : 1.0;
          sum += weight * value;
        }
    const double volume = static_cast<double>(size.x) * size.y * size.z;
    EXPECT_NEAR(m.mean_sigma_t(), 3 * sum / volume, 1e-5 * m.mean_sigma_t());
  }
}

TEST(SparseMedium, bricks_inside_of_tiles_are_constant_and_those_at_the_ends_of_the_box_have_no_lower_bound) {
  openvdb::initialize();
  auto tree = openvdb::FloatGrid::create(0.5f);  // the background goes on beyond the box, where the medium is zero
  tree->tree().addTile(2, openvdb::Coord(0, 0, 0), 0.5f, true);
  for (const float sigma : {1e-4f, 1.0f}) {
    const Medium m = make_medium(grid_medium(to_sparse(*tree), Rgb(sigma), Rgb(sigma)));
    const MajorantGrid& grid = m.majorants();
    // Through the whole box: a first and a last brick that may round to outside, and constant ones in between.
    for (const DVec3 target : {DVec3(64.3, 60.1, 50.7), DVec3(3.1, 60, 50), DVec3(40, 1, 90)}) {
      const Vec3 o(-9, 70, 80);
      const Ray ray{o, glm::normalize(Vec3(target) - o)};
      MajorantIterator walk(m, ray, kInf);
      std::vector<MajorantSegment> segments;
      while (const auto s = walk.next()) segments.push_back(*s);
      ASSERT_FALSE(segments.empty());
      EXPECT_EQ(segments.front().lower, 0);
      EXPECT_EQ(segments.back().lower, 0);
      int constant = 0;
      for (const MajorantSegment& s : segments) {
        constant += s.lower == s.sigma;
        if (s.lower > 0) {
          EXPECT_EQ(s.lower, sigma);
          EXPECT_EQ(m.grey_sigma_t(ray.at(s.t0)), sigma);
          EXPECT_EQ(m.grey_sigma_t(ray.at(s.t1)), sigma);
        }
      }
      if (grid.edge() == 4) {
        EXPECT_GT(constant, 0);
      }
    }
  }
}

TEST(SparseMedium, N55_rotated_and_unevenly_scaled_maps_look_up_the_same_points) {
  DMat4 map = glm::translate(DMat4(1), DVec3(30, -2, 5));
  map = glm::rotate(map, 1.1, glm::normalize(DVec3(-1, 2, 0.5)));
  map = glm::scale(map, DVec3(0.1, -0.2, 0.05));
  expect_equal_to_nanovdb(to_sparse(*random_tree(7, {-20, 3, 9}, 60, false), map), glm::scale(DMat4(1), DVec3(2, 1, 1)),
                          glm::translate(DMat4(1), DVec3(-50, 0, 0)), 8);
}

TEST(SparseMedium, N66_a_grid_with_coordinates_of_1e5_is_as_good_as_at_the_origin) {
  const IVec3 offset(100000, -200000, 300000);
  expect_equal_to_nanovdb(to_sparse(*random_tree(9, offset, 60, false)), DMat4(1), glm::translate(DMat4(1), -DVec3(offset)), 10);
}

TEST(SparseMedium, ends_at_the_index_box_from_the_first_sample_to_one_past_the_last) {
  openvdb::initialize();
  auto grid = openvdb::FloatGrid::create(0.0f);
  grid->fill(openvdb::CoordBBox(openvdb::Coord(2), openvdb::Coord(9)), 1.0f);
  const Medium m = make_medium(grid_medium(to_sparse(*grid), Rgb(1), Rgb(0)));
  EXPECT_EQ(m.density({2, 5, 5}), 1);
  EXPECT_EQ(m.density({1.999f, 5, 5}), 0);
  EXPECT_EQ(m.density({9.5f, 5, 5}), 0.5f);
  EXPECT_EQ(m.density({9.75f, 5, 5}), 0.25f);
  EXPECT_EQ(m.density({10.001f, 5, 5}), 0);
  MajorantIterator walk(m, {{-1, 5, 5}, {1, 0, 0}}, kInf);
  auto s = walk.next();
  ASSERT_TRUE(s);
  EXPECT_EQ(s->t0, 3);
  float end = s->t1;
  while ((s = walk.next())) end = s->t1;
  EXPECT_EQ(end, 11);
}

TEST(SparseMedium, a_temperature_with_a_larger_box_moves_the_ends_of_the_medium_as_in_pbrt) {
  openvdb::initialize();
  auto density = openvdb::FloatGrid::create(0.0f), temperature = openvdb::FloatGrid::create(0.0f);
  density->fill(openvdb::CoordBBox(openvdb::Coord(2), openvdb::Coord(9)), 1.0f);
  temperature->fill(openvdb::CoordBBox(openvdb::Coord(0, 2, 2), openvdb::Coord(12, 9, 9)), 3000.0f);
  GridMediumDescription d = grid_medium(to_sparse(*density), Rgb(1), Rgb(0));
  d.emission = Rgb(1);
  d.temperature_cutoff = 100;
  d.temperature = std::make_shared<const FloatVolume>(to_sparse(*temperature));
  const Medium m = make_medium(d);
  EXPECT_EQ(m.density({1.5f, 5, 5}), 0.5f);  // along x the temperature's box is larger
  EXPECT_EQ(m.density({0.5f, 5, 5}), 0);
  EXPECT_EQ(m.density({5, 1.5f, 5}), 0);  // along y both begin at 2
  EXPECT_TRUE(m.emits());
  const Rgb want = blackbody_emission(3000);
  EXPECT_NEAR(m.at({5, 5, 5}).emission.x, want.x, 1e-5 * want.x);
  EXPECT_NEAR(m.at({1.5f, 5, 5}).emission.x, 0.5 * want.x, 1e-5 * want.x);
}

TEST(SparseMedium, N09_a_tree_without_active_voxels_is_vacuum) {
  openvdb::initialize();
  auto grid = openvdb::FloatGrid::create(0.0f);
  const Medium m = make_medium(grid_medium(to_sparse(*grid)));
  EXPECT_FALSE(m.attenuates());
  EXPECT_EQ(m.density(Vec3(0)), 0);
  EXPECT_FALSE(MajorantIterator(m, {{-1, 0, 0}, {1, 0, 0}}, kInf).next());
}

TEST(SparseMedium, values_without_meaning_are_reported_or_refused) {
  openvdb::initialize();
  auto grid = openvdb::FloatGrid::create(0.0f);
  grid->tree().setValue(openvdb::Coord(1, 2, 3), -1.0f);
  grid->tree().setValue(openvdb::Coord(7, 8, 9), 1.0f);
  std::vector<std::string> notes;
  const Medium m(describe(grid_medium(to_sparse(*grid))), DMat4(1), 1, notes);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(m.density({1, 2, 3}), 0);
  EXPECT_EQ(m.density({7, 8, 9}), 1);
  grid->tree().setValue(openvdb::Coord(1, 2, 3), kInf);
  EXPECT_THROW(make_medium(grid_medium(to_sparse(*grid))), SceneError);
}

TEST(SparseMedium, a_huge_tile_takes_little_memory_and_a_box_beyond_the_table_is_refused) {
  openvdb::initialize();
  auto grid = openvdb::FloatGrid::create(0.0f);
  grid->tree().addTile(3, openvdb::Coord(0, 0, 0), 0.5f, true);  // 4096³
  const SparseField field(to_sparse(*grid), DMat4(1));
  EXPECT_LT(field.bytes(), size_t{80} << 20);
  EXPECT_EQ(field.at({2000, 3000, 4000}), 0.5f);
  grid->tree().setValue(openvdb::Coord(1 << 22, 1 << 22, 1 << 22), 1.0f);
  EXPECT_THROW(make_medium(grid_medium(to_sparse(*grid))), SceneError);
}

}  // namespace
}  // namespace woodcock
