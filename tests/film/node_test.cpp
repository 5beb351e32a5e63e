#include "renderer/film/node.h"

#include <gtest/gtest.h>
#include <xmmintrin.h>

#include "tests/film/random_samples.h"

namespace woodcock {
namespace {

using testing::same_bits;

TEST(Node, ConstantRadianceStaysExactBeyondTwoToThe24Samples) {
  // A float sum would stick at 2^24. Equal siblings merged 40 times are 2^40 samples of one constant.
  const Rgb radiance{0.1f, 0.7f, 123.456f};
  std::vector<PixelStats> leaves;
  Aovs aovs{{0.3f, 0.3f, 0.3f}, {0, 0.6f, 0.8f}, 7.7f};
  for (int64_t i = 0; i < 8; ++i) leaves.push_back(leaf(radiance, aovs, i));
  PixelStats node = testing::node_by_recursion(leaves, {0, 8});
  for (int level = 3; level < 40; ++level) node = merge(node, node, level);
  EXPECT_EQ(node.mean, radiance);
  EXPECT_EQ(node.deviation, Rgb(0));
  EXPECT_EQ(node.albedo, aovs.albedo);
  EXPECT_EQ(node.normal, aovs.normal);
  EXPECT_EQ(node.depth, aovs.depth);
  EXPECT_EQ(node.count, 0x1p40f);
  for (const float r : node.replicate) EXPECT_EQ(r, leaves[0].largest);
}

TEST(Node, MomentsAgreeWithTheDirectFormulas) {
  Stream random(1);
  std::vector<PixelStats> leaves;
  double sum = 0, squares = 0;
  constexpr int kN = 1024;
  for (int64_t i = 0; i < kN; ++i) {
    const float x = random.uniform();
    leaves.push_back(leaf({x, x, x}, {}, i));
    sum += x;
    squares += static_cast<double>(x) * x;
  }
  const PixelStats node = testing::node_by_recursion(leaves, {0, kN});
  const double mean = sum / kN;
  EXPECT_NEAR(node.mean.r, mean, 1e-6);
  EXPECT_NEAR(node.deviation.g, std::sqrt(squares / kN - mean * mean), 1e-6);
  double of_replicates = 0;
  for (const float r : node.replicate) of_replicates += r;
  EXPECT_NEAR(of_replicates / kReplicates, mean, 1e-6);
}

TEST(Node, EveryNumberStaysFiniteFromTheSmallestToTheLargestFloat) {
  constexpr float kMax = std::numeric_limits<float>::max();
  const std::vector<PixelStats> leaves = {leaf({kMax, -kMax, kMax}, {}, 0), leaf({-kMax, kMax, kMax}, {}, 1),
                                          leaf({0x1p-149f, 0x1p-126f, -0x1p-130f}, {}, 2), leaf({kMax, kMax, kMax}, {}, 3)};
  for (const PixelStats& a : leaves)
    for (const PixelStats& b : leaves) {
      const PixelStats node = merge(a, b, 3);
      EXPECT_TRUE(is_finite(node.mean) && is_finite(node.deviation) && std::isfinite(node.largest));
      for (const float r : node.replicate) EXPECT_TRUE(std::isfinite(r));
    }
  EXPECT_EQ(merge(leaves[0], leaves[1], 0).deviation.r, kMax);
  EXPECT_EQ(leaves[2].mean.r, 0) << "subnormal numbers are zero";
  EXPECT_EQ(leaves[2].mean.g, 0x1p-126f);
}

TEST(Node, DeviationIsNeverNegativeNorNaNAndSurvivesTinyAndHugeRadiance) {
  Stream random(2);
  for (int trial = 0; trial < 20000; ++trial) {
    const PixelStats node = merge(testing::random_leaf(random, 0), testing::random_leaf(random, 1), 0);
    for (int c = 0; c < 3; ++c) ASSERT_TRUE(node.deviation[c] >= 0);
  }
  // Both would be lost as float32 second moments.
  EXPECT_FLOAT_EQ(merge(leaf(Rgb(1e-30f), {}, 0), leaf(Rgb(3e-30f), {}, 1), 0).deviation.r, 1e-30f);
  EXPECT_FLOAT_EQ(merge(leaf(Rgb(1e30f), {}, 0), leaf(Rgb(3e30f), {}, 1), 0).deviation.r, 1e30f);
}

TEST(Node, AMissingChildMakesTheParentMissing) {
  const PixelStats present = leaf(Rgb(1), {}, 0), hole;
  EXPECT_TRUE(merge(present, hole, 0).missing());
  EXPECT_TRUE(merge(hole, present, 5).missing());
  EXPECT_EQ(merge(hole, present, 5).mean, Rgb(0)) << "never half an average";
}

TEST(Node, BitsDoNotDependOnTheFlushToZeroModeOfTheThread) {
  const auto chain = [] {
    Stream random(3);
    std::vector<PixelStats> nodes;
    for (int i = 0; i < 4096; ++i) {
      const float scale = std::ldexp(1.0f, -120 - (i & 15));
      PixelStats a = leaf(Rgb(random.uniform() * scale), {}, 0), b = leaf(Rgb(random.uniform() * scale), {}, 1);
      nodes.push_back(merge(a, b, 0));
    }
    return nodes;
  };
  const unsigned mode = _mm_getcsr();
  const auto with_subnormals = chain();
  _mm_setcsr(mode | 0x8040);  // flush to zero, denormals are zero
  const auto without = chain();
  _mm_setcsr(mode);
  for (size_t i = 0; i < with_subnormals.size(); ++i) ASSERT_TRUE(same_bits(with_subnormals[i], without[i])) << i;
}

}  // namespace
}  // namespace woodcock
