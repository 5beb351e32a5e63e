// The example scenes against stored pictures: mean and standard deviation of every pixel at many samples, made by another
// route (pictures/README.md). A z-test with the level corrected for the number of comparisons (Šidák 1967), as in Mitsuba's
// test_renders.
//
// Pixels are compared in blocks whose means of more than ten thousand samples are near enough to normal where single pixels
// with rare bright samples are not, and as a whole. Of the stored picture it is the deviation that is used for both, since it
// is the better known one. False alarms: 1e-4 a scene. Power: a bias of four standard errors of a block, or of the picture's
// mean, is found more often than not; the test prints what that is.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "renderer/accuracy/student.h"
#include "renderer/film/exr.h"
#include "renderer/frame/frame_renderer.h"

namespace woodcock {
namespace {

constexpr double kFalseAlarmRate = 1e-4;
constexpr int kBlock = WOODCOCK_PICTURE_SAMPLES < 4096 ? 8 : 4;

/// Mean and its standard error, channel by channel.
struct Known {
  DVec3 mean{0}, variance{0};  ///< of the mean
};

/// The mean of pixels [x0, x1) × [y0, y1) of a picture of `samples` samples a pixel, whose deviations are those of `reference`.
Known mean_of(const std::vector<PixelStats>& picture, const std::vector<PixelStats>& reference, int width, PixelRect r, double samples) {
  Known known;
  const double n = (r.x1 - r.x0) * (r.y1 - r.y0);
  for (int y = r.y0; y < r.y1; ++y)
    for (int x = r.x0; x < r.x1; ++x) {
      const auto i = static_cast<size_t>(y * width + x);
      const DVec3 deviation(reference[i].deviation);
      known.mean += DVec3(picture[i].mean) / n;
      known.variance += deviation * deviation / (samples * n * n);
    }
  return known;
}

class StoredPicture : public testing::TestWithParam<std::string> {};

TEST_P(StoredPicture, IsMetWithinNoise) {
  ExrReader stored(std::filesystem::path(WOODCOCK_SOURCE_DIR "/tests/statistical/pictures/" + GetParam() + ".exr"));
  const FrameHeader& header = stored.info().header;
  const int width = header.width, height = header.height;
  const std::vector<PixelStats> reference = stored.beauty_rows(0, height);

  FrameSettings settings;
  settings.resolution = {{width, height}};
  settings.seed = header.seed + 1;
  settings.samples = WOODCOCK_PICTURE_SAMPLES;
  const FrameRenderer frame(WOODCOCK_SOURCE_DIR "/scenes/" + GetParam() + ".pbrt", settings, ReadOptions{});
  ASSERT_EQ(frame.header().scene_digest, header.scene_digest)
      << "the scene is not the one of the stored picture; pictures/README.md says how a new one is made";
  RenderProgress progress;
  const auto tile = frame.render(frame.header().bounds, {0, *settings.samples}, 1, progress);
  ASSERT_TRUE(tile.has_value());
  EXPECT_EQ(progress.counters.nonfinite + progress.counters.truncated + progress.counters.majorant_violations, 0u);

  std::vector<PixelRect> regions{{0, 0, width, height}};
  for (int y = 0; y < height; y += kBlock)
    for (int x = 0; x < width; x += kBlock) regions.push_back({x, y, std::min(x + kBlock, width), std::min(y + kBlock, height)});
  // P(any of n exceeds) = rate where each does with 1 − (1 − rate)^(1/n).
  const double level = -std::expm1(std::log1p(-kFalseAlarmRate) / (3.0 * static_cast<double>(regions.size())));
  const double z_allowed = student_quantile(1 - level / 2, 1e6);
  double worst = 0;
  for (const PixelRect& r : regions) {
    const Known a = mean_of(tile->pixels, reference, width, r, static_cast<double>(*settings.samples)),
                b = mean_of(reference, reference, width, r, static_cast<double>(reference[0].count));
    for (int c = 0; c < 3; ++c) {
      const double error = std::sqrt(a.variance[c] + b.variance[c]), difference = a.mean[c] - b.mean[c];
      // Rounding of float32 means, and blocks that every sample sees alike.
      const double z = difference / (error + 2e-6 * std::abs(b.mean[c]) + 1e-12);
      worst = std::max(worst, std::abs(z));
      EXPECT_LE(std::abs(z), z_allowed) << fmt::format("pixels {}..{} x {}..{}, channel {}: {:.6g}, stored {:.6g} ± {:.2g}", r.x0, r.x1,
                                                       r.y0, r.y1, c, a.mean[c], b.mean[c], error);
    }
    if (&r == &regions[0])
      std::printf("%s: whole picture %.5g, stored %.5g ± %.2g (relative)\n", GetParam().c_str(), a.mean.g, b.mean.g,
                  std::sqrt(a.variance.g + b.variance.g) / b.mean.g);
  }
  std::printf("%s: largest |z| %.2f of %zu comparisons, %.2f allowed\n", GetParam().c_str(), worst, 3 * regions.size(), z_allowed);
}

INSTANTIATE_TEST_SUITE_P(Scenes, StoredPicture, testing::Values("sphere", "cornell", "milk", "cloud", "fire", "fog", "effects"),
                         [](const auto& scene) { return scene.param; });

}  // namespace
}  // namespace woodcock
