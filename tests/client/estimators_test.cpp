// `woodcock estimators`, and what a render says about a biased one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/support/run_command.h"

namespace woodcock::testing {
namespace {

const std::string kWoodcock = WOODCOCK_BIN_DIR "/woodcock";

TEST(Estimators, AreListedWithFormulaSourceAndBias) {
  const CommandResult text = run_command({kWoodcock, "estimators"}), json = run_command({kWoodcock, "estimators", "--json"});
  ASSERT_EQ(text.exit_code, 0) << text.err;
  ASSERT_EQ(json.exit_code, 0) << json.err;
  const auto list = nlohmann::json::parse(json.out).at("estimators");
  std::vector<std::string> names;
  for (const auto& e : list) {
    names.push_back(e.at("name"));
    for (const char* field : {"name", "formula", "source", "summary"}) {
      EXPECT_FALSE(e.at(field).get<std::string>().empty()) << field;
      EXPECT_NE(text.out.find(e.at(field).get<std::string>()), std::string::npos) << field;
    }
    EXPECT_EQ(e.at("biased").get<bool>(), e.contains("bias"));
  }
  EXPECT_THAT(names, ::testing::ElementsAre("auto", "uniform-path", "march", "line", "march-phase", "woodcock", "woodcock-phase"));
}

TEST(Estimators, ABiasedRenderSaysSo) {
  const TemporaryFolder folder;
  const auto render = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{kWoodcock, "render", WOODCOCK_SOURCE_DIR "/scenes/cloud.pbrt", "--spp", "2", "--resolution",
                                       "8x8",     "-o",     (folder.path() / "out.exr").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const CommandResult result = run_command(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.out;
  };
  EXPECT_NE(render({"--estimator", "march", "--step", "0.5"}).find("biased: "), std::string::npos);
  EXPECT_EQ(render({"--estimator", "woodcock"}).find("biased"), std::string::npos);
  const auto json = nlohmann::json::parse(render({"--estimator", "march", "--step", "0.5", "--json"}));
  EXPECT_EQ(json.at("settings").at("biased"), "yes");
  EXPECT_EQ(json.at("settings").at("step"), "0.5");
}

}  // namespace
}  // namespace woodcock::testing
