// What the evenly spread numbers promise: even in every box, uniform in each point, and independent of each other where
// errors are estimated between them.
#include "renderer/core/sobol.h"

#include <gtest/gtest.h>

#include <set>

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
