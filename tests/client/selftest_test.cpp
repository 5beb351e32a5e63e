// `woodcock selftest`: this build against random scenes of known radiance.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/support/run_command.h"

namespace woodcock::testing {
namespace {

const std::string kWoodcock = WOODCOCK_BIN_DIR "/woodcock";

TEST(Selftest, SaysWhatItComparedAndThatAllCameOutRight) {
  const TemporaryFolder folder;
  const CommandResult text = run_command({kWoodcock, "selftest", "--count", "12", "--furnaces", "--coverage"}, folder.path());
  EXPECT_EQ(text.exit_code, 0) << text.err;
  EXPECT_THAT(text.out, ::testing::HasSubstr("All came out right"));
  EXPECT_THAT(text.out, ::testing::HasSubstr("scenes       12"));
  EXPECT_THAT(text.out, ::testing::HasSubstr("relation/furnace"));

  const CommandResult json = run_command({kWoodcock, "selftest", "--count", "12", "--furnaces", "--json"}, folder.path());
  EXPECT_EQ(json.exit_code, 0) << json.err;
  const auto object = nlohmann::json::parse(json.out);
  EXPECT_EQ(object.at("scenes"), 12);
  EXPECT_EQ(object.at("comparisons"), 12 * 15);
  EXPECT_EQ(object.at("failed"), 0);
  EXPECT_TRUE(object.at("failures").empty());
  EXPECT_GT(object.at("largest_z").get<double>(), 0);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << "nothing failed, so nothing is written";
}

TEST(Selftest, EndsWhenItsTimeIsOver) {
  const CommandResult result = run_command({kWoodcock, "selftest", "--seconds", "1", "--seed", "5", "--furnaces", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err << result.out;
  EXPECT_GE(nlohmann::json::parse(result.out).at("scenes").get<int>(), 1);
}

TEST(Selftest, AnotherSeedHasOtherScenes) {
  const auto samples = [](const char* seed) {
    const CommandResult result = run_command({kWoodcock, "selftest", "--seed", seed, "--count", "3", "--furnaces", "--json"});
    return nlohmann::json::parse(result.out).at("largest_z").get<double>();
  };
  EXPECT_EQ(samples("1"), samples("1"));
  EXPECT_NE(samples("1"), samples("2"));
}

TEST(Selftest, ACaseIsTheSameWhateverItWasDrawnFrom) {
  // A failure names the relation of its case; this repeats it.
  const auto case_of = [](std::vector<std::string> options) {
    options.insert(options.begin(), {kWoodcock, "selftest", "--seed", "6", "--case", "4", "--json", "--coverage"});
    const CommandResult result = run_command(options);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    auto object = nlohmann::json::parse(result.out);
    object.erase("seconds");
    return object;
  };
  const auto drawn = case_of({"--relations"});
  int same = 0;
  for (const char* relation :
       {"rendered otherwise", "full kernel", "split in parts", "scaled by two", "scaled", "moved", "mirrored", "permuted", "reordered",
        "boundary", "constant grid", "sum of halves", "lights halved", "two-sided", "shrunk light", "far camera", "far body", "visibility"})
    same += case_of({"--relation", relation}) == drawn ? 1 : 0;
  EXPECT_EQ(same, 1);
  EXPECT_EQ(case_of({"--furnaces"}), case_of({"--relation", "furnace"}));
  const CommandResult unknown = run_command({kWoodcock, "selftest", "--relation", "upside down"});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, ::testing::HasSubstr("shrunk light"));
}

TEST(Selftest, RefusesWhatMakesNoSense) {
  EXPECT_EQ(run_command({kWoodcock, "selftest", "--seconds", "-1"}).exit_code, 2);
  EXPECT_EQ(run_command({kWoodcock, "selftest", "--count", "0"}).exit_code, 2);
  EXPECT_EQ(run_command({kWoodcock, "selftest", "-o", "/nowhere/at/all"}).exit_code, 2);
}

}  // namespace
}  // namespace woodcock::testing
