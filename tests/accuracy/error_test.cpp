#include "renderer/accuracy/error.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/film/random_tiles.h"

namespace woodcock {
namespace {

using ::testing::HasSubstr;

/// Pixels whose samples are exponentially distributed with mean `level`: their standard deviation is `level` too.
std::vector<PixelStats> noisy_picture(size_t pixels, SampleRange range, float level, Stream& random) {
  const auto ranges = dyadic_nodes(range);
  std::vector<PixelStats> picture;
  for (size_t p = 0; p < pixels; ++p) {
    std::vector<PixelStats> nodes;
    for (const SampleRange r : ranges) {
      PixelAccumulator pixel(r);
      while (!pixel.complete()) pixel.push(leaf(Rgb(level * random.exponential()), {}, pixel.next_index()));
      nodes.push_back(pixel.result());
    }
    picture.push_back(fold(ranges, nodes));
  }
  return picture;
}

TEST(Error, FindsTheErrorThatIsKnown) {
  // E² = Var/(n·level²·1.0001), up to the scatter of x̄ in the denominator, which is of relative size 3/n.
  Stream random(1);
  for (const SampleRange range : {SampleRange{0, 1024}, SampleRange{0, 1000}, SampleRange{5, 1005}}) {
    const auto error = estimate_error(noisy_picture(1000, range, 3, random), range);
    const double expected = 1 / std::sqrt(static_cast<double>(range.size()));
    ASSERT_TRUE(error.relative_error.has_value());
    // 1000 pixels with 3 degrees of freedom know E to 1/sqrt(2·3·1000) = 1.3 %; six of these: a false alarm in 5e8.
    EXPECT_NEAR(error.relative_error->value, expected, 0.08 * expected);
    EXPECT_NEAR(*error.standard_error, 3 * expected, 0.08 * 3 * expected);
    EXPECT_DOUBLE_EQ(*error.relative_mse, error.relative_error->value * error.relative_error->value);
    EXPECT_GT(error.relative_error->half_width, 0);
    EXPECT_LT(error.relative_error->half_width, 0.1 * expected);
  }
}

TEST(Error, NinetyFivePercentIntervalsOfTheImageMeanHoldTheTruthNinetyFiveTimesInAHundred) {
  // Of 2000 intervals 1900 hold the truth on average, with a deviation of 9.7; five of them: a false alarm in 2e6 (fixed
  // seed). Means of 16 pixels × 64 samples are near enough to normal.
  Stream random(2);
  int hits = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const auto error = estimate_error(noisy_picture(16, {0, 64}, 0.5f, random), {0, 64});
    hits += std::abs(error.image_mean - 0.5) <= *error.image_mean_half_width;
  }
  EXPECT_NEAR(hits, 1900, 49);
}

TEST(Error, SaysHonestlyWhenThereAreTooFewSamples) {
  Stream random(3);
  const auto error = estimate_error(noisy_picture(10, {0, 1}, 1, random), {0, 1});
  EXPECT_FALSE(error.relative_error || error.image_mean_half_width || error.firefly_share);
  EXPECT_EQ(error.degrees, 0);
  EXPECT_GT(error.image_mean, 0);
  EXPECT_THAT(format_error(error), HasSubstr("not enough samples for an interval"));
}

TEST(Error, FewerThanFourSamplesAreOfAsManyReplicates) {
  // The mean variance of 4000 pixels is 1/n; the standard deviation of s² of n exponential values is below 3/sqrt(n − 1)·1/n:
  // five deviations of the mean are 0.24/sqrt(n − 1)/n.
  Stream random(5);
  for (const SampleRange range : {SampleRange{0, 2}, SampleRange{0, 3}, SampleRange{3, 6}, SampleRange{5, 9}}) {
    const auto error = estimate_error(noisy_picture(4000, range, 1, random), range);
    const auto n = static_cast<double>(range.size());
    EXPECT_EQ(error.degrees, range.size() - 1);
    EXPECT_NEAR(*error.standard_error * *error.standard_error, 1 / n, 0.24 / std::sqrt(n - 1) / n) << n;
  }
}

TEST(Error, OfNodesIsThatOfTheirFold) {
  const SampleRange range{0, 13};
  const auto nodes = testing::render_nodes({0, 0, 9, 500}, range);
  std::vector<PixelStats> picture;
  for (size_t p = 0; p < nodes[0].pixels.size(); ++p) {
    std::vector<PixelStats> one;
    for (const Tile& node : nodes) one.push_back(node.pixels[p]);
    picture.push_back(fold(dyadic_nodes(range), one));
  }
  EXPECT_EQ(error_fields(estimate_error(nodes)), error_fields(estimate_error(picture, range)));
}

TEST(Error, KnowsHowWellItKnowsItself) {
  // The relative MSE of many pictures scatters as `mse_deviation` says. Of 300 pictures the scatter is known to 4 %; five of
  // these. The means of 32 exponential values are not quite normal, which adds some 10 %.
  Stream random(6);
  double sum = 0, squares = 0, said = 0;
  constexpr int kTrials = 300;
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto error = estimate_error(noisy_picture(64, {0, 256}, 1, random), {0, 256});
    sum += *error.relative_mse;
    squares += *error.relative_mse * *error.relative_mse;
    said += *error.mse_deviation / kTrials;
  }
  const double mean = sum / kTrials, deviation = std::sqrt(squares / kTrials - mean * mean) / mean;
  EXPECT_NEAR(deviation / said, 1.05, 0.25);
}

