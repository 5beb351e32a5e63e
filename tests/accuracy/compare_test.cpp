#include "renderer/accuracy/compare.h"

#include <gtest/gtest.h>

#include "renderer/film/exr.h"
#include "tests/film/random_tiles.h"

namespace woodcock {
namespace {

void write_constant(const std::filesystem::path& path, int width, float value) {
  Tile tile{{0, 0, width, 4}, {0, 1}, {}};
  for (int64_t i = 0; i < tile.rect.area(); ++i) tile.pixels.push_back(leaf(Rgb(value), {}, 0));
  write_exr(path, testing::some_header(width, 4), std::span(&tile, 1));
}

TEST(Compare, MeasuresAKnownDifference) {
  testing::TemporaryFolder folder;
  write_constant(folder / "a.exr", 8, 2.5f);
  write_constant(folder / "r.exr", 8, 2);
  const PictureDifference d = compare_pictures(folder / "a.exr", folder / "r.exr");
  EXPECT_DOUBLE_EQ(d.mse, 0.25);
  EXPECT_NEAR(d.relative_mse, 0.25 / (4 * 1.0001), 1e-6);
  EXPECT_NEAR(d.psnr, 10 * std::log10(16), 1e-9);
  EXPECT_NEAR(d.mean - d.reference_mean, 0.5, 1e-6);
  EXPECT_EQ(compare_pictures(folder / "r.exr", folder / "r.exr").psnr, std::numeric_limits<double>::infinity());
}

TEST(Compare, PercentagesAreOfTheReferenceAndOfBoth) {
  testing::TemporaryFolder folder;
  write_constant(folder / "a.exr", 8, 2.5f);
  write_constant(folder / "r.exr", 8, 2);
  const PictureDifference d = compare_pictures(folder / "a.exr", folder / "r.exr");
  EXPECT_NEAR(d.mape, 0.5 / 2.02, 1e-6);
  EXPECT_NEAR(d.smape, 0.5 / 2.27, 1e-6);
  EXPECT_FALSE(d.ssim.has_value());
  EXPECT_EQ(d.flip_ldr, 0);  // a screen shows both as white
  EXPECT_GT(d.flip_hdr, 0.01);
}

/// A node file of 64 × 48 pixels with exponential samples of mean `level`.
void write_noise(const std::filesystem::path& path, SampleRange range, double level, uint64_t seed, uint64_t header_seed) {
  Stream random(seed);
  const PixelRect rect{0, 0, 64, 48};
  std::vector<Tile> nodes;
  for (const SampleRange r : dyadic_nodes(range)) nodes.push_back({rect, r, {}});
  for (int64_t p = 0; p < rect.area(); ++p)
    for (Tile& node : nodes) {
      PixelAccumulator pixel(node.range);
      while (!pixel.complete()) pixel.push(leaf(Rgb(static_cast<float>(level) * random.exponential()), {}, pixel.next_index()));
      node.pixels.push_back(pixel.result());
    }
  FrameHeader header = testing::some_header(64, 48);
  header.seed = header_seed;
  write_exr(path, header, nodes);
}

TEST(Compare, FindsNoiseToBeNoise) {
  testing::TemporaryFolder folder;
  write_noise(folder / "a.exr", {0, 512}, 2, 1, 1);
  write_noise(folder / "r.exr", {0, 768}, 2, 2, 2);
  const auto test = test_noise(folder / "a.exr", folder / "r.exr");
  ASSERT_TRUE(test.has_value());
  EXPECT_TRUE(test->reference_has_noise);
  EXPECT_EQ(test->caution, "");
  EXPECT_GT(test->mean_p, 1e-3);  // a false alarm in 1000 seeds; this one is fixed
  // 3072 pixels: 154 beyond 5 %, with a deviation of 12; means of exponential values are a little skewed. Five deviations.
  EXPECT_NEAR(static_cast<double>(test->beyond_5_percent), 154, 62);
  EXPECT_LE(test->beyond_corrected, 1);
  EXPECT_NEAR(test->expected_relative_mse, 1 / 512.0 + 1 / 768.0, 2e-4);
  // 95 % within one half width; two and a half are 5 standard deviations.
  EXPECT_NEAR(test->excess_relative_mse.value, 0, 2.5 * test->excess_relative_mse.half_width);
  EXPECT_LT(test->excess_relative_mse.half_width, 1e-3);
}

TEST(Compare, FindsABiasBehindTheNoise) {
  testing::TemporaryFolder folder;
  write_noise(folder / "a.exr", {0, 256}, 2.1, 3, 1);
  write_noise(folder / "r.exr", {0, 768}, 2, 4, 2);
  const auto test = test_noise(folder / "a.exr", folder / "r.exr");
  EXPECT_NEAR(test->mean_difference.value, 0.1, 2.5 * test->mean_difference.half_width);
  EXPECT_LT(test->mean_p, 1e-6);
  EXPECT_GT(test->excess_relative_mse.value, test->excess_relative_mse.half_width);
  EXPECT_NEAR(test->excess_relative_mse.value, 0.05 * 0.05, 2.5 * test->excess_relative_mse.half_width + 1e-4);
}

TEST(Compare, SamplesThatAreSharedAreNoEvidence) {
  testing::TemporaryFolder folder;
  write_noise(folder / "a.exr", {0, 64}, 2, 5, 1);
  write_noise(folder / "b.exr", {0, 128}, 2, 5, 1);
  write_constant(folder / "one.exr", 8, 1);
  EXPECT_NE(test_noise(folder / "a.exr", folder / "b.exr")->caution, "");
  EXPECT_FALSE(test_noise(folder / "one.exr", folder / "one.exr").has_value()) << "one sample has no statistics";
  EXPECT_THROW(test_noise(folder / "a.exr", folder / "one.exr"), FilmError);
}

TEST(Compare, APngIsDecoded) {
  testing::TemporaryFolder folder;
  Picture picture{16, 12, std::vector<Rgb>(192, Rgb(0.25f))};
  write_picture_png(picture, folder / "a.png");
  const Picture read = read_picture(folder / "a.png");
  EXPECT_NEAR(read.at(3, 4).g, 0.25f, 0.003f);
}

TEST(Compare, RefusesPicturesOfDifferentSizesAndFilesThatAreNone) {
  testing::TemporaryFolder folder;
  write_constant(folder / "a.exr", 8, 1);
  write_constant(folder / "b.exr", 9, 1);
  EXPECT_THROW(compare_pictures(folder / "a.exr", folder / "b.exr"), FilmError);
  EXPECT_THROW(compare_pictures(folder / "a.exr", folder / "nowhere.exr"), FilmError);
}

}  // namespace
}  // namespace woodcock
