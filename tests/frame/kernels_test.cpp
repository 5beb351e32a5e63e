// The effect plan is kept: a kernel compiled for a scene's effects computes what the full one does, without a plan the
// expectation is the same, and what a scene does not call for is not done.
#include "renderer/transport/kernels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "renderer/frame/frame_renderer.h"
#include "renderer/transport/render_plan.h"
#include "tests/support/run_command.h"

namespace woodcock::testing {
namespace {

namespace fs = std::filesystem;

/// Every scene that the project shows, by its path below scenes/.
std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  const fs::path folder = fs::path(WOODCOCK_SOURCE_DIR) / "scenes";
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".pbrt" || entry.path().parent_path().filename() == "data") continue;
    names.push_back(fs::relative(entry.path(), folder).string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

FrameRenderer load(const std::string& name, const FrameSettings& settings = {}) {
  ReadOptions options;
  options.allow_outside_files = true;
  return FrameRenderer((fs::path(WOODCOCK_SOURCE_DIR) / "scenes" / name).string(), settings, options);
}

PathSettings settings_of(const FrameRenderer& frame) {
  PathSettings settings;
  settings.frame_seed = frame_seed(3, 0);
  settings.max_depth = frame.description().settings.max_depth;
  return settings;
}

/// Radiances of `samples` paths spread over the image.
std::vector<Rgb> radiances(const FrameRenderer& frame, const PathSettings& settings, RadianceFunction function, int samples,
                           PathCounters& count) {
  const RenderPlan plan(frame.world(), settings);
  const PixelRect bounds = frame.header().bounds;
  std::vector<Rgb> result;
  for (int i = 0; i < samples; ++i) {
    const int x = bounds.x0 + static_cast<int>(i * 7919LL % bounds.width()),
              y = bounds.y0 + static_cast<int>(i * 104729LL % bounds.height());
    const PathKey key =
        path_key(settings.frame_seed, static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint64_t>(i), 0, true);
    result.push_back(function(frame.world(), plan, camera_sample(frame.world(), key, x, y).ray, key, count).radiance);
  }
  return result;
}

bool same_bits(const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](Rgb p, Rgb q) { return std::bit_cast<std::array<uint32_t, 3>>(p) == std::bit_cast<std::array<uint32_t, 3>>(q); });
}

TEST(Kernels, AreSortedOutByWhatTheyHave) {
  EXPECT_EQ(kernels().size(), 3u);
  EXPECT_EQ(kernels().back().effects, kAllEffects);
  for (const Kernel& k : kernels()) EXPECT_EQ(smallest_kernel(k.effects).effects, k.effects);
  EXPECT_EQ(smallest_kernel(kSurfaces).effects & (kHomogeneousMedia | kHeterogeneousMedia), 0u);
}

TEST(Kernels, EachOneThatHasTheEffectsOfASceneGivesTheSameBits) {
  size_t compared = 0;
  for (const std::string& name : scene_names()) {
    const FrameRenderer frame = load(name);
    const PathSettings settings = settings_of(frame);
    const uint32_t effects = active_effects(frame.world(), settings);
    PathCounters count;
    const std::vector<Rgb> full = radiances(frame, settings, kernels().back().run, 400, count);
    for (const Kernel& kernel : kernels().first(kernels().size() - 1)) {
      if ((kernel.effects & effects) != effects) continue;
      EXPECT_TRUE(same_bits(radiances(frame, settings, kernel.run, 400, count), full)) << name << ", kernel " << std::hex << kernel.effects;
      ++compared;
    }
    EXPECT_EQ(count.nonfinite + count.majorant_violations + count.truncated, 0u) << name;
  }
  EXPECT_GE(compared, 3u);
}

TEST(Kernels, AndFullRendersAreTheSameFile) {
  const auto render = [](bool full) {
    FrameSettings settings;
    settings.resolution = {{24, 16}};
    settings.samples = 4;
    settings.full_kernel = full;
    const FrameRenderer frame = load("effects.pbrt", settings);
    RenderProgress progress;
    return std::pair(*frame.render(frame.header().bounds, {0, 4}, 1, progress), frame.header().settings_digest);
  };
  const auto [small, small_digest] = render(false);
  const auto [full, full_digest] = render(true);
  EXPECT_EQ(small_digest, full_digest);
  for (size_t i = 0; i < small.pixels.size(); ++i) EXPECT_EQ(small.pixels[i].mean, full.pixels[i].mean);
}

/// Path by path: the camera's rays are the same, so what they see of lights cancels and the difference has little noise. A bias of 4 %
/// is always found. False alarms: 4.9 standard errors are exceeded once in a million (fixed seed).
TEST(Plan, OffHasTheSameExpectation) {
  for (const std::string name : {"cornell.pbrt", "cloud.pbrt", "effects.pbrt", "fire.pbrt", "fog.pbrt", "milk.pbrt"}) {
    const FrameRenderer frame = load(name);
    PathSettings settings = settings_of(frame);
    constexpr int kSamples = 110000;
    const auto render = [&](bool plan) {
      settings.plan = plan;
      PathCounters count;
      return radiances(frame, settings, trace_path, kSamples, count);
    };
    const std::vector<Rgb> on = render(true), off = render(false);
    EXPECT_FALSE(same_bits(on, off)) << name << ": the plan changes nothing here";
    double mean = 0, difference = 0, square = 0;
    for (size_t i = 0; i < on.size(); ++i) {
      const double y = static_cast<double>(luminance(on[i])), d = y - static_cast<double>(luminance(off[i]));
      mean += y / kSamples;
      difference += d / kSamples;
      square += d * d / kSamples;
    }
    const double error = std::sqrt((square - difference * difference) / kSamples);
    EXPECT_LT(std::abs(difference), 4.9 * error) << name << ": differs by " << difference << " ± " << error << " of " << mean;
    EXPECT_LT(error, 0.008 * mean) << name << ": too noisy to tell";
  }
}

