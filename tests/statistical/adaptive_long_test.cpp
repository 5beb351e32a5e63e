// What stopping by the error reached does to the picture: is it still unbiased, do its intervals still hold, is the error what was
// asked for? Against references of 16 to 100 times
// the samples, whose own noise counts against the picture. Minutes: label `long`. docs/accuracy.md has the figures.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <thread>

#include "renderer/accuracy/error.h"
#include "renderer/accuracy/student.h"
#include "renderer/film/picture_file.h"
#include "renderer/frame/adaptive_frame.h"
#include "tests/film/random_tiles.h"

namespace woodcock {
namespace {

FrameRenderer frame_of(const std::string& scene, std::array<int, 2> resolution, uint64_t seed) {
  FrameSettings settings;
  settings.resolution = resolution;
  settings.seed = seed;
  return FrameRenderer(std::string(WOODCOCK_SOURCE_DIR) + "/scenes/" + scene + ".pbrt", settings, ReadOptions{});
}

PassSetting all_threads() {
  PassSetting setting;
  setting.threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  return setting;
}

BlockFrame uniform(const FrameRenderer& frame, int64_t samples) {
  BlockFrame blocks(frame.header().bounds);
  RenderProgress progress;
  double cpu_seconds = 0;
  render_pass(frame, std::vector<int64_t>(blocks.map.counts.size(), samples), all_threads(), progress, blocks, cpu_seconds);
  return blocks;
}

BlockFrame adaptive(const FrameRenderer& frame, double error) {
  BlockFrame blocks(frame.header().bounds);
  RenderProgress progress;
  double cpu_seconds = 0;
  const AdaptiveProgress end = render_adaptively(frame, {error, 1 << 16}, all_threads(), progress, blocks, cpu_seconds);
  EXPECT_EQ(end.end, EndOfSampling::kTargetReached);
  return blocks;
}

/// The luminance of every pixel, block by block.
std::vector<double> luminances(const BlockFrame& blocks) {
  std::vector<double> values;
  for (const auto& picture : blocks.picture)
    for (const PixelStats& pixel : picture) values.push_back(static_cast<double>(film::sample_luminance(pixel.mean)));
  return values;
}

double mean_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

/// Squared standard error of the mean.
double variance_of_mean_of(const std::vector<double>& values) {
  const double mean = mean_of(values);
  double squares = 0;
  for (const double v : values) squares += (v - mean) * (v - mean);
  const auto n = static_cast<double>(values.size());
  return squares / (n * (n - 1));
}

// With 200 seeds a right renderer's coverage lies within 92 and 98 % in 95 of 100 choices of seeds; these seeds are fixed. |z| < 3 fails
// one time in 370.
TEST(AdaptiveLong, StoppingByTheErrorNeitherBiasesThePictureNorItsIntervals) {
  constexpr int kSeeds = 200;
  constexpr std::array<int, 2> kResolution{64, 36};
  std::vector<double> reference, uniform_means;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const std::vector<double> values = luminances(uniform(frame_of("cornell", kResolution, static_cast<uint64_t>(1000 + seed)), 128));
    reference.resize(values.size(), 0);
    for (size_t p = 0; p < values.size(); ++p) reference[p] += values[p] / kSeeds;
    uniform_means.push_back(mean_of(values));
  }
  const double truth = mean_of(reference), t = student_quantile(0.975, kReplicates - 1);
  testing::TemporaryFolder folder;
  std::vector<double> means;
  int covered = 0;
  int64_t pixels = 0, pixels_covered = 0;
  double samples = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const FrameRenderer frame = frame_of("cornell", kResolution, static_cast<uint64_t>(seed));
    const BlockFrame blocks = adaptive(frame, 0.03);
    write_blocks(folder / "a.exr", frame.header(), blocks);
    const ErrorEstimate error = estimate_error(nodes_path(folder / "a.exr"));
    means.push_back(mean_of(luminances(blocks)));
    samples += static_cast<double>(blocks.map.samples()) / static_cast<double>(frame.header().bounds.area()) / kSeeds;
    covered += std::abs(error.image_mean - truth) <= *error.image_mean_half_width;
    PixelWeights weights = PixelWeights::by_count();
    size_t p = 0;
    for (const auto& picture : blocks.picture)
      for (const PixelStats& pixel : picture) {
        const double off = std::abs(static_cast<double>(film::sample_luminance(pixel.mean)) - reference[p++]);
        if (pixel.count < 256) continue;
        ++pixels;
        pixels_covered += off <= t * std::sqrt(variance_of_mean(pixel, weights.of(pixel)));
      }
  }
  const double z = (mean_of(means) - mean_of(uniform_means)) / std::sqrt(variance_of_mean_of(means) + variance_of_mean_of(uniform_means));
  const double image = static_cast<double>(covered) / kSeeds, pixel = static_cast<double>(pixels_covered) / static_cast<double>(pixels);
  std::cout << "adaptive " << mean_of(means) << ", uniform " << mean_of(uniform_means) << ", z = " << z << "; image mean covered in "
            << 100 * image << " %, pixels from 256 samples on (" << pixels << ") in " << 100 * pixel << " %; " << samples
            << " samples per pixel on average\n";
  EXPECT_LT(std::abs(z), 3);
  EXPECT_GE(image, 0.92);
  EXPECT_LE(image, 0.98);
  EXPECT_GE(pixel, 0.92);
  EXPECT_LE(pixel, 0.98);
}

class TargetHolds : public ::testing::TestWithParam<const char*> {};

// One picture of 2304 pixels tells its E to some 3 % where the noise is light-tailed.
TEST_P(TargetHolds, WithinATenthOrBelow) {
  constexpr double kTarget = 0.06;
  constexpr std::array<int, 2> kResolution{64, 36};
  const BlockFrame blocks = adaptive(frame_of(GetParam(), kResolution, 7), kTarget);
  const int64_t most = blocks.map.largest();
  const std::vector<double> picture = luminances(blocks), reference = luminances(uniform(frame_of(GetParam(), kResolution, 8), 16 * most));
  const double floor = 0.01 * mean_of(reference);
  double square = 0;
  for (size_t p = 0; p < picture.size(); ++p)
    square += (picture[p] - reference[p]) * (picture[p] - reference[p]) / (reference[p] * reference[p] + floor * floor);
  const double error = std::sqrt(square / static_cast<double>(picture.size()));
  std::cout << GetParam() << ": " << 100 * error << " % against a reference of " << 16 * most << " samples, " << 100 * kTarget
            << " % asked for; counts " << *std::min_element(blocks.map.counts.begin(), blocks.map.counts.end()) << " to " << most << "\n";
  EXPECT_LT(error, 1.1 * kTarget);
}

INSTANTIATE_TEST_SUITE_P(Scenes, TargetHolds, ::testing::Values("cloud", "cornell", "fire"), [](const auto& scene) { return scene.param; });

}  // namespace
}  // namespace woodcock
