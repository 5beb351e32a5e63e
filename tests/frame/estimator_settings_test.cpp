// What the settings of an estimator do to a frame: its bits, its identity, its header; and what is refused.
#include "renderer/frame/estimator_settings.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <chrono>
#include <fstream>
#include <thread>

#include "renderer/frame/frame_renderer.h"
#include "renderer/scene/scene_error.h"
#include "tests/support/run_command.h"

namespace woodcock::testing {
namespace {

using ::testing::HasSubstr;

const std::string kCamera =
    "LookAt 0 0 4 0 0 0 0 1 0\nCamera \"perspective\" \"float fov\" 40\nPixelFilter \"box\"\n"
    "Film \"rgb\" \"integer xresolution\" 12 \"integer yresolution\" 8\n"
    "Sampler \"independent\" \"integer pixelsamples\" 8\nIntegrator \"volpath\" \"integer maxdepth\" 6\nWorldBegin\n";
const std::string kSky = "LightSource \"infinite\" \"rgb L\" [ 1 1 1 ]\n";
/// A ball that absorbs, emits and scatters, each channel in its own way.
const std::string kBall =
    "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [ .2 .1 .3 ] \"rgb sigma_s\" [ .7 .4 .9 ] \"rgb Le\" [ .1 .2 .3 "
    "]\n"
    "AttributeBegin\nMaterial \"interface\"\nMediumInterface \"m\" \"\"\nShape \"sphere\" \"float radius\" 1\nAttributeEnd\n"
    "Material \"diffuse\"\nShape \"sphere\" \"float radius\" 0.4\n";

FrameSettings by(const std::string& estimator) {
  FrameSettings settings;
  settings.estimator = estimator;
  const EstimatorInfo& info = *find_estimator(estimator);
  if (info.step) settings.step = 0.3;
  if (info.takes_directions()) settings.directions = 2;
  if (info.branching) settings.branching = 3;
  if (!info.media_scatter) settings.only = "absorption,emission";
  return settings;
}

class EstimatorFrame : public ::testing::Test {
 protected:
  FrameRenderer load(const std::string& text, const FrameSettings& settings) {
    const auto path = folder_ / "scene.pbrt";
    std::ofstream(path) << text;
    ReadOptions options;
    options.warn = [this](const std::string& note) { notes_.push_back(note); };
    return FrameRenderer(path.string(), settings, options);
  }
  std::string scene_refusal(const std::string& text, const FrameSettings& settings) {
    try {
      load(text, settings);
    } catch (const SceneError& error) {
      return error.what();
    }
    return "";
  }
  std::string digest(const FrameSettings& settings) { return load(kCamera + kSky + kBall, settings).header().settings_digest; }