class Omissions : public ::testing::Test {
 protected:
  PathCounters count(const std::string& world, bool plan = true, const std::string& before = "") {
    const fs::path path = folder_ / "scene.pbrt";
    std::ofstream(path) << before +
                               "LookAt 0 0 4 0 0 0 0 1 0\nCamera \"perspective\" \"float fov\" 40\nPixelFilter \"box\"\n"
                               "Film \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8\nIntegrator \"volpath\" \"integer "
                               "maxdepth\" 6\nWorldBegin\n" +
                               world;
    const FrameRenderer frame(path.string(), {}, {});
    PathSettings settings = settings_of(frame);
    settings.plan = plan;
    PathCounters counters;
    radiances(frame, settings, trace_path, 2000, counters);
    return counters;
  }
  static std::string ball(const std::string& medium) {
    return "AttributeBegin\nMaterial \"interface\"\nMediumInterface \"" + medium +
           "\" \"\"\nShape \"sphere\" \"float radius\" 1\nAttributeEnd\n";
  }
  static std::string grid(const std::string& parameters) {
    return "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 2 \"integer ny\" 2 \"integer nz\" 2 \"point3 p0\" [ -1 -1 "
           "-1 ] "
           "\"point3 p1\" [ 1 1 1 ] \"float density\" [ 1 .5 2 1 0 3 1 .7 ] " +
           parameters + "\n";
  }

  TemporaryFolder folder_;
  const std::string sky_ = "LightSource \"infinite\" \"rgb L\" [ 1 1 1 ]\n";
};

TEST_F(Omissions, AMediumThatNoRayReachesIsNotLookedUp) {
  const PathCounters c = count(grid("") + sky_ + "Shape \"sphere\" \"float radius\" 1\n");
  EXPECT_GT(c.vertices, 0u);
  EXPECT_EQ(c.medium_lookups, 0u);
}

TEST_F(Omissions, AnEmissionOfZeroIsNotLookedUp) {
  EXPECT_EQ(count(grid("\"rgb Le\" [ 0 0 0 ]") + sky_ + ball("m")).emission_lookups, 0u);
  EXPECT_EQ(count(grid("\"rgb Le\" [ 1 1 1 ] \"rgb sigma_a\" [ 0 0 0 ]") + sky_ + ball("m")).emission_lookups, 0u);
  EXPECT_GT(count(grid("\"rgb Le\" [ 1 1 1 ]") + sky_ + ball("m")).emission_lookups, 0u);
}

TEST_F(Omissions, LightsThatCannotContributeGetNoShadowRays) {
  const std::string fog = "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ 1 1 1 ] \"rgb sigma_a\" [ 0 0 0 ]\n";
  EXPECT_EQ(count(fog + "LightSource \"point\" \"rgb I\" [ 0 0 0 ]\n" + ball("m")).shadow_rays, 0u);
  EXPECT_GT(count(fog + "LightSource \"point\" \"rgb I\" [ 1 1 1 ]\n" + ball("m")).shadow_rays, 0u);
  // A lamp that shines away from everything.
  EXPECT_EQ(count("AttributeBegin\nTranslate 0 3 0\nRotate -90 1 0 0\nMaterial \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\nAreaLightSource "
                  "\"diffuse\"\nShape \"disk\"\nAttributeEnd\n"
                  "Shape \"sphere\" \"float radius\" 1\n")
                .shadow_rays,
            0u);
}

TEST_F(Omissions, GreyExtinctionDrawsNoChannels) {
  const std::string grey = "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ 1 1 1 ] \"rgb sigma_a\" [ 1 1 1 ]\n";
  const std::string coloured =
      "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ 1 2 3 ] \"rgb sigma_a\" [ 1 1 1 ]\n";
  EXPECT_EQ(count(grey + sky_ + ball("m")).channel_draws, 0u);
  EXPECT_GT(count(coloured + sky_ + ball("m")).channel_draws, 0u);
}

TEST_F(Omissions, HomogeneousMediaAndConstantBricksAreNotLookedUp) {
  const std::string fog = "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ 1 1 1 ] \"rgb sigma_a\" [ 1 1 1 ]\n";
  EXPECT_EQ(count(fog + sky_ + ball("m")).medium_lookups, 0u);
  EXPECT_GT(count(fog + sky_ + ball("m"), false).medium_lookups, 0u) << "without a plan there is no closed form";
  std::string ones;
  for (int i = 0; i < 24 * 24 * 24; ++i) ones += " 1";
  const std::string constant =
      "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 24 \"integer ny\" 24 \"integer nz\" 24 \"point3 p0\" [ -3 -3 "
      "-3 ] "
      "\"point3 p1\" [ 3 3 3 ] \"float density\" [" +
      ones + " ]\n";
  EXPECT_EQ(count(constant + sky_ + ball("m")).medium_lookups, 0u);
  EXPECT_GT(count(constant + sky_ + ball("m"), false).medium_lookups, 0u);
}

}  // namespace
}  // namespace woodcock::testing
