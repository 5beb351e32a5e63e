// Random numbers and what is made of them at the ends of their range.
#include <gtest/gtest.h>

#include <set>

#include "renderer/core/frame.h"
#include "renderer/core/random.h"
#include "renderer/core/warp.h"
#include "renderer/media/phase.h"
#include "renderer/transport/transmittance.h"
#include "renderer/world/camera.h"
#include "tests/hard_cases/crafted_stream.h"
#include "tests/materials/bsdf_cases.h"
#include "tests/support/chi_square.h"

namespace woodcock::testing {
namespace {

TEST(HardCases, N05_no_random_number_is_one_and_no_distance_is_infinite) {
  constexpr uint64_t kOnes = ~uint64_t{0};
  EXPECT_EQ(stream_with_next(kOnes).next_u64(), kOnes);
  EXPECT_EQ(stream_with_next(kOnes).uniform(), kOneMinusEpsilon);
  EXPECT_LT(stream_with_next(kOnes).uniform_double(), 1);
  EXPECT_LT(stream_with_next(kOnes).uniform2().x, 1);
  EXPECT_LT(stream_with_next(kOnes).uniform2().y, 1);
  EXPECT_NEAR(stream_with_next(kOnes).exponential(), 53 * std::log(2.0), 1e-5);
  EXPECT_EQ(stream_with_next(0).uniform(), 0);
  EXPECT_EQ(stream_with_next(0).exponential(), 0);
  EXPECT_FALSE(std::signbit(stream_with_next(0).exponential()));
  // No extinction: whatever is drawn, there is no collision, on a way without end too.
  EXPECT_EQ(attenuation({0, 1, 0}, static_cast<double>(kInf)), Rgb(1, 0, 1));
}

/// Every pair of the ends and the middle of [0, 1).
std::vector<Vec2> corners() {
  std::vector<Vec2> result;
  for (const float x : {0.0f, 0x1p-24f, 0.5f, 1 - 0x1p-23f, kOneMinusEpsilon})
    for (const float y : {0.0f, 0x1p-24f, 0.25f, 0.5f, kOneMinusEpsilon}) result.push_back({x, y});
  return result;
}

TEST(HardCases, N35_samples_at_the_ends_of_the_random_numbers_have_a_density_or_are_none) {
  int samples = 0;
  for (const BsdfCase& c : bsdf_cases())
    for (const Vec3 wo : outgoing_directions())
      for (const Vec2 u : corners()) {
        // The number is the first that the model draws, or the second where it chooses a lobe before.
        Stream first = stream_with_next(bits_of(u)), layered(1);
        Stream second = Stream(unmix64(bits_of(u)) - 2 * 0x9e3779b97f4a7c15ULL);
        for (Stream* direction : {&first, &second}) {
          const std::optional<BsdfSample> s = sample(c.bsdf, wo, *direction, layered);
          if (!s) continue;
          ++samples;
          EXPECT_TRUE(s->specular || s->pdf > 0) << c.name << " u " << u.x << ' ' << u.y;
          EXPECT_TRUE(is_finite(s->wi) && is_finite(s->weight) && std::isfinite(s->pdf)) << c.name << " u " << u.x << ' ' << u.y;
          EXPECT_NEAR(glm::length(s->wi), 1, 1e-5) << c.name;
        }
      }
  EXPECT_GT(samples, 5000);
  // The horizon: the cosine there is zero, and so is the density.
  Stream horizon = stream_with_next(bits_of({0, 0.5f}));
  EXPECT_EQ(square_to_cosine_hemisphere({0, 0.5f}).z, 0);
  EXPECT_FALSE(sample(DiffuseBsdf{Rgb(1)}, {0, 0, 1}, horizon));
  for (const float g : {-0.999f, -0.3f, 0.0f, 0.3f, 0.999f})
    for (const Vec2 u : corners()) {
      const auto s = HenyeyGreenstein{g}.sample({0, 0, 1}, u);
      EXPECT_TRUE(is_finite(s.wi) && s.pdf > 0 && std::isfinite(s.pdf)) << g << " u " << u.x << ' ' << u.y;
    }
  for (const Vec2 u : corners())
    for (const Vec3 w : {square_to_cosine_hemisphere(u), square_to_hemisphere(u), square_to_sphere(u)})
      EXPECT_TRUE(is_finite(w) && std::abs(glm::length(w) - 1) < 1e-6f) << u.x << ' ' << u.y;
}

// χ² of the warps of renderer/core, which every other sampler is built on. False alarms: 1e-6 a warp.
TEST(HardCases, N34_warps_have_the_density_they_tell) {
  const auto expect = [](const char* name, Vec3 (*warp)(Vec2), auto&& density) {
    Stream random(21);
    const auto result = chi_square_sphere([&] { return std::optional(warp(random.uniform2())); }, density);
    EXPECT_GT(result.p_value, 1e-6) << name << ": " << result.describe();
    EXPECT_NEAR(result.total, 1, 1e-4) << name;
  };
  expect("cosine hemisphere", square_to_cosine_hemisphere, square_to_cosine_hemisphere_pdf);
  expect("hemisphere", square_to_hemisphere, [](Vec3 w) { return w.z > 0 ? square_to_hemisphere_pdf() : 0.0f; });
  expect("sphere", square_to_sphere, [](Vec3) { return square_to_sphere_pdf(); });
  // The disk as the hemisphere above it: a density of 1/π over the disk is cos θ/π over directions.
  expect(
      "disk",
      [](Vec2 u) {
        const Vec2 d = square_to_disk(u);
        return Vec3(d, std::sqrt(std::fmax(0.0f, 1 - d.x * d.x - d.y * d.y)));
      },
      [](Vec3 w) { return std::fmax(w.z, 0.0f) * square_to_disk_pdf(); });
}

/// Numeric |∂(warp)/∂(u, v)| · density at random points: 1 for a map whose density is the reciprocal of its Jacobian.
template <typename Warp, typename Density>
void expect_reciprocal_jacobian(const char* name, Warp&& warp, Density&& density) {
  Stream random(22);
  constexpr float kStep = 1e-3f;
  for (int i = 0; i < 300; ++i) {
    const Vec2 u = Vec2(0.05f) + 0.9f * random.uniform2();
    // Central differences; points next to a seam of the map say nothing.
    if (std::abs(u.x - u.y) < 0.01f || std::abs(u.x + u.y - 1) < 0.01f || std::abs(u.x - 0.5f) < 0.01f || std::abs(u.y - 0.5f) < 0.01f)
      continue;
    const DVec3 du = DVec3(warp(u + Vec2(kStep, 0))) - DVec3(warp(u - Vec2(kStep, 0)));
    const DVec3 dv = DVec3(warp(u + Vec2(0, kStep))) - DVec3(warp(u - Vec2(0, kStep)));
    const double jacobian = glm::length(glm::cross(du, dv)) / (4 * static_cast<double>(kStep) * static_cast<double>(kStep));
    EXPECT_NEAR(jacobian * static_cast<double>(density(warp(u))), 1, 0.01) << name << " at " << u.x << ' ' << u.y;
  }
}

TEST(HardCases, N34_densities_are_the_reciprocal_of_the_jacobian) {
  expect_reciprocal_jacobian("cosine hemisphere", square_to_cosine_hemisphere, square_to_cosine_hemisphere_pdf);
  expect_reciprocal_jacobian("hemisphere", square_to_hemisphere, [](Vec3) { return square_to_hemisphere_pdf(); });
  expect_reciprocal_jacobian("sphere", square_to_sphere, [](Vec3) { return square_to_sphere_pdf(); });
  expect_reciprocal_jacobian(
      "disk", [](Vec2 u) { return Vec3(square_to_disk(u), 0); }, [](Vec3) { return square_to_disk_pdf(); });
  // The triangle with corners 0, e1, e2 has the area 1/2.
  expect_reciprocal_jacobian(
      "triangle", [](Vec2 u) { return Vec3(square_to_triangle(u), 0); }, [](Vec3) { return 2.0f; });
  for (const float g : {-0.7f, 0.0f, 0.5f})
    expect_reciprocal_jacobian(
        "Henyey-Greenstein",
        [&](Vec2 u) {
          return HenyeyGreenstein{g}.sample({0, 0.6f, 0.8f}, u).wi;
        },
        [&](Vec3 w) {
          return HenyeyGreenstein{g}.eval({0, 0.6f, 0.8f}, w);
        });
}

// Samples of the lens are points of a disk of area πR²: their density is constant, so that each of 8 × 8 cells equal in area
// holds its share. χ² with 63 degrees of freedom; false alarm 1e-6.
TEST(HardCases, N34_the_lens_is_sampled_evenly) {
  CameraDescription description;
  description.lens_radius = 0.25;
  description.focal_distance = 3;
  const Camera camera(description, FilmDescription{}, DMat4(1), 1);
  std::vector<double> count(64);
  Stream random(23);
  constexpr int kRays = 100000;
  for (int i = 0; i < kRays; ++i) {
    const Vec3 o = camera.ray({10, 20}, random.uniform2(), 0).o;
    const double r2 = static_cast<double>(o.x * o.x + o.y * o.y) / (0.25 * 0.25), phi = std::atan2(o.y, o.x) + M_PI;
    ++count[std::min<size_t>(7, static_cast<size_t>(8 * r2)) * 8 + std::min<size_t>(7, static_cast<size_t>(8 * phi / (2 * M_PI)))];
  }
  double statistic = 0;
  for (const double c : count) statistic += (c - kRays / 64.0) * (c - kRays / 64.0) / (kRays / 64.0);
  EXPECT_GT(chi_square_p_value(statistic, 63), 1e-6) << statistic;
}

TEST(HardCases, N46_sample_indices_and_vertices_beyond_32_bits_are_numbers_of_their_own) {
  std::set<uint64_t> keys;
  const uint64_t seed = frame_seed(1, 0);
  int count = 0;
  // Samples at distances where a counter of 32 bits, or one of 2³⁰ points a sequence, comes round again.
  for (const uint64_t base : {uint64_t{0}, uint64_t{1} << 30, uint64_t{1} << 32, uint64_t{1} << 33, uint64_t{1} << 48, uint64_t{1} << 61})
    for (uint64_t i = 0; i < 1000; ++i, ++count) keys.insert(path_key(seed, 3, 5, base + i).key);
  EXPECT_EQ(keys.size(), static_cast<size_t>(count));
  // A path of a million vertices has numbers of its own at every one, and all in [0, 1).
  std::set<uint64_t> firsts;
  double sum = 0;
  for (uint32_t vertex = 0; vertex < 1000000; ++vertex) {
    Stream s = stream(PathKey{12345}, vertex, Purpose::kDirection);
    firsts.insert(Stream(s).next_u64());
    const float u = s.uniform();
    ASSERT_TRUE(u >= 0 && u < 1);
    sum += static_cast<double>(u);
  }
  EXPECT_EQ(firsts.size(), 1000000u);
  EXPECT_NEAR(sum / 1e6, 0.5, 5 / std::sqrt(12e6));
}

// A sequence of low discrepancy has 2³² points; behind them a new one begins, and no point lies outside of [0, 1).
TEST(HardCases, N46_low_discrepancy_numbers_go_on_beyond_the_end_of_a_sequence) {
  const uint64_t seed = frame_seed(1, 0);
  std::set<std::pair<float, float>> points;
  int count = 0;
  // A replicate's place in its sequence is the sample index over their number: its ends and the middle, and beyond.
  for (const uint64_t place :
       {uint64_t{0}, uint64_t{1} << 30, (uint64_t{1} << 32) - 500, uint64_t{1} << 32, uint64_t{1} << 33, uint64_t{1} << 55})
    for (uint64_t i = 0; i < 1000; ++i, ++count) {
      const PathKey key = path_key(seed, 3, 5, (place + i) * kReplicates, 0, true);
      const Vec2 u = stream(key, 0, Purpose::kLens).uniform2();
      ASSERT_TRUE(u.x >= 0 && u.x < 1 && u.y >= 0 && u.y < 1) << place + i;
      points.insert({u.x, u.y});
    }
  // The first 500 points behind 2³² − 500 and those from 2³² on overlap by 500; what else is equal is chance, one in 2⁴⁸.
  EXPECT_EQ(points.size(), static_cast<size_t>(count - 500));
  // Vertices that have no such numbers any more have independent ones.
  Stream late = stream(path_key(seed, 3, 5, 8, 0, true), 1000000, Purpose::kDirection);
  EXPECT_EQ(late.next_u64(), stream(path_key(seed, 3, 5, 8), 1000000, Purpose::kDirection).next_u64());
}

TEST(HardCases, N48_frames_exist_for_every_axis_and_both_zeros) {
  std::vector<Vec3> normals;
  for (const float a : {1.0f, -1.0f})
    for (const float zero : {0.0f, -0.0f}) {
      normals.push_back({a, zero, zero});
      normals.push_back({zero, a, zero});
      normals.push_back({zero, zero, a});
    }
  // Next to the poles, where z is −1 but for a rounding.
  for (const float e : {1e-30f, 1e-20f, 1e-10f, 1e-5f, 1e-3f})
    for (const float z : {1.0f, -1.0f}) normals.push_back(glm::normalize(Vec3(e, -2 * e, z)));
  Stream random(4);
  for (int i = 0; i < 10000; ++i) normals.push_back(square_to_sphere(random.uniform2()));
  for (const Vec3 n : normals) {
    const Frame f = Frame::from_normal(n);
    ASSERT_TRUE(is_finite(f.s) && is_finite(f.t)) << n.x << ' ' << n.y << ' ' << n.z;
    EXPECT_NEAR(glm::length(f.s), 1, 1e-6) << n.x << ' ' << n.y << ' ' << n.z;
    EXPECT_NEAR(glm::length(f.t), 1, 1e-6) << n.x << ' ' << n.y << ' ' << n.z;
    EXPECT_NEAR(glm::dot(f.s, f.t), 0, 1e-6);
    EXPECT_NEAR(glm::dot(f.s, n), 0, 1e-6);
    EXPECT_NEAR(glm::dot(f.t, n), 0, 1e-6);
    EXPECT_NEAR(glm::dot(glm::cross(f.s, f.t), n), 1, 1e-6) << "right-handed";
    EXPECT_NEAR(glm::length(f.to_world(f.to_local({0.36f, 0.48f, 0.8f})) - Vec3(0.36f, 0.48f, 0.8f)), 0, 1e-6);
  }
}

}  // namespace
}  // namespace woodcock::testing
