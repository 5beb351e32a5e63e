#include "renderer/film/dyadic.h"

#include <gtest/gtest.h>

#include <map>

#include "tests/film/random_samples.h"

namespace woodcock {
namespace {

using testing::same_bits;

TEST(Dyadic, NodesPartitionTheRangeAndAreMaximal) {
  Stream random(1);
  for (int trial = 0; trial < 3000; ++trial) {
    const int bits = 1 + static_cast<int>(random.next_u32() % 61);
    const auto a = static_cast<int64_t>(random.next_u64() >> (64 - bits)), b = static_cast<int64_t>(random.next_u64() >> (64 - bits));
    const SampleRange range{std::min(a, b), std::max(a, b)};
    const auto nodes = dyadic_nodes(range);
    ASSERT_LE(nodes.size(), 124u);
    int64_t at = range.begin;
    for (const SampleRange& node : nodes) {
      ASSERT_EQ(node.begin, at);
      ASSERT_TRUE(is_dyadic(node));
      const int64_t parent = node.begin & ~(2 * node.size() - 1);
      ASSERT_FALSE(range.contains({parent, parent + 2 * node.size()})) << "not maximal";
      at = node.end;
    }
    ASSERT_EQ(at, range.end);
  }
  EXPECT_EQ(dyadic_nodes({0, 5}), (std::vector<SampleRange>{{0, 4}, {4, 5}}));
  EXPECT_TRUE(dyadic_nodes({3, 3}).empty());
  EXPECT_TRUE(dyadic_nodes({-2, 6}).empty());
  EXPECT_EQ(dyadic_nodes({0, kMaxSamples}).size(), 1u);
}

TEST(Dyadic, OnlyAlignedPowersOfTwoAreNodes) {
  EXPECT_TRUE(is_dyadic({0, 1}));
  EXPECT_TRUE(is_dyadic({12, 16}));
  EXPECT_FALSE(is_dyadic({2, 6}));
  EXPECT_FALSE(is_dyadic({0, 6}));
  EXPECT_FALSE(is_dyadic({4, 4}));
  EXPECT_FALSE(is_dyadic({-4, 0}));
}

TEST(Dyadic, ReplicatesShareTheSamples) {
  for (int64_t a = 0; a < 20; ++a)
    for (int64_t b = a; b < 40; ++b) {
      std::array<int64_t, kReplicates> counted{};
      for (int64_t i = a; i < b; ++i) ++counted[static_cast<size_t>(i % kReplicates)];
      for (int k = 0; k < kReplicates; ++k) ASSERT_EQ(samples_of_replicate({a, b}, k), counted[static_cast<size_t>(k)]);
    }
}

TEST(Tree, AccumulatorGivesTheNodeAndTheStatisticsOfEveryPrefix) {
  Stream random(2);
  std::vector<PixelStats> leaves;
  for (int64_t i = 0; i < 512; ++i) leaves.push_back(testing::random_leaf(random, i));
  for (const SampleRange range : {SampleRange{0, 512}, SampleRange{256, 512}, SampleRange{7, 8}, SampleRange{64, 128}}) {
    PixelAccumulator pixel(range);
    std::map<int, PixelStats> prefixes;
    while (!pixel.complete()) {
      EXPECT_TRUE(pixel.result().missing());
      pixel.push(leaves[static_cast<size_t>(pixel.next_index())], [&](int level, const PixelStats& node) { prefixes[level] = node; });
    }
    EXPECT_TRUE(same_bits(pixel.result(), testing::node_by_recursion(leaves, range)));
    ASSERT_EQ(prefixes.size(), static_cast<size_t>(dyadic_level(range)) + 1);
    for (const auto& [level, node] : prefixes)
      EXPECT_TRUE(same_bits(node, testing::node_by_recursion(leaves, {range.begin, range.begin + (int64_t{1} << level)})));
  }
}

/// Splits `range` at random into dyadic nodes, computes each by itself, and puts them together in random order:
/// whichever siblings are both there are merged.
PixelStats merged_in_random_order(const std::vector<PixelStats>& leaves, SampleRange range, Stream& random) {
  std::vector<SampleRange> open = {range}, pieces;
  while (!open.empty()) {
    const SampleRange r = open.back();
    open.pop_back();
    if (r.size() == 1 || random.uniform() < 0.3f) {
      pieces.push_back(r);
    } else {
      open.push_back(left_child(r));
      open.push_back(right_child(r));
    }
  }
  std::map<std::pair<int64_t, int64_t>, PixelStats> done;  // (size, begin)
  while (!pieces.empty()) {
    std::swap(pieces[random.next_u32() % pieces.size()], pieces.back());
    SampleRange r = pieces.back();
    pieces.pop_back();
    PixelAccumulator pixel(r);
    while (!pixel.complete()) pixel.push(leaves[static_cast<size_t>(pixel.next_index())]);
    PixelStats node = pixel.result();
    while (!(r == range)) {
      const bool is_left = (r.begin & r.size()) == 0;
      const auto sibling = done.find({r.size(), is_left ? r.end : r.begin - r.size()});
      if (sibling == done.end()) break;
      const PixelStats other = sibling->second;
      done.erase(sibling);
      node = is_left ? merge(node, other, dyadic_level(r)) : merge(other, node, dyadic_level(r));
      r = is_left ? SampleRange{r.begin, r.end + r.size()} : SampleRange{r.begin - r.size(), r.end};
    }
    done[{r.size(), r.begin}] = node;
  }
  EXPECT_EQ(done.size(), 1u);
  return done.begin()->second;
}

TEST(Tree, AnySplitAndAnyOrderGiveTheSameBits) {
  Stream random(3);
  for (int trial = 0; trial < 300; ++trial) {
    const int level = static_cast<int>(random.next_u32() % 10);
    std::vector<PixelStats> leaves;
    for (int64_t i = 0; i < int64_t{1} << level; ++i) leaves.push_back(testing::random_leaf(random, i));
    const SampleRange range{0, int64_t{1} << level};
    const PixelStats expected = testing::node_by_recursion(leaves, range);
    for (int order = 0; order < 4; ++order)
      ASSERT_TRUE(same_bits(merged_in_random_order(leaves, range, random), expected)) << "level " << level;
  }
}

TEST(Fold, IsTheWeightedMeanAndDeviationOfAllSamples) {
  Stream random(4);
  for (const SampleRange range : {SampleRange{0, 5}, SampleRange{0, 100}, SampleRange{3, 77}, SampleRange{6, 10}}) {
    std::vector<PixelStats> leaves, nodes;
    double sum = 0, squares = 0;
    std::array<double, kReplicates> replicate{};
    for (int64_t i = 0; i < range.end; ++i) {
      const float x = random.uniform();
      leaves.push_back(leaf(Rgb(x), {}, i));
      if (i < range.begin) continue;
      sum += x;
      squares += static_cast<double>(x) * x;
      replicate[static_cast<size_t>(i % kReplicates)] += x;
    }
    const auto ranges = dyadic_nodes(range);
    for (const SampleRange r : ranges) nodes.push_back(testing::node_by_recursion(leaves, r));
    const PixelStats all = fold(ranges, nodes);
    const double n = static_cast<double>(range.size()), mean = sum / n;
    EXPECT_NEAR(all.mean.g, mean, 1e-6);
    EXPECT_NEAR(all.deviation.b, std::sqrt(squares / n - mean * mean), 1e-6);
    EXPECT_EQ(all.count, static_cast<float>(n));
    for (int k = 0; k < kReplicates; ++k) {
      const auto share = static_cast<double>(samples_of_replicate(range, k));
      EXPECT_NEAR(all.replicate[static_cast<size_t>(k)], share == 0 ? 0 : replicate[static_cast<size_t>(k)] / share, 1e-6);
    }
  }
}

TEST(Fold, KeepsAConstantExactAndAHoleAHole) {
  const SampleRange range{0, 1000003};
  const auto ranges = dyadic_nodes(range);
  std::vector<PixelStats> nodes;
  for (const SampleRange r : ranges) {
    PixelStats node = leaf(Rgb(0.1f), {}, r.begin);
    for (int level = 0; level < dyadic_level(r); ++level) node = merge(node, node, kReplicateLevel);
    nodes.push_back(node);
  }
  EXPECT_EQ(fold(ranges, nodes).mean, Rgb(0.1f));
  EXPECT_EQ(fold(ranges, nodes).deviation, Rgb(0));
  nodes[2] = {};
  EXPECT_TRUE(fold(ranges, nodes).missing());
}

}  // namespace
}  // namespace woodcock