  TemporaryFolder folder_;
  std::vector<std::string> notes_;
};

bool same_bits(const PixelStats& a, const PixelStats& b) {
  using Bits = std::array<uint32_t, sizeof(PixelStats) / 4>;
  return std::bit_cast<Bits>(a) == std::bit_cast<Bits>(b);
}

TEST_F(EstimatorFrame, BitsDependOnNeitherThreadsNorTilesNorTheSplitOfSamples) {
  for (const EstimatorInfo& e : estimators()) {
    const FrameRenderer frame = load(kCamera + kSky + kBall, by(e.name));
    RenderProgress progress;
    const PixelRect bounds = frame.header().bounds, part{3, 2, 7, 5};
    const Tile whole = *frame.render(bounds, {0, 8}, 1, progress), threaded = *frame.render(bounds, {0, 8}, 5, progress);
    EXPECT_TRUE(std::equal(whole.pixels.begin(), whole.pixels.end(), threaded.pixels.begin(), same_bits)) << e.name;
    const Tile left = *frame.render(part, {0, 4}, 2, progress), right = *frame.render(part, {4, 8}, 1, progress);
    for (int y = part.y0; y < part.y1; ++y) {
      for (int x = part.x0; x < part.x1; ++x) {
        const auto i = static_cast<size_t>((y - part.y0) * part.width() + x - part.x0);
        EXPECT_TRUE(same_bits(merge(left.pixels[i], right.pixels[i], 2), whole.pixels[static_cast<size_t>(y * 12 + x)])) << e.name;
      }
    }
    EXPECT_EQ(progress.counters.nonfinite, 0u) << e.name;
    EXPECT_GT(progress.counters.vertices, 0u) << e.name;
  }
}

TEST_F(EstimatorFrame, TheIdentityHoldsWhatChangesRadianceAndNothingElse) {
  FrameSettings full;
  full.full_kernel = true;
  const std::string plain = digest({});
  EXPECT_EQ(digest(full), plain);
  FrameSettings all_terms;
  all_terms.only = "in-scattering,out-scattering,emission,absorption";
  EXPECT_EQ(digest(all_terms), plain);
  std::vector<std::string> digests{plain};
  const auto add = [&](auto&& change, const std::string& estimator) {
    FrameSettings settings = by(estimator);
    change(settings);
    digests.push_back(digest(settings));
  };
  for (const EstimatorInfo& e : estimators().subspan(1)) add([](FrameSettings&) {}, e.name);
  add([](FrameSettings& s) { s.only = "absorption"; }, "auto");
  add([](FrameSettings& s) { s.plan = false; }, "auto");
  add([](FrameSettings& s) { s.without = "mis"; }, "auto");
  add([](FrameSettings& s) { s.without = "mis,roulette"; }, "auto");
  add([](FrameSettings& s) { s.step = 0.31; }, "march");
  add([](FrameSettings& s) { s.directions = 3; }, "march");
  add([](FrameSettings& s) { s.branching = 4; }, "uniform-path");
  std::sort(digests.begin(), digests.end());
  EXPECT_EQ(std::adjacent_find(digests.begin(), digests.end()), digests.end());
  FrameSettings one, other;
  one.without = "mis,roulette";
  other.without = "roulette,mis";
  EXPECT_EQ(digest(one), digest(other));
}

TEST_F(EstimatorFrame, TheHeaderSaysWhatWasDoneAndWhatIsBiased) {
  using Field = std::pair<std::string, std::string>;
  FrameSettings settings = by("march");
  settings.only = "in-scattering,absorption,out-scattering";
  EXPECT_THAT(
      load(kCamera + kSky + kBall, settings).header().settings,
      ::testing::IsSupersetOf({Field{"estimator", "march"}, Field{"biased", "yes"}, Field{"bias", find_estimator("march")->bias},
                               Field{"terms", "absorption,out-scattering,in-scattering"}, Field{"step", "0.3"}, Field{"directions", "2"}}));
  EXPECT_THAT(load(kCamera + kSky + kBall, by("woodcock")).header().settings,
              ::testing::IsSupersetOf({Field{"estimator", "woodcock"}, Field{"biased", "no"}}));
}

TEST(EstimatorSettings, OptionsThatDoNotBelongToTheEstimatorAreRefusedWithThoseThatTakeThem) {
  const auto refusal = [](const FrameSettings& settings) -> std::string {
    try {
      resolve_estimator(settings);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  FrameSettings s;
  s.step = 1;
  EXPECT_THAT(refusal(s), ::testing::AllOf(HasSubstr("step"), HasSubstr("march, line, march-phase")));
  s = by("woodcock");
  s.directions = 3;
  EXPECT_THAT(refusal(s), ::testing::AllOf(HasSubstr("directions"), HasSubstr("march, line, march-phase")));
  s = by("march");
  s.branching = 3;
  EXPECT_THAT(refusal(s), ::testing::AllOf(HasSubstr("branching"), HasSubstr("uniform-path")));
  for (const auto& change : std::vector<std::function<void(FrameSettings&)>>{[](FrameSettings& f) { f.without = "mis"; },
                                                                             [](FrameSettings& f) { f.plan = false; },
                                                                             [](FrameSettings& f) { f.full_kernel = true; }}) {
    s = by("woodcock");
    change(s);
    EXPECT_THAT(refusal(s), HasSubstr("expected one of: auto"));
  }
  s = by("march");
  s.step.reset();
  EXPECT_THAT(refusal(s), HasSubstr("needs the length of its steps"));
  for (const double step : {0.0, -1.0, std::numeric_limits<double>::infinity(), std::nan("")}) {
    s.step = step;
    EXPECT_THAT(refusal(s), HasSubstr("step: found")) << step;
  }
  for (const int n : {0, -1, 1025}) {
    s = by("line");
    s.directions = n;
    EXPECT_THAT(refusal(s), HasSubstr("1 to 1024"));
  }
  s = {};
  for (const std::string only : {"absorbtion", "absorption,", "absorption,absorption", ","}) {
    s.only = only;
    EXPECT_THAT(refusal(s), HasSubstr("only: found")) << only;
  }
  s = {};
  for (const std::string without : {"everything", "mis,mis", "mis,"}) {
    s.without = without;
    EXPECT_THAT(refusal(s), HasSubstr("without: found")) << without;
  }
}

TEST(EstimatorSettings, ListsOfTermsAndFeaturesAreReadAsTheyAreWritten) {
  for (int subset = 1; subset < 16; ++subset) {
    const TransferTerms terms{(subset & 1) != 0, (subset & 2) != 0, (subset & 4) != 0, (subset & 8) != 0};
    EXPECT_EQ(to_string(parse_terms(to_string(terms))), to_string(terms));
  }
  EXPECT_TRUE(parse_terms("").all());
  for (const FeatureInfo& f : kFeatures) {
    const Features features = parse_without(f.name);
    for (const FeatureInfo& other : kFeatures) EXPECT_EQ(features.has(other.feature), other.feature != f.feature);
    EXPECT_EQ(features_off(features), f.name);
  }
}

TEST_F(EstimatorFrame, LightsWithoutExtentAreRefusedAtTheirPlaceWhereLightsAreNotSampled) {
  const auto line = std::count(kCamera.begin(), kCamera.end(), '\n') + 1;
  for (const std::string light : {"\"point\"", "\"spot\"", "\"distant\""}) {
    for (const EstimatorInfo& e : estimators()) {
      const std::string message = scene_refusal(kCamera + "LightSource " + light + "\n" + kBall, by(e.name));
      if (e.samples_lights) {
        EXPECT_EQ(message, "") << e.name;
        continue;
      }
      EXPECT_THAT(message, ::testing::AllOf(HasSubstr(fmt::format("scene.pbrt:{}:1", line)), HasSubstr(e.name), HasSubstr("auto")));
    }
  }
  EXPECT_EQ(scene_refusal(kCamera + "LightSource \"point\" \"rgb I\" [ 0 0 0 ]\n" + kBall, by("woodcock")), "");
  EXPECT_THAT(scene_refusal(kCamera + "AreaLightSource \"diffuse\"\nShape \"sphere\" \"float alpha\" 0\n", by("woodcock")),
              HasSubstr("opacity 0"));
}

TEST_F(EstimatorFrame, MediaThatScatterAreRefusedAtTheirPlaceByWhatFollowsSurfacesOnly) {
  FrameSettings settings = by("uniform-path");
  settings.only = "";
  EXPECT_THAT(scene_refusal(kCamera + kSky + kBall, settings), ::testing::AllOf(HasSubstr("\"m\", which scatters"), HasSubstr("--only")));
  // Declared and not used is fine.
  EXPECT_EQ(scene_refusal(kCamera + kSky + "MakeNamedMedium \"unused\" \"string type\" \"homogeneous\"\n", settings), "");
}

TEST_F(EstimatorFrame, InScatteringAloneGainsEnergyAndNeedsADepthThatIsNotEndless) {
  FrameSettings settings = by("woodcock");
  settings.only = "in-scattering";
  load(kCamera + kSky + kBall, settings);
  EXPECT_THAT(notes_, ::testing::Contains(HasSubstr("gains energy")));
  settings.max_depth = kMaxDepthWithGain + 1;
  EXPECT_THROW(load(kCamera + kSky + kBall, settings), std::invalid_argument);
}

TEST_F(EstimatorFrame, StepsThatWouldTakeForEverAreRefused) {
  FrameSettings settings = by("march");
  settings.step = 1e-7;
  EXPECT_THROW(load(kCamera + kSky + kBall, settings), std::invalid_argument);
}

// One sample is a tree of a million steps; cancelling must not wait for it.
TEST_F(EstimatorFrame, CancelEndsAMarchInTheMiddleOfASample) {
  FrameSettings settings = by("march");
  settings.step = 1e-3;
  settings.directions = 100;
  const FrameRenderer frame = load(kCamera + kSky + kBall, settings);
  RenderProgress progress;
  std::optional<Tile> result;
  std::thread renderer([&] { result = frame.render({5, 4, 6, 5}, {0, 1}, 1, progress); });
  while (progress.bounces < 5000) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  progress.cancel = true;
  renderer.join();
  EXPECT_FALSE(result.has_value());
}

}  // namespace
}  // namespace woodcock::testing
