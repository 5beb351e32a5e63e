// What the evenly spread numbers promise: even in every box, uniform in each point, and independent of each other where
// errors are estimated between them.
#include "renderer/core/sobol.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <set>
#include <vector>

#include "renderer/core/random.h"

namespace woodcock {
namespace {

TEST(Sobol, AnyAlignedPowerOfTwoOfPointsLiesOneInEachElementaryBox) {
  Stream random(1);
  for (int trial = 0; trial < 40; ++trial) {
    const uint64_t seed = random.next_u64();
    const int m = 1 + trial % 9;
    const uint32_t first = (random.next_u32() >> m) << m;
    for (int across = 0; across <= m; ++across) {
      std::set<std::pair<int, int>> boxes;
      for (uint32_t i = 0; i < (1u << m); ++i) {
        const Vec2 p = sobol_point(first + i, seed);
        ASSERT_TRUE(p.x >= 0 && p.x < 1 && p.y >= 0 && p.y < 1);
        boxes.insert({static_cast<int>(std::ldexp(p.x, across)), static_cast<int>(std::ldexp(p.y, m - across))});
      }
      EXPECT_EQ(boxes.size(), size_t{1} << m) << "2^" << m << " points from " << first << ", 2^" << across << " boxes across";
    }
  }
}

// Each coordinate of each pair by itself, and one of each of two pairs together; t as published for these dimensions is small.
TEST(Sobol, PairsOfOneSequenceAreEvenByThemselvesAndTogether) {
  Stream random(4);
  for (int trial = 0; trial < 20; ++trial) {
    const uint32_t shuffle = random.next_u32();
    std::array<uint64_t, kSobolPairs> seeds{};
    for (uint64_t& seed : seeds) seed = random.next_u64();
    constexpr int kM = 10, kT = 3;
    const uint32_t first = (random.next_u32() >> kM) << kM;
    std::vector<std::array<float, 2 * kSobolPairs>> points(1u << kM);
    for (uint32_t i = 0; i < points.size(); ++i)
      for (int pair = 0; pair < kSobolPairs; ++pair) {
        const Vec2 p = sobol_point(first + i, shuffle, seeds[static_cast<size_t>(pair)], pair);
        points[i][static_cast<size_t>(2 * pair)] = p.x;
        points[i][static_cast<size_t>(2 * pair + 1)] = p.y;
      }
    for (size_t a = 0; a < 2 * kSobolPairs; ++a) {
      std::set<int> intervals;
      for (const auto& p : points) intervals.insert(static_cast<int>(std::ldexp(p[a], kM)));
      EXPECT_EQ(intervals.size(), points.size()) << "coordinate " << a;
      for (size_t b = 0; b < a; ++b)
        for (int across = 0; across <= kM - kT; ++across) {
          // Each box of 2^-(m - t) has 2^t points.
          std::map<std::pair<int, int>, int> boxes;
          for (const auto& p : points)
            ++boxes[{static_cast<int>(std::ldexp(p[a], across)), static_cast<int>(std::ldexp(p[b], kM - kT - across))}];
          EXPECT_EQ(boxes.size(), size_t{1} << (kM - kT)) << a << ' ' << b << ' ' << across;
          for (const auto& box : boxes) EXPECT_EQ(box.second, 1 << kT) << a << ' ' << b << ' ' << across;
        }
    }
  }
}

// Whatever the index, and whichever indices go together: a path that was split has others at later vertices.
TEST(Sobol, PairsOfOneSequenceAreIndependentOverItsSeeds) {
  constexpr int kSeeds = 200000;
  double same = 0, other = 0;
  for (int s = 0; s < kSeeds; ++s) {
    const uint64_t name = mix64(static_cast<uint64_t>(s));
    const auto point = [&](uint32_t index, int pair) {
      return sobol_point(index, static_cast<uint32_t>(mix64(name)), hash_combine(name, static_cast<uint64_t>(pair)), pair) - 0.5f;
    };
    const Vec2 p = point(6, 0), q = point(6, 1), r = point(12, 2);
    same += static_cast<double>(p.x * q.x + p.y * q.y) / std::sqrt(2.0);
    other += static_cast<double>(p.x * r.y + q.y * r.x) / std::sqrt(2.0);
  }
  const double root = std::sqrt(static_cast<double>(kSeeds));
  EXPECT_LT(std::abs(same) / root, 5.0 / 12);
  EXPECT_LT(std::abs(other) / root, 5.0 / 12);
}

TEST(Sobol, ThePathsDirectionAndWhatItMeetsNextAreJoint) {
  // 64 samples: one in each of 64 boxes of direction times next light sample, as padded pairs have not.
  const auto filled = [](Purpose later, uint32_t vertex) {
    std::set<std::pair<int, int>> boxes;
    for (uint64_t i = 0; i < 64; ++i) {
      const PathKey key = path_key(7, 3, 4, kReplicates * i + 1, 0, true);
      const float a = stream(key, 1, Purpose::kDirection).uniform2().x, b = stream(key, vertex, later).uniform2().x;
      boxes.insert({static_cast<int>(8 * a), static_cast<int>(8 * b)});
    }
    return boxes.size();
  };
  EXPECT_EQ(filled(Purpose::kLightSample, 2), 64u);
  EXPECT_EQ(filled(Purpose::kDirection, 2), 64u);
  EXPECT_LT(filled(Purpose::kLightSample, 1), 60u);
}

/// Mean and correlation over many seeds; 5 standard errors are exceeded once in a million.
TEST(Sobol, OnePointOfManySequencesIsUniformAndTwoSequencesAreIndependent) {
  constexpr int kSeeds = 200000;
  double sum_x = 0, sum_y = 0, product = 0, across = 0;
  for (int s = 0; s < kSeeds; ++s) {
    const Vec2 p = sobol_point(5, mix64(static_cast<uint64_t>(2 * s))) - 0.5f,
               q = sobol_point(5, mix64(static_cast<uint64_t>(2 * s + 1))) - 0.5f;
    sum_x += static_cast<double>(p.x);
    sum_y += static_cast<double>(p.y);
    product += static_cast<double>(p.x * p.y);
    across += static_cast<double>(p.x * q.x);
  }
  const double root = std::sqrt(static_cast<double>(kSeeds));
  EXPECT_LT(std::abs(sum_x) / root, 5 * std::sqrt(1.0 / 12));
  EXPECT_LT(std::abs(sum_y) / root, 5 * std::sqrt(1.0 / 12));
  EXPECT_LT(std::abs(product) / root, 5.0 / 12);
  EXPECT_LT(std::abs(across) / root, 5.0 / 12);
}

TEST(Sobol, SamplesOfAReplicateAreEvenAndReplicatesHaveSequencesOfTheirOwn) {
  const auto point = [](uint64_t sample) { return stream(path_key(7, 3, 4, sample, 0, true), 1, Purpose::kDirection).uniform2(); };
  std::set<std::pair<int, int>> boxes;
  for (uint64_t i = 0; i < 16; ++i) {
    const Vec2 p = point(kReplicates * i + 2);
    boxes.insert({static_cast<int>(4 * p.x), static_cast<int>(4 * p.y)});
  }
  EXPECT_EQ(boxes.size(), 16u);
  EXPECT_NE(point(2), point(3));
  // What comes after the first draw, and what comes after the first vertices, is independent numbers.
  Stream early = stream(path_key(7, 3, 4, 0, 0, true), 1, Purpose::kDirection),
         plain = stream(path_key(7, 3, 4, 0), 1, Purpose::kDirection);
  early.uniform2();
  EXPECT_EQ(early.next_u64(), plain.next_u64());
  EXPECT_EQ(stream(path_key(7, 3, 4, 0, 0, true), kLeadingVertices, Purpose::kDirection).uniform(),
            stream(path_key(7, 3, 4, 0), kLeadingVertices, Purpose::kDirection).uniform());
}

}  // namespace
}  // namespace woodcock
