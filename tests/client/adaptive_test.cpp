// Renders with a target: the same bits whatever the tiles and threads, resumed, replayed, and stopped by time or by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/support/frame_bytes.h"
#include "tests/support/run_command.h"

namespace woodcock::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

const std::string kWoodcock = WOODCOCK_BIN_DIR "/woodcock";

class Adaptive : public ::testing::Test {
 protected:
  std::vector<std::string> command(const std::string& name, const std::vector<std::string>& options) const {
    std::vector<std::string> arguments{kWoodcock,
                                       "render",
                                       WOODCOCK_SOURCE_DIR "/scenes/cornell.pbrt",
                                       "-o",
                                       (folder_ / name).string(),
                                       "--resolution",
                                       "100x75",
                                       "--crop",
                                       "3,90,0,75",
                                       "--json"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return arguments;
  }
  nlohmann::json render(const std::string& name, const std::vector<std::string>& options, int code = 0) {
    const CommandResult result = run_command(command(name, options));
    EXPECT_EQ(result.exit_code, code) << result.err;
    std::ofstream(folder_ / (name + ".json")) << result.out;
    return nlohmann::json::parse(result.out, nullptr, false);
  }
  /// From nothing, the samples that `name` holds make its bytes.
  void expect_replayed(const std::string& name) {
    for (const std::string& map : {name, name + ".json"}) {
      render("replayed.exr", {"--sample-map", (folder_ / map).string(), "--threads", "1"});
      EXPECT_TRUE(bytes_of_frame(folder_ / name) == bytes_of_frame(folder_ / "replayed.exr")) << map;
      fs::remove(folder_ / "replayed.exr");
    }
  }

  /// What a render of this name has written.
  void forget(const std::string& name) {
    const std::string stem = fs::path(name).stem();
    for (const char* end : {".exr", ".png", ".nodes.exr", ".accuracy.json"}) fs::remove(folder_ / (stem + end));
  }

  /// The exit code of a render that has ended before its time, or leaves pixels without samples.
  static constexpr int kIncomplete = 3;

  TemporaryFolder folder_;
};

TEST_F(Adaptive, TheSameBitsWhateverTilesAndThreads) {
  const nlohmann::json run = render("a.exr", {"--target-error", "12%", "--threads", "2"});
  EXPECT_EQ(run["ended_by"], "target");
  EXPECT_LE(run["error"]["relative_error"], 0.12001);
  EXPECT_GT(run["error"]["relative_error"], 0.085);
  EXPECT_GT(run["error"]["image_mean_half_width"], 0);
  EXPECT_THAT(run["sample_map"]["counts"].get<std::string>(), HasSubstr(","));
  const std::string bytes = bytes_of_frame(folder_ / "a.exr");
  for (const auto& [tile, threads] : {std::pair{"7", "1"}, {"128", "1"}, {"16", "3"}}) {
    render("b.exr", {"--target-error", "0.12", "--tile", tile, "--threads", threads});
    EXPECT_TRUE(bytes_of_frame(folder_ / "b.exr") == bytes) << tile;
  }
  expect_replayed("a.exr");
}

TEST_F(Adaptive, ResumingAddsOnlyTheDifference) {
  const nlohmann::json first = render("a.exr", {"--target-error", "17%"});
  const nlohmann::json more = render("a.exr", {"--target-error", "12%", "--resume"});
  EXPECT_EQ(more["ended_by"], "target");
  EXPECT_EQ(first["new_samples"].get<int64_t>() + more["new_samples"].get<int64_t>(),
            static_cast<int64_t>(more["mean_samples"].get<double>() * 87 * 75 + 0.5));
  EXPECT_EQ(more["counters"]["paths"], more["new_samples"]);
  expect_replayed("a.exr");
  const nlohmann::json again = render("a.exr", {"--target-error", "12%", "--resume"});
  EXPECT_EQ(again["new_samples"], 0);
  // Up to one number of samples it becomes a plain frame.
  render("a.exr", {"--spp", "96", "--resume"});
  render("plain.exr", {"--spp", "96"});
  EXPECT_TRUE(bytes_of_frame(folder_ / "a.exr") == bytes_of_frame(folder_ / "plain.exr"));
  // A plain frame is a start as good as any.
  render("plain.exr", {"--spp", "24"});
  EXPECT_EQ(render("plain.exr", {"--target-error", "12%", "--resume"})["ended_by"], "target");
  expect_replayed("plain.exr");
}

TEST_F(Adaptive, TheLimitOfSamplesMakesAPlainFrame) {
  const nlohmann::json run = render("a.exr", {"--target-error", "0.001", "--max-spp", "18"});
  EXPECT_EQ(run["ended_by"], "samples");
  render("b.exr", {"--spp", "18"});
  render("c.exr", {"--max-spp", "18"});
  EXPECT_TRUE(bytes_of_frame(folder_ / "a.exr") == bytes_of_frame(folder_ / "b.exr"));
  EXPECT_TRUE(bytes_of_frame(folder_ / "c.exr") == bytes_of_frame(folder_ / "b.exr"));
}

TEST_F(Adaptive, AStopByTimeLeavesAFrameThatIsReplayed) {
  CommandResult result;
  result.exit_code = kIncomplete;
  for (int seconds = 1; result.exit_code == kIncomplete && seconds <= 64; seconds *= 2) {
    forget("a.exr");
    result = run_command(command("a.exr", {"--max-time", std::to_string(seconds) + "s", "--target-error", "0.0001"}));
  }
  ASSERT_EQ(result.exit_code, 0) << result.err;
  std::ofstream(folder_ / "a.exr.json") << result.out;
  const nlohmann::json run = nlohmann::json::parse(result.out);
  EXPECT_EQ(run["ended_by"], "time");
  EXPECT_LT(run["render_seconds"], 150);
  expect_replayed("a.exr");
}

TEST_F(Adaptive, CtrlCLeavesAFrameThatIsReplayedAndResumed) {
  CommandResult result;
  // Until every pixel has samples when it comes.
  for (int seconds = 2; seconds <= 64; seconds *= 2) {
    forget("a.exr");
    std::thread killer;
    result = run_command(command("a.exr", {"--target-error", "0.0001"}), ".", std::chrono::seconds(240), [&](pid_t child) {
      killer = std::thread([child, seconds] {
        EXPECT_TRUE(wait_for_cpu_seconds(child, seconds));
        kill(child, SIGINT);
      });
    });
    killer.join();
    ASSERT_EQ(result.exit_code, kIncomplete) << result.err;
    if (result.err.find("no samples yet") == std::string::npos) break;
  }
  std::ofstream(folder_ / "a.exr.json") << result.out;
  EXPECT_EQ(nlohmann::json::parse(result.out)["ended_by"], "interrupt");
  expect_replayed("a.exr");
  render("a.exr", {"--max-time", "0.3s", "--resume"});
  expect_replayed("a.exr");
}

TEST_F(Adaptive, WhatMakesNoSenseTogetherIsRefused) {
  const auto refused = [&](const std::vector<std::string>& options, const std::string& why, int code = 2) {
    const CommandResult result = run_command(command("a.exr", options));
    EXPECT_EQ(result.exit_code, code) << options[0];
    EXPECT_THAT(result.err, HasSubstr(why));
    EXPECT_FALSE(fs::exists(folder_ / "a.exr"));
  };
  std::ofstream(folder_ / "map.json") << R"({"block": 32, "bounds": [3, 0, 90, 75], "counts": "16x8"})";
  std::ofstream(folder_ / "crop.json") << R"({"block": 32, "bounds": [0, 0, 90, 75], "counts": "16x9"})";
  std::ofstream(folder_ / "no.json") << R"({"block": 32})";
  refused({"--target-error", "0"}, "e.g. 0.02 or 2%");
  refused({"--target-error", "200%"}, "e.g. 0.02 or 2%");
  refused({"--target-error", "2x"}, "e.g. 0.02 or 2%");
  refused({"--max-time", "soon"}, "90s");
  refused({"--target-error", "2%", "--max-spp", "4"}, "first pass");
  refused({"--target-error", "2%", "--max-spp", "64", "--spp", "32"}, "give one of them");
  refused({"--target-error", "2%", "--samples", "0:4"}, "leave --samples out");
  refused({"--sample-map", (folder_ / "map.json").string(), "--spp", "4"}, "leave the targets");
  refused({"--sample-map", (folder_ / "map.json").string()}, "malformed", 1);
  refused({"--sample-map", (folder_ / "crop.json").string()}, "pixels are others", 1);
  refused({"--sample-map", (folder_ / "no.json").string()}, "no sample map", 1);
}

}  // namespace
}  // namespace woodcock::testing
