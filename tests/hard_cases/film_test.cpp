// What becomes of samples: the accumulation tree, and files.
#include <gtest/gtest.h>

#include <cmath>

#include "renderer/film/exr.h"
#include "tests/film/random_tiles.h"

namespace woodcock::testing {
namespace {

constexpr int64_t kMany = 100000000;
constexpr Aovs kAovs{{0.3f, 0.3f, 0.3f}, {0, 0.6f, 0.8f}, 7.7f};

/// The node of `range` whose samples are all `radiance`, without making each of them: from level 3 on siblings are equal.
PixelStats constant_node(SampleRange range, Rgb radiance) {
  if (range.size() > 8) {
    const PixelStats half = constant_node(left_child(range), radiance);
    return merge(half, half, dyadic_level(range) - 1);
  }
  PixelAccumulator pixel(range);
  while (!pixel.complete()) pixel.push(leaf(radiance, kAovs, pixel.next_index()));
  return pixel.result();
}

TEST(HardCases, N36_1e8_samples_of_a_constant_are_the_constant) {
  const Rgb radiance{0.1f, 0.7f, 123.456f};
  const SampleRange range{0, kMany};
  const auto ranges = dyadic_nodes(range);
  std::vector<PixelStats> nodes;
  for (const SampleRange r : ranges) nodes.push_back(constant_node(r, radiance));
  const PixelStats all = fold(ranges, nodes);
  EXPECT_EQ(all.mean, radiance);
  EXPECT_EQ(all.deviation, Rgb(0));
  EXPECT_EQ(all.count, static_cast<float>(kMany));
  EXPECT_EQ(all.albedo, kAovs.albedo);
  EXPECT_EQ(all.normal, kAovs.normal);
  EXPECT_EQ(all.depth, kAovs.depth);
  for (const float r : all.replicate) EXPECT_EQ(r, all.largest);
  // And one sample after the other, past 2²⁴, where a sum in float32 sticks.
  PixelAccumulator pixel({0, int64_t{1} << 25});
  while (!pixel.complete()) pixel.push(leaf(radiance, kAovs, pixel.next_index()));
  EXPECT_EQ(pixel.result().mean, radiance);
  EXPECT_EQ(pixel.result().deviation, Rgb(0));
}

TEST(HardCases, N36_beyond_2_to_24_samples_every_sample_still_counts) {
  // 0 and 1 in turn: exactly one half, and a deviation of one half, at any length.
  PixelAccumulator pixel({0, int64_t{1} << 25});
  while (!pixel.complete()) pixel.push(leaf(Rgb(static_cast<float>(pixel.next_index() & 1)), {}, pixel.next_index()));
  EXPECT_EQ(pixel.result().mean, Rgb(0.5f));
  EXPECT_EQ(pixel.result().deviation, Rgb(0.5f));
}

TEST(HardCases, N37_deviations_survive_a_large_mean_and_are_never_negative) {
  // 10⁴ ± ½: the difference of E[x²] and E[x]² has no digit of this left in float32.
  PixelAccumulator pixel({0, 4096});
  while (!pixel.complete()) pixel.push(leaf(Rgb(10000 + 0.5f * (pixel.next_index() & 1 ? 1.0f : -1.0f)), {}, pixel.next_index()));
  EXPECT_NEAR(pixel.result().mean.r, 10000, 1e-2);
  EXPECT_NEAR(pixel.result().deviation.r, 0.5, 1e-3);
  // A constant: nothing is left to have a root taken of.
  for (const float value : {1e-30f, 0.1f, 3.3333333e7f, 1e30f}) {
    PixelAccumulator same({0, 1024});
    while (!same.complete()) same.push(leaf(Rgb(value), {}, same.next_index()));
    EXPECT_EQ(same.result().deviation, Rgb(0)) << value;
  }
  Stream random(2);
  for (int trial = 0; trial < 20000; ++trial) {
    const PixelStats node = merge(random_leaf(random, 0), random_leaf(random, 1), 0);
    for (int c = 0; c < 3; ++c) ASSERT_TRUE(node.deviation[c] >= 0);
  }
}

TEST(HardCases, N41_values_beyond_half_floats_come_back_from_the_file) {
  const FrameHeader header = some_header(8, 1);
  Tile tile{{0, 0, 8, 1}, {0, 1}, {}};
  const float values[] = {0.1f, 65504, 65520, 1e6f, 1e30f, 3e38f, 1e-6f, 1e-30f};
  for (const float v : values) tile.pixels.push_back(leaf(Rgb(v, v / 2, v / 4), {}, 0));
  const NodeFile file = decode_exr(encode_exr(header, std::vector<Tile>{tile}), "frame");
  ASSERT_EQ(file.nodes.size(), 1u);
  for (size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(file.nodes[0].pixels[i].mean, tile.pixels[i].mean) << values[i];
    EXPECT_EQ(file.nodes[0].pixels[i].largest, tile.pixels[i].largest) << values[i];
  }
}

}  // namespace
}  // namespace woodcock::testing
