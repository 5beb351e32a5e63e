// What FrameRenderer promises to the command and the workers.
#include "renderer/frame/frame_renderer.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "renderer/scene/scene_error.h"
#include "tests/support/run_command.h"

namespace woodcock::testing {
namespace {

using ::testing::HasSubstr;

const std::string kCamera =
    "LookAt 0 0 4 0 0 0 0 1 0\nCamera \"perspective\" \"float fov\" 40\nPixelFilter \"box\"\n"
    "Sampler \"independent\" \"integer pixelsamples\" 12 \"integer seed\" 5\n";
const std::string kFilm = "Film \"rgb\" \"integer xresolution\" 12 \"integer yresolution\" 8\n";
const std::string kWorld =
    "WorldBegin\nLightSource \"infinite\" \"rgb L\" [ 1 1 1 ]\nMaterial \"diffuse\" \"rgb reflectance\" [ .5 .5 .5 ]\n"
    "Shape \"sphere\" \"float radius\" 1\n";

class Frame : public ::testing::Test {
 protected:
  FrameRenderer load(const std::string& text, const FrameSettings& settings = {}) {
    const auto path = folder_ / fmt::format("scene{}.pbrt", count_++);
    std::ofstream(path) << text;
    ReadOptions options;
    options.warn = [this](const std::string& note) { notes_.push_back(note); };
    return FrameRenderer(path.string(), settings, options);
  }
  /// The message of the std::invalid_argument that loading throws.
  std::string refusal(const FrameSettings& settings) {
    try {
      load(kCamera + kFilm + kWorld, settings);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  }
  static Tile render(const FrameRenderer& frame, SampleRange range, int threads = 1) {
    RenderProgress progress;
    return *frame.render(frame.header().bounds, range, threads, progress);
  }
  static bool same_bits(const Tile& a, const Tile& b) {
    using Bits = std::array<uint32_t, sizeof(PixelStats) / 4>;
    return std::equal(a.pixels.begin(), a.pixels.end(), b.pixels.begin(), b.pixels.end(),
                      [](const PixelStats& p, const PixelStats& q) { return std::bit_cast<Bits>(p) == std::bit_cast<Bits>(q); });
  }

  TemporaryFolder folder_;
  int count_ = 0;
  std::vector<std::string> notes_;
};

TEST_F(Frame, HeaderSaysWhatWasRendered) {
  FrameSettings settings;
  settings.resolution = {{24, 16}};
  settings.crop = {{2, 20, 3, 9}};
  settings.seed = 77;
  settings.frame = 4;
  settings.max_depth = 9;
  settings.samples = 64;
  const FrameRenderer frame = load(kCamera + kFilm + kWorld, settings);
  const FrameHeader& h = frame.header();
  EXPECT_EQ(h.width, 24);
  EXPECT_EQ(h.height, 16);
  EXPECT_EQ(h.bounds, (PixelRect{2, 3, 20, 9}));
  EXPECT_EQ(h.seed, 77u);
  EXPECT_EQ(h.frame, 4u);
  EXPECT_EQ(h.scene_digest, frame.description().digest);
  EXPECT_EQ(h.build, render_build());
  EXPECT_EQ(h.arithmetic_class, arithmetic_class());
  EXPECT_THAT(h.settings, ::testing::Contains(std::pair<std::string, std::string>("max_depth", "9")));
  EXPECT_EQ(frame.samples(), 64);
}

TEST_F(Frame, SettingsDigestCoversWhatChangesRadianceAndNothingElse) {
  const std::string text = kCamera + kFilm + kWorld;
  const std::string reference = load(text).header().settings_digest;
  FrameSettings samples, depth;
  samples.samples = 1000;
  depth.max_depth = 6;
  EXPECT_EQ(load(text, samples).header().settings_digest, reference);
  EXPECT_NE(load(text, depth).header().settings_digest, reference);
}

TEST_F(Frame, SettingsThatMakeNoSenseAreRefusedByName) {
  FrameSettings s;
  s.resolution = {{0, 5}};
  EXPECT_THAT(refusal(s), HasSubstr("resolution: found 0x5"));
  s = {};
  s.resolution = {{70000, 5}};
  EXPECT_THAT(refusal(s), HasSubstr("65536"));
  for (const std::array<int, 4> crop : {std::array{-1, 3, 0, 3}, {3, 3, 0, 3}, {0, 13, 0, 3}, {0, 3, 5, 2}}) {
    s = {};
    s.crop = crop;
    EXPECT_THAT(refusal(s), HasSubstr("crop: found")) << crop[0];
  }
  s = {};
  s.samples = 0;
  EXPECT_THAT(refusal(s), HasSubstr("spp: found 0"));
  s = {};
  s.max_depth = -1;
  EXPECT_THAT(refusal(s), HasSubstr("max-depth: found -1"));
  s = {};
  s.estimator = "magic";
  EXPECT_THAT(refusal(s), HasSubstr("estimator: found \"magic\""));
}

TEST_F(Frame, RangesThatAreNoNodeAndRectanglesOutsideAreRefused) {
  const FrameRenderer frame = load(kCamera + kFilm + kWorld);
  RenderProgress progress;
  EXPECT_THROW(frame.render(frame.header().bounds, {0, 3}, 1, progress), std::invalid_argument);
  EXPECT_THROW(frame.render(frame.header().bounds, {2, 6}, 1, progress), std::invalid_argument);
  EXPECT_THROW(frame.render({0, 0, 13, 8}, {0, 4}, 1, progress), std::invalid_argument);
  EXPECT_THROW(frame.render(frame.header().bounds, {0, 4}, 0, progress), std::invalid_argument);
}

TEST_F(Frame, BitsDoNotDependOnThreadsNorOnTheRectangle) {
  const FrameRenderer frame = load(kCamera + kFilm + kWorld);
  const Tile whole = render(frame, {0, 16});
  for (const int threads : {2, 5}) EXPECT_TRUE(same_bits(render(frame, {0, 16}, threads), whole)) << threads;
  RenderProgress progress;
  const Tile part = *frame.render({3, 2, 7, 5}, {0, 16}, 2, progress);
  for (int y = 2; y < 5; ++y)
    for (int x = 3; x < 7; ++x)
      EXPECT_EQ(part.pixels[static_cast<size_t>((y - 2) * 4 + x - 3)].mean, whole.pixels[static_cast<size_t>(y * 12 + x)].mean);
}

TEST_F(Frame, SamplesBeyondThirtyTwoBitsAreSamplesOfTheirOwn) {
  const FrameRenderer frame = load(kCamera + kFilm + kWorld);
  const int64_t far = int64_t{1} << 33;
  const Tile near = render(frame, {0, 8}), beyond = render(frame, {far, far + 8});
  EXPECT_EQ(beyond.range.begin, far);
  EXPECT_FALSE(same_bits(near, beyond));
  EXPECT_TRUE(same_bits(beyond, render(frame, {far, far + 8}, 2)));
}

TEST_F(Frame, ProgressCountsEverySampleAndVertex) {
  const FrameRenderer frame = load(kCamera + kFilm + kWorld);
  RenderProgress progress;
  frame.render(frame.header().bounds, {0, 128}, 2, progress);
  EXPECT_EQ(progress.samples, 12u * 8 * 128);
  EXPECT_EQ(progress.counters.paths, 12u * 8 * 128);
  EXPECT_EQ(progress.bounces, progress.counters.vertices);
  EXPECT_GT(progress.bounces, 0u);
}

// One sample of this scene takes a million scatterings; cancelling must not wait for it.
TEST_F(Frame, CancelEndsARenderInTheMiddleOfAPath) {
  FrameSettings settings;
  settings.max_depth = 2000000000;
  const FrameRenderer frame = load(
      "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [ 0 0 0 ] \"rgb sigma_s\" [ 1 1 1 ]\nMediumInterface \"\" "
      "\"m\"\n" +
          kCamera + kFilm + "WorldBegin\nLightSource \"infinite\"\n",
      settings);
  RenderProgress progress;
  std::optional<Tile> result;
  std::thread renderer([&] { result = frame.render(frame.header().bounds, {0, 1}, 1, progress); });
  while (progress.bounces < 5000) std::this_thread::sleep_for(std::chrono::milliseconds(1));  // it moves within the first path
  progress.cancel = true;
  renderer.join();
  EXPECT_FALSE(result.has_value());
  EXPECT_LT(progress.samples, 2u);
}

TEST_F(Frame, SamplesThatAreNotFiniteCountAsZeroAndAreReported) {
  // The brightest lamp that a float holds, on a white floor from close by.
  const FrameRenderer frame =
      load(kCamera + kFilm + "WorldBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ 1 1 1 ]\nShape \"sphere\" \"float radius\" 1\n" +
           "LightSource \"point\" \"point3 from\" [ 0 0 1.01 ] \"rgb I\" [ 3e38 3e38 3e38 ]\n");
  RenderProgress progress;
  const Tile tile = *frame.render(frame.header().bounds, {0, 16}, 1, progress);
  EXPECT_GT(progress.counters.nonfinite, 0u);
  for (const PixelStats& p : tile.pixels) {
    EXPECT_TRUE(is_finite(p.mean));
    EXPECT_EQ(p.count, 16);
  }
}

TEST_F(Frame, MaxComponentValueCutsSamplesAndCountsThem) {
  const std::string film = "Film \"rgb\" \"integer xresolution\" 12 \"integer yresolution\" 8 \"float maxcomponentvalue\" ";
  const std::string bright = "WorldBegin\nLightSource \"infinite\" \"rgb L\" [ 4 2 1 ]\n";
  const FrameRenderer cut = load(kCamera + film + "2\n" + bright), whole = load(kCamera + film + "4\n" + bright);
  RenderProgress progress;
  const Tile tile = *cut.render(cut.header().bounds, {0, 16}, 1, progress);
  EXPECT_EQ(progress.counters.clamped, 12u * 8 * 16);
  for (const PixelStats& p : tile.pixels) EXPECT_EQ(p.mean, Rgb(2, 1, 0.5f));  // the hue is kept
  RenderProgress untouched;
  EXPECT_EQ(whole.render(whole.header().bounds, {0, 16}, 1, untouched)->pixels[0].mean, Rgb(4, 2, 1));
  EXPECT_EQ(untouched.counters.clamped, 0u);
}

TEST_F(Frame, MaxComponentValueCutsUnderNegativeFilterLobesToo) {
  const std::string scene =
      "LookAt 0 0 4 0 0 0 0 1 0\nCamera \"perspective\"\nPixelFilter \"mitchell\"\n"
      "Film \"rgb\" \"integer xresolution\" 4 \"integer yresolution\" 4 \"float maxcomponentvalue\" 1\n"
      "WorldBegin\nLightSource \"infinite\" \"rgb L\" [ 9 9 9 ]\n";
  const FrameRenderer frame = load(scene);
  RenderProgress progress;
  const Tile tile = *frame.render(frame.header().bounds, {0, 1024}, 1, progress);
  EXPECT_EQ(progress.counters.clamped, 16u * 1024);
  // The filter's weights average to one: 5 standard errors of their spread, below 0.6 for this filter.
  for (const PixelStats& p : tile.pixels) EXPECT_NEAR(p.mean.r, 1, 5 * 0.6 / 32);
}

TEST_F(Frame, ImageScaleMultipliesRadiance) {
  const std::string film =
      "Film \"rgb\" \"integer xresolution\" 4 \"integer yresolution\" 4 \"float iso\" 300 \"string sensor\" \"cie1931\"\n";
  const FrameRenderer frame = load(kCamera + film + "WorldBegin\nLightSource \"infinite\" \"rgb L\" [ 1 2 3 ]\n");
  const float scale = frame.description().film.image_scale;
  EXPECT_NE(scale, 1);
  EXPECT_EQ(render(frame, {0, 1}).pixels[0].mean, scale * Rgb(1, 2, 3));
}

TEST_F(Frame, NotesOfTheWorldReachTheUser) {
  load("MakeNamedMedium \"m\" \"string type\" \"homogeneous\"\nMediumInterface \"\" \"m\"\n" + kCamera + kFilm +
       "WorldBegin\nMaterial \"interface\"\nShape \"sphere\" \"float radius\" 9\n");
  EXPECT_THAT(notes_, ::testing::Contains(HasSubstr("the camera's MediumInterface")));
}

}  // namespace
}  // namespace woodcock::testing
