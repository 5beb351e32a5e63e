// What becomes of samples in a whole render: threads, samples without a value, bright samples; and the arithmetic that the
// renderer is built with.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "renderer/accuracy/adaptive.h"
#include "renderer/core/arithmetic.h"
#include "renderer/frame/frame_renderer.h"
#include "tests/hard_cases/unsafe_arithmetic.h"
#include "tests/scene/scene_folder.h"

namespace woodcock::testing {
namespace {

using ::testing::HasSubstr;

std::string camera(int width, int height, double fov = 40) {
  return fmt::format(
      "LookAt 0 0 4 0 0 0 0 1 0\nCamera \"perspective\" \"float fov\" {}\nPixelFilter \"box\"\n"
      "Film \"rgb\" \"integer xresolution\" {} \"integer yresolution\" {}\nIntegrator \"volpath\" \"integer maxdepth\" 20\n",
      fov, width, height);
}

struct Rendered {
  Tile tile;
  PathCounters counters;
};
/// All pixels of a scene text; `samples` is a power of two.
Rendered render(const std::string& text, int64_t samples, int threads = 1) {
  const SceneFolder folder;
  const FrameRenderer frame(folder.write("scene.pbrt", text), {}, {});
  RenderProgress progress;
  const auto tile = frame.render(frame.header().bounds, {0, samples}, threads, progress);
  if (!tile) throw std::runtime_error("the render was cancelled");
  return {*tile, progress.counters};
}

TEST(HardCases, N36_a_constant_scene_is_rendered_to_the_bit) {
  for (const float value : {0.1f, 0.7f, 3.3e7f}) {
    const Rendered r =
        render(camera(4, 4) + fmt::format("WorldBegin\nLightSource \"infinite\" \"rgb L\" [ {0:.9g} {0:.9g} {0:.9g} ]\n", value), 1 << 16);
    for (const PixelStats& p : r.tile.pixels) {
      EXPECT_EQ(p.mean, Rgb(value));
      EXPECT_EQ(p.deviation, Rgb(0));
    }
  }
}

// A lamp of 1 mm one metre above a floor that it lights with 80 times what the brightest display shows: nothing is clamped
// unless the scene asks for it. The floor's radiance is ρ L (r/h)², but for the cosine over the 0.3° that the picture covers.
TEST(HardCases, N38_bright_samples_are_not_clamped_unless_asked_for) {
  const std::string head = "LookAt 0 0.5 0 0 0 0 0 0 1\nCamera \"perspective\" \"float fov\" 0.3\nPixelFilter \"box\"\n";
  const std::string world =
      "WorldBegin\nAttributeBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ .8 .8 .8 ]\nRotate -90 1 0 0\nShape \"disk\" \"float "
      "radius\" "
      "5\nAttributeEnd\nAreaLightSource \"diffuse\" \"rgb L\" [ 1e8 1e8 1e8 ]\nTranslate 0 1 0\nShape \"sphere\" \"float radius\" 1e-3\n";
  const std::string film = "Film \"rgb\" \"integer xresolution\" 2 \"integer yresolution\" 2";
  const Rendered whole = render(head + film + "\n" + world, 256);
  EXPECT_EQ(whole.counters.clamped, 0u);
  for (const PixelStats& p : whole.tile.pixels) EXPECT_NEAR(p.mean.g, 80, 0.1);
  const Rendered clamped = render(head + film + " \"float maxcomponentvalue\" 10\n" + world, 256);
  EXPECT_GT(clamped.counters.clamped, 900u);
  for (const PixelStats& p : clamped.tile.pixels) EXPECT_LE(p.mean.g, 10);
}

// A quarter of the samples meets a white floor next to a lamp, the others see one that glows with 1. The brightest lamp that
// a float holds makes samples overflow: they count as zero in n, so that the picture is that of a lamp that is off.
TEST(HardCases, N40_samples_without_a_value_count_as_zero_and_are_reported) {
  const auto scene = [](float intensity) {
    return camera(4, 4, 1) +
           "WorldBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ 1 1 1 ]\nShape \"disk\" \"float radius\" 40 \"float alpha\" 0.25\n" +
           fmt::format("LightSource \"point\" \"point3 from\" [ 0 0 1e-3 ] \"rgb I\" [ {0:.9g} {0:.9g} {0:.9g} ]\n", intensity) +
           "AttributeBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\nAreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ]\nTranslate "
           "0 0 -1\nShape \"disk\" \"float radius\" "
           "400\nAttributeEnd\n";
  };
  constexpr int64_t kSamples = 4096;
  const Rendered lit = render(scene(3e38f), kSamples), dark = render(scene(0), kSamples);
  EXPECT_GT(lit.counters.nonfinite, 10000u);
  EXPECT_EQ(dark.counters.nonfinite, 0u);
  for (size_t i = 0; i < lit.tile.pixels.size(); ++i) {
    const PixelStats &p = lit.tile.pixels[i], &q = dark.tile.pixels[i];
    EXPECT_EQ(p.count, kSamples);
    EXPECT_EQ(p.mean, q.mean);
    EXPECT_EQ(p.deviation, q.deviation);
    EXPECT_NEAR(p.mean.g, 0.75, 5 * std::sqrt(0.75 * 0.25 / kSamples));
  }
}

// Long enough that every thread gets its share, also on a busy machine.
TEST(HardCases, N47_any_number_of_threads_gives_the_same_bits) {
  std::string density;
  Stream random(3);
  for (int i = 0; i < 216; ++i) density += random.uniform() < 0.5f ? " 0" : fmt::format(" {:.4g}", 4 * random.uniform());
  const std::string text =
      camera(24, 16) +
      "WorldBegin\nLightSource \"infinite\" \"rgb L\" [ .5 .6 .7 ]\nLightSource \"point\" \"point3 from\" [ 2 2 2 ] \"rgb I\" [ 9 9 9 ]\n"
      "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 6 \"integer ny\" 6 \"integer nz\" 6 \"point3 p0\" [ -1 -1 -1 ] "
      "\"point3 p1\" [ 1 1 1 ] \"rgb sigma_a\" [ .1 .2 .3 ] \"rgb sigma_s\" [ 1 2 3 ] \"rgb Le\" [ .1 .1 .1 ] \"float g\" 0.5 \"float "
      "density\" [" +
      density +
      " ]\nAttributeBegin\nMaterial \"interface\"\nMediumInterface \"m\" \"\"\nShape \"sphere\" \"float radius\" 1\nAttributeEnd\n"
      "Material \"coateddiffuse\"\nTranslate 0 -2.2 0\nShape \"sphere\" \"float radius\" 1\n";
  const Tile one = render(text, 128, 1).tile;
  for (const int threads : {2, 3, 7}) {
    const Tile many = render(text, 128, threads).tile;
    EXPECT_EQ(std::memcmp(many.pixels.data(), one.pixels.data(), one.pixels.size() * sizeof(PixelStats)), 0) << threads << " threads";
  }
}

/// Every compilation of renderer/ that the build does, as its command line.
std::vector<std::string> renderer_commands() {
  std::vector<std::string> commands;
  std::ifstream file(WOODCOCK_COMPILE_COMMANDS);
  for (const auto& entry : nlohmann::json::parse(file)) {
    const std::string source = entry.at("file");
    if (source.starts_with(WOODCOCK_SOURCE_DIR "/renderer/")) commands.push_back(entry.at("command"));
  }
  return commands;
}

TEST(HardCases, N53_nan_is_found_and_bits_do_not_depend_on_the_compiler_s_liberties) {
  EXPECT_EQ(arithmetic_fault(), nullptr);
  // The same question asked of code that was built with -ffast-math.
  ASSERT_NE(fault_of_fast_arithmetic(), nullptr);
  EXPECT_THAT(fault_of_fast_arithmetic(), HasSubstr("NaN"));
  const std::vector<std::string> commands = renderer_commands();
  EXPECT_GT(commands.size(), 50u);
  for (const std::string& command : commands) {
    for (const char* flag : {"-ffp-contract=off", "-march=x86-64-v3"}) EXPECT_THAT(command, HasSubstr(flag));
    for (const char* flag :
         {"-ffast-math", "-Ofast", "-funsafe-math", "-ffinite-math", "-fassociative-math", "-freciprocal-math", "-march=native"})
      EXPECT_THAT(command, ::testing::Not(HasSubstr(flag)));
  }
}

TEST(HardCases, N59_a_black_block_is_not_done_before_its_least_count_nor_against_its_neighbours) {
  // Two blocks of 32 × 32 pixels, the left one black so far, the right one lit and noisy.
  constexpr int64_t kPixels = 1024;
  const auto decision = [&](int64_t count, double relative_variance, double target) {
    const SampleMap map{{0, 0, 64, 32}, {count, count}};
    const std::vector<BlockStatistics> blocks{{kPixels, 0, 0}, {kPixels, 0.5 * kPixels, relative_variance * kPixels}};
    return decide(map, blocks, {}, {target, 4096});
  };
  // The target is met, and yet black is looked at again.
  const Decision met = decision(16, 1e-6, 0.5);
  EXPECT_TRUE(met.reached);
  EXPECT_EQ(met.counts, (std::vector<int64_t>{32, 16}));
  EXPECT_TRUE(decision(32, 1e-6, 0.5).done());
  // The target is far: what the neighbour sees may be light that the black block missed.
  const Decision far = decision(32, 0.04, 0.02);
  EXPECT_GT(far.counts[0], 32);
  EXPECT_GT(far.counts[1], 32);
}

}  // namespace
}  // namespace woodcock::testing
