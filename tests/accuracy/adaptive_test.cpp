// The decision where samples go, with statistics that are made up, and the statistics of blocks.
#include "renderer/accuracy/adaptive.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "renderer/accuracy/compare.h"
#include "renderer/accuracy/error.h"
#include "renderer/accuracy/error_summary.h"
#include "renderer/film/merge.h"
#include "renderer/film/split.h"
#include "tests/film/random_tiles.h"

namespace woodcock {
namespace {

/// A frame whose blocks have the relative variance `cost` of one sample in each pixel, known without noise.
struct Made {
  SampleMap map;
  std::vector<double> cost;
  std::vector<bool> closed;

  Made(int across, int down, double all) : map{{0, 0, 32 * across, 32 * down}, {}} {
    map.counts.assign(static_cast<size_t>(across * down), 0);
    cost.assign(map.counts.size(), all);
    closed.assign(map.counts.size(), false);
  }
  std::vector<BlockStatistics> statistics() const {
    std::vector<BlockStatistics> blocks;
    for (size_t b = 0; b < cost.size(); ++b) {
      if (map.counts[b] == 0) {
        blocks.push_back({});
      } else {
        blocks.push_back({1024, 1024, 1024 * cost[b] / static_cast<double>(map.counts[b])});
      }
    }
    return blocks;
  }
  Decision decide(const SamplingTarget& target) const { return woodcock::decide(map, statistics(), closed, target); }
  /// Passes until nothing goes on.
  Decision run(const SamplingTarget& target, int* passes = nullptr) {
    for (int pass = 0; pass < 1000; ++pass) {
      Decision decision = decide(target);
      if (passes) *passes = pass;
      if (decision.done()) return decision;
      for (size_t b = 0; b < cost.size(); ++b) EXPECT_GE(decision.counts[b], map.counts[b]);
      map.counts = decision.counts;
    }
    ADD_FAILURE() << "it does not end";
    return {};
  }
};

bool on_schedule(int64_t count) {
  for (int64_t n = kFirstCount; n <= count; n = next_count(n, kMaxMapSamples))
    if (n == count) return true;
  return false;
}

TEST(Adaptive, TheScheduleIsQuarterOctaves) {
  std::vector<int64_t> counts;
  for (int64_t n = next_count(0, 100); counts.empty() || n > counts.back(); n = next_count(n, 100)) counts.push_back(n);
  EXPECT_EQ(counts, (std::vector<int64_t>{16, 20, 24, 28, 32, 40, 48, 56, 64, 80, 96, 100}));
  EXPECT_EQ(next_count(100, 1000), 112);  // back onto the schedule from an earlier limit
  EXPECT_EQ(next_count(100, 50), 100);    // a limit takes nothing away
  for (int64_t n = 16; n < 5000; n = next_count(n, 5000))
    if (next_count(n, 5000) < 5000) {
      EXPECT_TRUE(is_dyadic({n, next_count(n, 5000)})) << n;
    }
}

TEST(Adaptive, EqualBlocksGetEqualCountsAndTheTargetIsMet) {
  Made made(4, 3, 1.0);
  int passes = 0;
  const Decision end = made.run({0.05, 1 << 20}, &passes);  // 400 samples
  EXPECT_TRUE(end.reached);
  EXPECT_LE(end.error, 0.05);
  EXPECT_TRUE(made.map.uniform());
  EXPECT_EQ(made.map.counts[0], 448);
  EXPECT_LE(passes, 8);
}

TEST(Adaptive, SamplesGoWhereTheErrorIsAndCostLittleMoreThanTheOptimum) {
  // Costs over four orders of magnitude, in bands so that neighbours are mostly alike.
  Made made(16, 12, 0);
  for (size_t b = 0; b < made.cost.size(); ++b) made.cost[b] = std::pow(10.0, static_cast<double>(b / 48) - 2);
  const double target = 0.02;
  const Decision end = made.run({target, 1 << 20});
  EXPECT_TRUE(end.reached);
  // The continuous optimum: n_b = √c_b · Σ√c/(P·E²), but not below the first count.
  double roots = 0, optimum = 0, uniform = 0, spent = 0;
  for (const double c : made.cost) roots += std::sqrt(c), uniform += c;
  for (size_t b = 0; b < made.cost.size(); ++b) {
    const double n = std::sqrt(made.cost[b]) * roots / (static_cast<double>(made.cost.size()) * target * target);
    optimum += n;
    spent += static_cast<double>(made.map.counts[b]);
    EXPECT_TRUE(on_schedule(made.map.counts[b]));
  }
  uniform /= target * target;
  EXPECT_LT(spent, 1.25 * optimum);
  EXPECT_LT(spent, 0.7 * uniform);
  EXPECT_GE(end.error, 0.85 * target);  // no more than a step too much
}

TEST(Adaptive, ABlackBlockIsNotDoneBeforeItsLeastCount) {
  Made made(4, 1, 0.0);
  made.cost[0] = 1e-4;
  EXPECT_EQ(made.run({0.5, 1 << 20}).active, 0);
  EXPECT_EQ(made.map.counts, (std::vector<int64_t>{16, 32, 32, 32}));
  Made black(2, 2, 0.0);
  const Decision end = black.run({0.01, 1 << 20});
  EXPECT_TRUE(end.reached);
  EXPECT_EQ(black.map.counts, (std::vector<int64_t>{32, 32, 32, 32}));
}

TEST(Adaptive, ABlockThatSawNothingIsHeldByItsNeighbours) {
  // The light of block 1 was missed in block 0 beside it, and is far from block 3.
  Made made(4, 1, 0.0);
  made.cost[1] = 4;
  made.run({0.05, 1 << 20});
  EXPECT_GT(made.map.counts[0], 2 * made.map.counts[3]);
  EXPECT_EQ(made.map.counts[3], 32);
  EXPECT_LT(made.map.counts[0], made.map.counts[1]);
}

TEST(Adaptive, AClosedBlockTakesNothingAndHoldsNothingUp) {
  Made made(4, 4, 1.0);
  made.run({0.2, 1 << 20});
  made.cost[5] = 1e6;
  made.closed[5] = true;
  const int64_t before = made.map.counts[5];
  const Decision end = made.run({0.1, 1 << 20});
  EXPECT_TRUE(end.reached);
  EXPECT_LE(end.error, 0.1);
  EXPECT_EQ(made.map.counts[5], before);
  Made all(1, 1, 1.0);
  all.closed[0] = true;
  EXPECT_TRUE(all.decide({0.1, 1 << 20}).done());
}

TEST(Adaptive, TheLimitOfSamplesEndsIt) {
  Made made(3, 3, 1.0);
  made.cost[0] = 100;
  const Decision end = made.run({1e-6, 100});
  EXPECT_FALSE(end.reached);
  EXPECT_EQ(made.map.counts, std::vector<int64_t>(9, 100));
  // Raised later, it goes on from there.
  const Decision more = made.run({1e-6, 200});
  EXPECT_FALSE(more.reached);
  EXPECT_EQ(made.map.counts, std::vector<int64_t>(9, 200));
}

TEST(Adaptive, WithoutATargetTheErrorFallsPassByPassWhereItIs) {
  Made made(8, 1, 0.01);
  made.cost[0] = 100;
  double last = 1e9;
  for (int pass = 0; pass < 10; ++pass) {
    const Decision decision = made.decide({0, 1 << 20});
    EXPECT_FALSE(decision.reached);
    ASSERT_GT(decision.active, 0);
    // Before the first pass nothing is known.
    const double error = pass == 0 ? last : decision.error;
    EXPECT_LE(error, last);
    last = error;
    made.map.counts = decision.counts;
  }
  EXPECT_GT(made.map.counts[0], 8 * made.map.counts[7]);
}

/// A frame with this map, as a file.
void write_mapped(const std::filesystem::path& path, const FrameHeader& header, const SampleMap& map) {
  std::vector<MergeInput> inputs;
  std::vector<Tile> tiles;
  const auto shared = std::make_shared<const FrameHeader>(header);
  for (size_t b = 0; b < map.counts.size(); ++b)
    for (const SampleRange range : dyadic_nodes({0, map.counts[b]})) {
      tiles.push_back(testing::render_tile(map.grid().block(b), range));
      inputs.push_back({"tile", shared, tiles.back().rect, range});
    }
  merge_tiles(
      inputs, [&](size_t i) { return tiles[i]; }, path, {{}, {}, map}, &kErrorSummary);
}

TEST(Adaptive, TheErrorOfAFrameWithAMapWeighsEachPixelByItsOwnSamples) {
  testing::TemporaryFolder folder;
  const FrameHeader header = testing::some_header(96, 64);
  const SampleMap map{header.bounds, {16, 40, 0, 64, 16, 16}};
  write_mapped(folder / "a.exr", header, map);
  const ErrorEstimate error = estimate_error(folder / "a.exr");
  const auto blocks = block_statistics(folder / "a.exr", map);
  double mean = 0, square = 0, pixels = 0;
  for (const BlockStatistics& block : blocks) {
    mean += block.mean_sum;
    square += block.relative_square;
    pixels += static_cast<double>(block.pixels);
  }
  EXPECT_EQ(error.pixels, 5 * 1024);
  EXPECT_EQ(error.missing_pixels, 1024);
  EXPECT_EQ(error.samples, std::llround(static_cast<double>(map.samples()) / pixels));
  // A block counts with its plain square or, where that is more, with the unbiased one.
  EXPECT_GE(square / pixels, (1 - 1e-4) * std::max(*error.relative_mse, *error.unbiased_relative_mse));
  EXPECT_TRUE(error.firefly_share);  // of the block with 64 samples
  EXPECT_GT(*error.image_mean_half_width, 0);
}

TEST(Adaptive, BlocksOfOneOrAFewSamplesSpoilNoNumber) {
  testing::TemporaryFolder folder;
  const FrameHeader header = testing::some_header(96, 32);
  for (const std::vector<int64_t>& counts : {std::vector<int64_t>{4, 16, 64}, {1, 2, 16}, {2, 3, 5}, {16, 1, 1}}) {
    const SampleMap map{header.bounds, counts};
    write_mapped(folder / "a.exr", header, map);
    const ErrorEstimate error = estimate_error(folder / "a.exr");
    double mean = 0;
    for (const BlockStatistics& block : block_statistics(folder / "a.exr", map)) {
      mean += block.mean_sum / (96 * 32);
      EXPECT_TRUE(std::isfinite(block.relative_square));
    }
    EXPECT_NEAR(error.image_mean / mean, 1, 1e-6);
    for (const auto& [name, value] : error_fields(error)) EXPECT_TRUE(std::isfinite(value)) << name;
    // Replicates that some pixel lacks say nothing of the whole.
    EXPECT_EQ(error.degrees, std::min<int64_t>(3, *std::min_element(counts.begin(), counts.end()) - 1));
    std::filesystem::remove(folder / "a.exr");
  }
}

TEST(Adaptive, AFrameThatMissesBlocksIsNoPictureToCompareWith) {
  testing::TemporaryFolder folder;
  const FrameHeader header = testing::some_header(96, 32);
  write_mapped(folder / "whole.exr", header, {header.bounds, {16, 16, 16}});
  write_mapped(folder / "hole.exr", header, {header.bounds, {16, 0, 16}});
  write_mapped(folder / "one.exr", header, {header.bounds, {16, 1, 16}});
  const auto refusal = [&](const std::string& a, const std::string& b) {
    return testing::message_of([&] { test_noise(folder / a, folder / b); });
  };
  EXPECT_THAT(refusal("hole.exr", "whole.exr"), ::testing::HasSubstr("1024 of its pixels miss samples"));
  EXPECT_THAT(refusal("whole.exr", "hole.exr"), ::testing::HasSubstr("1024 of its pixels miss samples"));
  EXPECT_THAT(refusal("one.exr", "whole.exr"), ::testing::HasSubstr("one sample only"));
}

TEST(Adaptive, StatisticsDoNotDependOnThePiecesTheyComeIn) {
  testing::TemporaryFolder folder;
  FrameHeader header = testing::some_header(150, 80);
  header.bounds = {3, 9, 120, 77};
  SampleMap map{header.bounds, {}};
  for (size_t b = 0; b < map.grid().size(); ++b) map.counts.push_back(b % 3 == 0 ? 16 : b % 3 == 1 ? 20 : 40);
  write_mapped(folder / "a.exr", header, map);
  const auto by_rows = block_statistics(folder / "a.exr", map);

  ExrReader reader(folder / "a.exr");
  const Tile picture{header.bounds, {0, 40}, reader.beauty_rows(header.bounds.y0, header.bounds.y1)};
  const auto by_blocks = block_statistics(map, [&](const auto& use) {
    for (size_t b = 0; b < map.counts.size(); ++b) {
      const PixelRect block = map.grid().block(b);
      use(block, cut(picture, block).pixels);
    }
  });
  int64_t pixels = 0;
  for (size_t b = 0; b < map.counts.size(); ++b) {
    EXPECT_EQ(by_rows[b].mean_sum, by_blocks[b].mean_sum);
    EXPECT_EQ(by_rows[b].relative_square, by_blocks[b].relative_square);
    EXPECT_GT(by_rows[b].relative_square, 0);
    pixels += by_rows[b].pixels;
  }
  EXPECT_EQ(pixels, header.bounds.area());
}

}  // namespace
}  // namespace woodcock