TEST(Error, AConstantOrBlackPictureHasNone) {
  for (const float level : {0.0f, 0.1f}) {
    std::vector<PixelStats> picture;
    PixelAccumulator pixel({0, 64});
    while (!pixel.complete()) pixel.push(leaf(Rgb(level), {}, pixel.next_index()));
    picture.assign(5, pixel.result());
    const auto error = estimate_error(picture, {0, 64});
    EXPECT_NEAR(error.relative_error->value, 0, 1e-15);
    EXPECT_NEAR(*error.image_mean_half_width, 0, 1e-15);
    EXPECT_EQ(*error.firefly_share, 0);
  }
}

TEST(Error, CountsFirefliesAndLeavesMissingPixelsOut) {
  Stream random(4);
  auto picture = noisy_picture(20, {0, 256}, 1, random);
  PixelAccumulator pixel({0, 256});
  while (!pixel.complete()) pixel.push(leaf(Rgb(pixel.next_index() == 77 ? 1e6f : 1), {}, pixel.next_index()));
  picture.push_back(pixel.result());
  picture.push_back({});
  const auto error = estimate_error(picture, {0, 256});
  EXPECT_DOUBLE_EQ(*error.firefly_share, 1.0 / 21);
  EXPECT_EQ(error.pixels, 21);
  EXPECT_EQ(error.missing_pixels, 1);
  EXPECT_THAT(format_error(error), HasSubstr("1 pixels miss samples"));
}

TEST(Error, PredictsTheSamplesForLessErrorFromSlopeMinusOneInMse) {
  EXPECT_EQ(samples_for(64, 0.5), 256);
  EXPECT_EQ(samples_for(64, 0.25), 1024);
  EXPECT_EQ(samples_for(64, 0.1), 6400);
  EXPECT_EQ(samples_for(kMaxSamples / 2, 0.1), kMaxSamples);
}

TEST(Error, OfAFileIsThatOfItsPicture) {
  testing::TemporaryFolder folder;
  const auto nodes = testing::render_nodes({0, 0, 9, 140}, {0, 16});
  write_exr(folder / "frame.exr", testing::some_header(9, 140), nodes);
  const auto a = error_fields(estimate_error(folder / "frame.exr")), b = error_fields(estimate_error(nodes[0].pixels, {0, 16}));
  EXPECT_EQ(a, b);
  EXPECT_GE(a.size(), 11u);
}

TEST(Error, OfThePrefixesIsThatOfTheirPictures) {
  // 9 × 140 pixels in two tiles, and samples in nodes that meet at 4, 8 and 16.
  testing::TemporaryFolder folder;
  const auto header = testing::some_header(9, 140);
  std::vector<std::filesystem::path> tiles;
  for (const PixelRect rect : {PixelRect{0, 0, 9, 75}, PixelRect{0, 75, 9, 140}})
    for (const SampleRange range : {SampleRange{0, 2}, {2, 4}, {4, 8}, {8, 16}, {16, 18}}) {
      tiles.push_back(folder / (std::to_string(tiles.size()) + ".exr"));
      const Tile tile = testing::render_tile(rect, range);
      write_exr(tiles.back(), header, {&tile, 1});
    }
  const std::vector<int64_t> counts{4, 8, 16};
  const std::vector<ErrorEstimate> errors = estimate_prefixes(tiles, counts);
  ASSERT_EQ(errors.size(), counts.size());
  for (size_t i = 0; i < counts.size(); ++i) {
    const Tile picture = testing::render_tile({0, 0, 9, 140}, {0, counts[i]});
    EXPECT_EQ(error_fields(errors[i]), error_fields(estimate_error(picture.pixels, picture.range))) << counts[i];
  }
  EXPECT_THAT(testing::message_of([&] { estimate_prefixes(std::span(tiles).subspan(1), counts); }), HasSubstr("leave out samples"));
}

TEST(Error, IsReadFromItsFieldsAndNonsenseIsRefused) {
  for (const int64_t n : {1, 2, 5, 16, 256}) {
    Stream random(static_cast<uint64_t>(n));
    const ErrorEstimate error = estimate_error(noisy_picture(30, {0, n}, 1, random), {0, n});
    const auto fields = error_fields(error);
    const ErrorEstimate read = error_from_fields({fields.begin(), fields.end()});
    EXPECT_EQ(error_fields(read), fields);
    EXPECT_EQ(read.degrees, error.degrees);
  }
  std::map<std::string, double> fields{{"samples", 16}, {"pixels", 4}, {"missing_pixels", 0}, {"image_mean", 1}};
  EXPECT_EQ(error_from_fields(fields).samples, 16);
  fields["relative_error"] = 0.1;  // without relative_mse and mse_deviation
  EXPECT_THROW(error_from_fields(fields), std::invalid_argument);
  fields.erase("relative_error");
  fields["pixels"] = -1;
  EXPECT_THROW(error_from_fields(fields), std::invalid_argument);
  fields["pixels"] = 4;
  fields["image_mean"] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(error_from_fields(fields), std::invalid_argument);
}

}  // namespace
}  // namespace woodcock
