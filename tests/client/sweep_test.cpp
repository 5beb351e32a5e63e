// `woodcock sweep` as a user runs it, at a size that takes moments.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/support/run_command.h"

namespace woodcock::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

const std::string kWoodcock = WOODCOCK_BIN_DIR "/woodcock";
const std::string kScenes = WOODCOCK_SOURCE_DIR "/scenes/";

std::string text_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

nlohmann::json json_of(const fs::path& path) { return nlohmann::json::parse(text_of(path)); }

/// The columns of results.csv that do not hold times.
std::vector<std::string> results_without_times(const fs::path& folder) {
  std::vector<std::string> lines;
  std::ifstream in(folder / "results.csv");
  for (std::string line; std::getline(in, line);) {
    // Names are quoted and may hold commas: columns are counted from behind.
    std::vector<size_t> commas;
    for (size_t i = line.size(); i-- > 0;)
      if (line[i] == ',') commas.push_back(i);
    if (commas.size() < 6) continue;
    line.erase(commas[5], commas[4] - commas[5]);
    lines.push_back(line);
  }
  return lines;
}

class Sweep : public ::testing::Test {
 protected:
  std::vector<std::string> command(const std::string& name, const std::vector<std::string>& options) {
    std::vector<std::string> arguments{
        kWoodcock, "sweep", kScenes + "paper/fig08.pbrt", "--resolution", "24x24", "-o", (folder_ / name).string(), "--threads", "2"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return arguments;
  }
  CommandResult sweep(const std::string& name, const std::vector<std::string>& options) { return run_command(command(name, options)); }

  TemporaryFolder folder_;
  const std::vector<std::string> small_{"--estimators", "march,woodcock,auto", "--step", "0.8", "--spp", "1,2,...,32", "--seeds", "3"};
};

TEST_F(Sweep, FindsSlopesAndTheFloorOfMarchingAlone) {
  const CommandResult result = sweep("s", small_);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json j = json_of(folder_ / "s/results.json");
  ASSERT_EQ(j["curves"].size(), 3u);
  for (const auto& curve : j["curves"]) {
    const bool marches = curve["estimator"] == "march";
    EXPECT_EQ(curve["bias_floor"]["seen"], marches) << curve;
    EXPECT_EQ(curve["biased_by"] == "", !marches);
    EXPECT_EQ(curve["counts"].size(), 6u);
    // The seeds are fixed. The error of 24x24 pixels is known to some percent at each end of the fit.
    ASSERT_TRUE(curve.contains("slope_of_mse")) << curve;
    EXPECT_NEAR(curve["slope_of_mse"]["value"], -1, 0.15) << curve["name"];
  }
  EXPECT_EQ(j["curves"][0]["time_to_error"]["0.05"]["kind"], "never");
  EXPECT_NE(j["curves"][1]["time_to_error"]["0.05"]["kind"], "never");
}

TEST_F(Sweep, WritesAReportThatHoldsEveryCurveAndNamesNothingOutside) {
  ASSERT_EQ(sweep("s", {"--estimators", "march,woodcock", "--step", "0.4,0.8", "--spp", "1,2,4", "--seeds", "2", "--effects"}).exit_code,
            0);
  const std::string report = text_of(folder_ / "s/report.html");
  EXPECT_THAT(report, HasSubstr("Complete"));
  for (const char* text : {"march, step 0.4", "march, step 0.8", "woodcock", "What each effect costs", "equiangular", "in-scattering",
                           "The effect plan", "render build", "slope", "data:image/png;base64,"})
    EXPECT_THAT(report, HasSubstr(text));
  for (const char* text : {"http:", "https:", "<script", "<link", "url("}) EXPECT_THAT(report, Not(HasSubstr(text)));
  size_t pictures = 0;
  for (const auto& file : fs::directory_iterator(folder_ / "s/pictures"))
    pictures += file.path().filename().string().find("-4spp") != std::string::npos ? 1 : 0;
  // The largest count of each curve and seed, and the effects'.
  EXPECT_GE(pictures, 6u);
}

TEST_F(Sweep, WithoutGnuplotWritesTheNumbersAndSaysSo) {
  std::vector<std::string> arguments = command("s", {"--estimators", "auto", "--spp", "1,2", "--seeds", "2"});
  arguments.insert(arguments.begin(), {"/usr/bin/env", "PATH=/nonexistent"});
  const CommandResult result = run_command(arguments);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(text_of(folder_ / "s/report.html"), HasSubstr("gnuplot was not found"));
  EXPECT_EQ(results_without_times(folder_ / "s").size(), 5u);
}

TEST_F(Sweep, InterruptedAndGoneOnWithIsTheSameAsUndisturbed) {
  ASSERT_EQ(sweep("whole", small_).exit_code, 0);
  std::vector<std::string> larger = command("parts", small_);
  const auto first_runs_are_there = [&] {
    size_t runs = 0;
    std::error_code ignored;
    for (const auto& file : fs::directory_iterator(folder_ / "parts/runs", ignored)) runs += file.path().extension() == ".json" ? 1 : 0;
    return runs >= 4;
  };
  const CommandResult interrupted = run_command(larger, ".", std::chrono::seconds(120), [&](pid_t child) {
    for (int i = 0; i < 20000 && !first_runs_are_there(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    kill(child, SIGINT);
  });
  ASSERT_EQ(interrupted.exit_code, 3) << interrupted.err;
  EXPECT_THAT(text_of(folder_ / "parts/report.html"), HasSubstr("Not complete"));
  EXPECT_GE(results_without_times(folder_ / "parts").size(), 2u);
  EXPECT_LT(results_without_times(folder_ / "parts").size(), results_without_times(folder_ / "whole").size());
  const CommandResult rest = run_command(larger);
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_EQ(results_without_times(folder_ / "parts"), results_without_times(folder_ / "whole"));
}

TEST_F(Sweep, KilledAtAnyMomentItGoesOn) {
  const CommandResult killed = run_command(command("s", small_), ".", std::chrono::seconds(120), [&](pid_t child) {
    for (int i = 0; i < 20000 && !fs::exists(folder_ / "s/runs/02-auto-seed1.json"); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    kill(child, SIGKILL);
  });
  ASSERT_EQ(killed.exit_code, 128 + SIGKILL);
  ASSERT_EQ(sweep("s", small_).exit_code, 0);
  EXPECT_EQ(results_without_times(folder_ / "s").size(), 1 + 3 * 3 * 6u);
}

TEST_F(Sweep, AnotherSweepInTheSameFolderIsRefusedWithWhatDiffers) {
  ASSERT_EQ(sweep("s", {"--estimators", "auto", "--spp", "1,2", "--seeds", "2"}).exit_code, 0);
  const CommandResult other = sweep("s", {"--estimators", "auto", "--spp", "1,2", "--seeds", "3"});
  EXPECT_EQ(other.exit_code, 1);
  EXPECT_THAT(other.err, HasSubstr("seeds: 2 there, 3 asked for"));
  const CommandResult resolution = sweep("s", {"--estimators", "auto", "--spp", "1,2", "--seeds", "2", "--crop", "0,12,0,12"});
  EXPECT_EQ(resolution.exit_code, 1);
  EXPECT_THAT(resolution.err, HasSubstr("pixels"));
  std::ofstream(folder_ / "file") << "x";
  const CommandResult folder = run_command({kWoodcock, "sweep", kScenes + "fog.pbrt", "-o", folder_.path().string()});
  EXPECT_EQ(folder.exit_code, 1);
  EXPECT_THAT(folder.err, HasSubstr("holds no sweep"));
}

TEST_F(Sweep, MeasuresAgainstAGivenReference) {
  const std::string reference = (folder_ / "reference.exr").string();
  ASSERT_EQ(run_command({kWoodcock, "render", kScenes + "paper/fig08.pbrt", "--resolution", "24x24", "--spp", "64", "--seed", "99", "-o",
                         reference})
                .exit_code,
            0);
  ASSERT_EQ(sweep("s", {"--spp", "1,2,4", "--seeds", "2", "--reference", reference}).exit_code, 0);
  const nlohmann::json j = json_of(folder_ / "s/results.json");
  EXPECT_THAT(std::string(j["references"][0]["what"]), HasSubstr("64 samples per pixel, its own error"));
  EXPECT_GT(j["references"][0]["relative_mse"], 0);
  // Another size is no reference.
  const CommandResult wrong = sweep("t", {"--spp", "1", "--reference", reference, "--crop", "0,12,0,12"});
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_THAT(wrong.err, HasSubstr("24x24"));
}

TEST_F(Sweep, ShowsHowDeepPathsMustGo) {
  const CommandResult result = run_command({kWoodcock, "sweep", kScenes + "milk.pbrt", "--resolution", "16x9", "--max-depth", "1,8,150",
                                            "--spp", "1,2,4,...,32", "--seeds", "3", "-o", (folder_ / "s").string()});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json j = json_of(folder_ / "s/results.json");
  ASSERT_EQ(j["curves"].size(), 3u);
  EXPECT_TRUE(j["curves"][0]["bias_floor"]["seen"]);
  EXPECT_THAT(std::string(j["curves"][0]["biased_by"]), HasSubstr("paths end after 1 scatterings"));
  EXPECT_GT(j["curves"][0]["bias_floor"]["relative_mse"], j["curves"][1]["bias_floor"]["relative_mse"]);
  EXPECT_FALSE(j["curves"][2]["bias_floor"]["seen"]) << j["curves"][2];
}

TEST_F(Sweep, GivesEachValueOfASetItsOwnReference) {
  const CommandResult result =
      run_command({kWoodcock, "sweep", kScenes + "paper/fig10.pbrt", "--resolution", "16x16", "--estimators", "woodcock,woodcock-phase",
                   "--set", "medium.mist.g=0,0.8", "--spp", "1,2,4,8", "--seeds", "2", "-o", (folder_ / "s").string()});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json j = json_of(folder_ / "s/results.json");
  ASSERT_EQ(j["references"].size(), 2u);
  ASSERT_EQ(j["curves"].size(), 4u);
  EXPECT_EQ(j["curves"][0]["name"], "woodcock, medium.mist.g=0");
  EXPECT_EQ(j["curves"][3]["name"], "woodcock-phase, medium.mist.g=0.8");
  const auto error = [&](size_t curve) { return double(j["curves"][curve]["counts"][3]["relative_mse"]); };
  // Isotropic scattering leaves the phase function nothing to gain; at 0.8 uniform directions cost (1 + g²)/(1 − g²)² in variance.
  EXPECT_GT(error(2), 2 * error(3));
  EXPECT_LT(error(0), 2 * error(1));
  for (const auto& file : fs::directory_iterator(folder_ / "s/pictures")) EXPECT_EQ(file.path().extension(), ".exr");
}

TEST_F(Sweep, RefusesWhatMakesNoSense) {
  for (const auto& [options, text] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"--estimators", "nobody"}, "nobody"},
           {{"--estimators", "woodcock", "--step", "0.1"}, "none of the estimators takes it"},
           {{"--estimators", "march"}, "step"},
           {{"--estimators", "auto,auto"}, "twice"},
           {{"--spp", "4,2"}, "ascend"},
           {{"--set", "medium.nobody.g=1"}, "found no \"medium.nobody\""},
           {{"--set", "medium.gas.g=0,0"}, "twice"},
           {{"--set", "integrator.maxdepth=1,2"}, "--max-depth"},
           {{"--max-depth", "2,1"}, "ascend"},
           {{"--seeds", "0"}, "--seeds"}}) {
    const CommandResult result = sweep("never", options);
    EXPECT_NE(result.exit_code, 0) << text;
    EXPECT_THAT(result.err, HasSubstr(text));
  }
  EXPECT_FALSE(fs::exists(folder_ / "never"));
}

}  // namespace
}  // namespace woodcock::testing
