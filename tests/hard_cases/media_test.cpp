// Volumes as a scene file gives them: what is refused, where a grid lies, what a ray meets in it.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <cmath>
#include <sstream>

#include "renderer/media/majorant_iterator.h"
#include "renderer/media/medium.h"
#include "renderer/transport/tentative_collisions.h"
#include "renderer/transport/transmittance.h"
#include "renderer/world/world.h"
#include "tests/media/grids.h"
#include "tests/scene/scene_folder.h"
#include "tests/support/optical_depth.h"

namespace woodcock::testing {
namespace {

using ::testing::HasSubstr;

/// A scene that looks along −z from (0, 0, 50) at what stands in the world.
std::string looking_at(const std::string& world) { return "LookAt 0 0 50 0 0 0 0 1 0\nCamera \"perspective\"\nWorldBegin\n" + world; }

/// The values of a grid of n³ voxels, x fastest.
std::string values(int n, const std::function<double(IVec3)>& value) {
  std::string text;
  for (int z = 0; z < n; ++z)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) text += fmt::format(" {:.9g}", value({x, y, z}));
  return text;
}
std::string uniform_grid(int n, DVec3 p0, DVec3 p1, const std::string& density, const std::string& more = "") {
  return fmt::format(
             "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" {0} \"integer ny\" {0} \"integer nz\" {0} \"point3 p0\" "
             "[ "
             "{1:.17g} {2:.17g} {3:.17g} ] \"point3 p1\" [ {4:.17g} {5:.17g} {6:.17g} ] ",
             n, p0.x, p0.y, p0.z, p1.x, p1.y, p1.z) +
         (more.empty() ? "\"rgb sigma_a\" [ 1 1 1 ] \"rgb sigma_s\" [ 0 0 0 ]" : more) + " \"float density\" [" + density + " ]\n";
}

/// The optical depth of medium 0 of a scene along a world-space segment, exactly (tests/support/optical_depth.h).
double depth_between(const World& world, DVec3 from, DVec3 to) {
  const auto render = [&](DVec3 p) { return world.space.scale * (p - world.space.center); };
  const DVec3 d = render(to) - render(from);
  const double length = glm::length(d);
  return optical_depth_exact(world.media[0], {Vec3(render(from)), Vec3(d / length)}, 0, length).x;
}

/// Mean of ratio tracking along the same segment.
double mean_transmittance(const World& world, DVec3 from, DVec3 to, int samples) {
  const auto render = [&](DVec3 p) { return world.space.scale * (p - world.space.center); };
  const DVec3 d = render(to) - render(from);
  const double length = glm::length(d);
  PathCounters counters;
  double sum = 0;
  for (int i = 0; i < samples; ++i) {
    Stream random = stream(PathKey{static_cast<uint64_t>(i)}, 0, Purpose::kTransmittance);
    sum += static_cast<double>(
        estimate_transmittance(world.media[0], {Vec3(render(from)), Vec3(d / length)}, static_cast<float>(length), random, counters).x);
  }
  EXPECT_EQ(counters.majorant_violations, 0u);
  return sum / samples;
}

std::string error_of_scene(const std::string& text) {
  const SceneFolder folder;
  try {
    build_world(folder.read(text));
  } catch (const SceneError& error) {
    return error.what();
  }
  return "no error";
}

// Bricks of a sparse grid along axes and diagonals, from corners, edges and faces of bricks: every segment carries the bound of
// what lies in it, what lies in no segment is empty, and the optical depth within the segments is all there is.
TEST(HardCases, N10_rays_along_axes_and_diagonals_meet_every_brick) {
  const SceneFolder folder;
  Stream random(5);
  const auto density = [&](IVec3 v) {
    return (v.x / 4 + v.y / 4 + v.z / 4) % 2 == 0 || random.uniform() < 0.9f ? 0 : random.uniform_double();
  };
  const auto world = build_world(folder.read(looking_at(uniform_grid(16, DVec3(-8), DVec3(8), values(16, density)))));
  const Medium& medium = world->media[0];
  const double scale = world->space.scale;
  int segments = 0;
  for (const DVec3 d :
       {DVec3(1, 0, 0), DVec3(0, 1, 0), DVec3(0, 0, 1), DVec3(-1, 0, 0), DVec3(1, 1, 0), DVec3(0, 1, -1), DVec3(1, 1, 1), DVec3(-1, 1, -1)})
    for (const DVec3 through : {DVec3(0), DVec3(4, -4, 0), DVec3(0.5), DVec3(-4), DVec3(0.25, 4, -4), DVec3(3.5, 3.5, 7.5)}) {
      const DVec3 from = through - 20.0 * d;
      const Ray ray{Vec3(scale * (from - world->space.center)), Vec3(glm::normalize(d))};
      const float length = static_cast<float>(40 * glm::length(d) * scale);
      MajorantIterator walk(medium, ray, length);
      double depth = 0;
      float end = 0;
      const auto expect_empty = [&](float t0, float t1) {
        for (int k = 1; k < 16 && t0 < t1; ++k) EXPECT_LE(medium.density(ray.at(t0 + (t1 - t0) * static_cast<float>(k) / 16)), 1e-6f);
      };
      while (const auto s = walk.next()) {
        ++segments;
        for (int k = 1; k < 16; ++k) EXPECT_LE(medium.sigma_t(ray.at(s->t0 + (s->t1 - s->t0) * static_cast<float>(k) / 16)).x, s->sigma);
        expect_empty(end, s->t0);
        depth += optical_depth_exact(medium, ray, static_cast<double>(s->t0), static_cast<double>(s->t1)).x;
        end = s->t1;
      }
      expect_empty(end, length);
      EXPECT_NEAR(depth, optical_depth_exact(medium, ray, 0, static_cast<double>(length)).x, 1e-5)
          << "direction " << d.x << d.y << d.z << " through " << through.x << ' ' << through.y << ' ' << through.z;
    }
  EXPECT_GT(segments, 100);
}

TEST(HardCases, N11_rays_in_the_faces_of_a_grid_are_inside_whatever_the_sign_of_zero) {
  const SceneFolder folder;
  const auto world = build_world(folder.read(looking_at(uniform_grid(8, DVec3(-4), DVec3(4), values(8, [](IVec3) { return 1.0; })))));
  const Medium& medium = world->media[0];
  const auto scale = static_cast<float>(world->space.scale);
  for (const float zero : {0.0f, -0.0f})
    for (const float face : {-4.0f, 4.0f, 0.0f, -0.0f})
      for (int axis = 0; axis < 3; ++axis) {
        // At the faces the density is ½ in each of the two axes across, on the planes within it is 1.
        Vec3 o(face * scale), d(zero);
        o[axis] = -10 * scale;
        d[axis] = 1;
        o -= Vec3(world->space.center * world->space.scale);
        MajorantIterator walk(medium, {o, d}, kInf);
        float length = 0;
        while (const auto s = walk.next()) length += s->t1 - s->t0;
        EXPECT_NEAR(length, 8 * scale, 1e-5f * scale) << face << " axis " << axis << " zero " << std::signbit(zero);
      }
}

TEST(HardCases, N39_densities_without_meaning_are_refused_with_their_place) {
  const auto grid = [](const char* density) { return looking_at(uniform_grid(2, DVec3(0), DVec3(1), density)); };
  for (const char* bad : {"1 2 3 1e300 5 6 7 8", "1 2 3 -1e300 5 6 7 8"}) {
    EXPECT_THAT(error_of_scene(grid(bad)), HasSubstr("main.pbrt:4:")) << bad;
    EXPECT_THAT(error_of_scene(grid(bad)), HasSubstr("voxel (1, 1, 0)")) << bad;
  }
  EXPECT_THAT(error_of_scene(grid("1 2 3 nan 5 6 7 8")), HasSubstr("main.pbrt:4:"));
  const std::string medium = "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" ";
  for (const char* bad : {"\"rgb sigma_a\" [ -1 0 0 ]", "\"rgb sigma_s\" [ 0 1e300 0 ]", "\"float scale\" -1", "\"rgb Le\" [ 0 0 -2 ]"})
    EXPECT_THAT(error_of_scene(looking_at(medium + bad + "\n")), HasSubstr("main.pbrt:4:")) << bad;
  // Negative densities, which filters leave behind, are zero, and said to be.
  std::vector<std::string> notes;
  ReadOptions options;
  options.warn = [&](const std::string& note) { notes.push_back(note); };
  const SceneFolder folder;
  const auto world = build_world(folder.read(grid("1 1 1 -3 1 1 -0.5 1"), options));
  ASSERT_FALSE(notes.empty());
  EXPECT_THAT(notes[0], HasSubstr("2 negative"));
  EXPECT_LT(depth_between(*world, {0.75, 0.75, -1}, {0.75, 0.75, 2}), 1);
}

// Densities down to the smallest numbers of a float, and a whole medium of them.
TEST(HardCases, N39_tiny_densities_end_every_ray) {
  for (const double tiny : {1e-30, 1e-38, 1e-42, 1e-45}) {
    const SceneFolder folder;
    const auto world = build_world(folder.read(looking_at(uniform_grid(4, DVec3(-1), DVec3(1), values(4, [&](IVec3) { return tiny; })))));
    EXPECT_EQ(mean_transmittance(*world, {0, 0, 5}, {0.1, 0.2, -5}, 100), 1) << tiny;
  }
}

// Where a brick's bound is its density, a fictitious collision has no probability: of a million tentative ones in a constant
// grid every one finds σn within the bound's allowance of 2⁻²⁰, never below zero.
TEST(HardCases, N54_a_density_that_equals_its_bound_leaves_no_negative_null_density) {
  for (const float sigma : {0.1f, 0.3f, 1.0f, 7.3f}) {
    const Medium medium =
        make_medium(grid_medium(make_dense(IVec3(8), DVec3(0), DVec3(8), [](IVec3) { return 0.7f; }), Rgb(0), Rgb(sigma)));
    Stream random(1);
    int collisions = 0;
    for (int i = 0; i < 20000; ++i) {
      const Vec3 o = Vec3(0.5f) + 7.0f * Vec3(random.uniform(), random.uniform(), random.uniform());
      const Ray ray{o, square_to_sphere(random.uniform2())};
      TentativeCollisions walk(medium, ray, 3, random);
      while (walk.next()) {
        ++collisions;
        const float sigma_n = walk.majorant() - medium.sigma_t(ray.at(walk.t())).x;
        ASSERT_GE(sigma_n, 0);
        // Within the outer half voxel the density fades.
        const Vec3 p = ray.at(walk.t());
        if (p.x > 0.5f && p.y > 0.5f && p.z > 0.5f && p.x < 7.5f && p.y < 7.5f && p.z < 7.5f) {
          ASSERT_LE(sigma_n, 2e-6f * walk.majorant());
        }
      }
    }
    EXPECT_GT(collisions, 1000);
  }
}

/// The same grid at the origin and under a transform: depths along segments that the transform takes along.
void expect_same_depths(const std::string& plain, const std::string& transform, const DMat4& matrix, double scale_of_depth) {
  const SceneFolder folder;
  const auto a = build_world(folder.read(looking_at(plain)));
  const auto b = build_world(folder.read(looking_at(transform + plain)));
  Stream random(9);
  int met = 0;
  for (int i = 0; i < 300; ++i) {
    const auto point = [&] { return 12.0 * DVec3(random.uniform_double(), random.uniform_double(), random.uniform_double()) - 6.0; };
    const DVec3 from = point(), to = point();
    const auto moved = [&](DVec3 p) { return DVec3(matrix * glm::dvec4(p, 1)); };
    const double stretch = glm::length(moved(to) - moved(from)) / glm::length(to - from);
    const double expected = depth_between(*a, from, to), got = depth_between(*b, moved(from), moved(to));
    met += expected > 0.1;
    EXPECT_NEAR(got, expected * stretch * scale_of_depth, 2e-4 * (1 + expected * stretch)) << i;
  }
  EXPECT_GT(met, 50);
}

TEST(HardCases, N55_a_grid_under_any_transform_is_the_grid) {
  Stream random(3);
  const std::string grid = uniform_grid(6, DVec3(-3, -4, -2), DVec3(3, 2, 5), values(6, [&](IVec3) { return random.uniform_double(); }));
  DMat4 m(1);
  expect_same_depths(grid, "", m, 1);
  m[3] = {10, -20, 5, 1};
  expect_same_depths(grid, "Translate 10 -20 5\n", m, 1);
  // Columns of the matrix: rotated by 90° about z and scaled unevenly, one axis mirrored.
  DMat4 uneven(0);
  uneven[0] = {0, 0.5, 0, 0};
  uneven[1] = {3, 0, 0, 0};
  uneven[2] = {0, 0, -1.5, 0};
  uneven[3] = {1, 2, 3, 1};
  expect_same_depths(grid, "Transform [ 0 .5 0 0  3 0 0 0  0 0 -1.5 0  1 2 3 1 ]\n", uneven, 1);
}

TEST(HardCases, N65_mean_cosines_beyond_0_9999_are_an_error_at_load) {
  const std::string medium = "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"float g\" ";
  for (const char* g : {"0.9999", "-0.9999"}) EXPECT_EQ(error_of_scene(looking_at(medium + g + "\n")), "no error") << g;
  for (const char* g : {"0.99991", "-0.99991", "1", "-1", "1.5"}) {
    EXPECT_THAT(error_of_scene(looking_at(medium + g + "\n")), HasSubstr("main.pbrt:4:")) << g;
    EXPECT_THAT(error_of_scene(looking_at(medium + g + "\n")), HasSubstr("0.9999")) << g;
  }
  // What was read is what is used: no smaller bound hides behind the reader's.
  const SceneFolder folder;
  const auto world = build_world(folder.read(looking_at(medium + "0.9999\n" + "Shape \"sphere\"\n")));
  const Rgb forward = world->media[0].phase_at(Vec3(0)).eval({0, 0, 1}, {0, 0, -1});
  EXPECT_NEAR(forward.x / (1.9999 / (4 * M_PI * 1e-8)), 1, 1e-3);
}

TEST(HardCases, N66_a_grid_with_coordinates_of_1e5_is_the_grid) {
  // Tenths have an error of 0.004 in float at 1e5, which moves the grid by that unless it is taken relative to its own corner.
  Stream random(4);
  std::vector<double> density;
  for (int i = 0; i < 216; ++i) density.push_back(random.uniform_double());
  const auto text = [&](DVec3 shift) {
    size_t i = 0;
    return uniform_grid(6, DVec3(-3) + shift, DVec3(3) + shift, values(6, [&](IVec3) { return density[i++]; }));
  };
  const DVec3 shift(100000.3, -200000.7, 300000.1);
  const SceneFolder folder;
  const auto a = build_world(folder.read(looking_at(text(DVec3(0)))));
  const auto b = build_world(
      folder.read(fmt::format("LookAt {0:.17g} {1:.17g} {2:.17g} {0:.17g} {1:.17g} {3:.17g} 0 1 0\nCamera \"perspective\"\nWorldBegin\n",
                              shift.x, shift.y, shift.z + 50, shift.z) +
                  text(shift)));
  for (int i = 0; i < 300; ++i) {
    const auto point = [&] { return 10.0 * DVec3(random.uniform_double(), random.uniform_double(), random.uniform_double()) - 5.0; };
    const DVec3 from = point(), to = point();
    // Points are floats some 50 units from the middle of render space: half a unit in the last place is 2e-6, at each of many.
    EXPECT_NEAR(depth_between(*b, from + shift, to + shift), depth_between(*a, from, to), 1e-4) << i;
  }
}

/// A .vdb of one grid with a transform of voxel size `size` and the sample of index 0 at `origin`.
std::string vdb_file(const openvdb::FloatGrid::Ptr& grid, double size, DVec3 origin) {
  grid->setName("density");
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  auto transform = openvdb::math::Transform::createLinearTransform(size);
  transform->postTranslate(openvdb::Vec3d(origin.x, origin.y, origin.z));
  grid->setTransform(transform);
  openvdb::GridCPtrVec grids{grid};
  std::ostringstream stream(std::ios::binary);
  openvdb::io::Stream(stream).write(grids);
  return stream.str();
}
constexpr const char* kVdb =
    "MakeNamedMedium \"m\" \"string type\" \"openvdb\" \"string filename\" \"v.vdb\" \"rgb sigma_a\" [ 1 1 1 ] \"rgb sigma_s\" [ 0 0 0 ]\n";

TEST(HardCases, N67_active_tiles_half_voxels_and_negative_corners_of_a_vdb_have_their_optical_depth) {
  openvdb::initialize();
  // A block −16 … 15 in each index, most of it constant active tiles, and one voxel that differs.
  const auto grid = openvdb::FloatGrid::create(0.0f);
  grid->fill(openvdb::CoordBBox(openvdb::Coord(-16), openvdb::Coord(15)), 0.5f);
  EXPECT_GT(grid->tree().activeTileCount(), 0u);
  grid->tree().setValue(openvdb::Coord(-5, 6, -7), 2.5f);
  const double size = 0.25;
  for (const DVec3 origin : {DVec3(0), DVec3(0.125), DVec3(-3, 2, 0.0625)}) {
    const SceneFolder folder;
    folder.write("v.vdb", vdb_file(grid, size, origin));
    const auto world = build_world(folder.read(looking_at(kVdb)));
    const auto place = [&](DVec3 index) { return origin + size * index; };
    // Through the block from one side to the other, away from the odd voxel: the medium begins at the first sample with its
    // full value and ends one voxel behind the last, where the interpolant has come to zero.
    EXPECT_NEAR(depth_between(*world, place({2, 3, -40}), place({2, 3, 40})), 0.5 * size * 31.5, 1e-4);
    EXPECT_NEAR(depth_between(*world, place({-40, 3, 4}), place({40, 3, 4})), 0.5 * size * 31.5, 1e-4);
    // Through the odd voxel: 2 more, times a tent of integral 1.
    EXPECT_NEAR(depth_between(*world, place({-5, 6, -40}), place({-5, 6, 40})), size * (0.5 * 31.5 + 2), 1e-4);
    // Half a voxel beside it a half of that.
    EXPECT_NEAR(depth_between(*world, place({-5.5, 6, -40}), place({-5.5, 6, 40})), size * (0.5 * 31.5 + 1), 1e-4);
    // Outside of the block, by less than a voxel before its first sample.
    EXPECT_EQ(depth_between(*world, place({-16.5, 3, -40}), place({-16.5, 3, 40})), 0);
    EXPECT_NEAR(depth_between(*world, place({15.5, 3, -40}), place({15.5, 3, 40})), 0.25 * size * 31.5, 1e-4);
    const double expected = std::exp(-depth_between(*world, place({-40, 6, -7}), place({40, 6, -7})));
    EXPECT_NEAR(mean_transmittance(*world, place({-40, 6, -7}), place({40, 6, -7}), 20000), expected, 2.5 / std::sqrt(20000.0));
  }
}

// The index box of a tree may lie anywhere: the same blobs at negative indices, moved back by the transform.
TEST(HardCases, N55_a_vdb_with_a_negative_index_box_is_the_one_at_the_origin) {
  openvdb::initialize();
  const auto blobs = [](IVec3 shift) {
    const auto grid = openvdb::FloatGrid::create(0.0f);
    Stream random(8);
    for (int i = 0; i < 3000; ++i) {
      const auto n = [&] { return static_cast<int>(random.next_u32() % 24); };
      const int x = n(), y = n(), z = n();
      grid->tree().setValue(openvdb::Coord(x + shift.x, y + shift.y, z + shift.z), random.uniform());
    }
    return grid;
  };
  const IVec3 shift(-301, -77, -5);
  const SceneFolder folder;
  folder.write("v.vdb", vdb_file(blobs(IVec3(0)), 0.25, DVec3(0)));
  const auto at_origin = build_world(folder.read(looking_at(kVdb)));
  folder.write("v.vdb", vdb_file(blobs(shift), 0.25, -0.25 * DVec3(shift)));
  const auto negative = build_world(folder.read(looking_at(kVdb)));
  Stream random(9);
  double sum = 0;
  for (int i = 0; i < 300; ++i) {
    const auto point = [&] { return 8.0 * DVec3(random.uniform_double(), random.uniform_double(), random.uniform_double()) - 1.0; };
    const DVec3 from = point(), to = point();
    const double expected = depth_between(*at_origin, from, to);
    sum += expected;
    EXPECT_NEAR(depth_between(*negative, from, to), expected, 1e-4) << i;
  }
  EXPECT_GT(sum, 30);
}

}  // namespace
}  // namespace woodcock::testing
