// A sweep that a coordinator's workers render.
#include <signal.h>

#include "tests/service/service_fixture.h"

namespace woodcock::testing_service {
namespace {

class ServiceSweep : public ServiceTest {
 protected:
  std::vector<std::string> sweep(const std::string& folder, bool by_service) const {
    std::vector<std::string> arguments{"sweep",        std::string(WOODCOCK_SOURCE_DIR) + "/scenes/paper/fig08.pbrt",
                                       "--resolution", "24x24",
                                       "--estimators", "woodcock,auto",
                                       "--spp",        "1,2,4,8",
                                       "--seeds",      "2",
                                       "-o",           path(folder)};
    if (by_service) arguments.insert(arguments.end(), {"--server", address_});
    return arguments;
  }
  nlohmann::json results(const std::string& folder) const { return nlohmann::json::parse(contents(path(folder) + "/results.json")); }

  /// The errors of all counts, which say what was rendered to the bit, without the times.
  std::vector<double> errors(const std::string& folder) const {
    std::vector<double> list;
    const nlohmann::json all = results(folder);
    for (const auto& curve : all["curves"])
      for (const auto& count : curve["counts"]) list.push_back(count["relative_mse"]);
    return list;
  }
};

TEST_F(ServiceSweep, FindsTheErrorsOfALocalOneAndSharesResults) {
  start_coordinator();
  start_worker();
  start_worker();
  const Ended here = woodcock(sweep("here", false)), there = woodcock(sweep("there", true));
  ASSERT_EQ(here.code, 0) << here.err;
  ASSERT_EQ(there.code, 0) << there.err;
  EXPECT_EQ(errors("here").size(), 8u);
  EXPECT_EQ(errors("there"), errors("here"));
  const nlohmann::json all = results("there");
  for (const auto& curve : all["curves"])
    for (const auto& count : curve["counts"]) EXPECT_GT(count["cpu_seconds"], 0);
  // Another sweep of the same finds all results, with the times that they took.
  const Ended again = woodcock(sweep("again", true));
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(errors("again"), errors("here"));
  const nlohmann::json second = results("again");
  for (size_t i = 0; i < all["curves"].size(); ++i)
    for (size_t j = 0; j < all["curves"][i]["counts"].size(); ++j)
      EXPECT_NEAR(second["curves"][i]["counts"][j]["cpu_seconds"].get<double>(), all["curves"][i]["counts"][j]["cpu_seconds"].get<double>(),
                  1e-9);
  // Each count is in the next: the job of a run has rendered each of its samples once.
  const nlohmann::json record = nlohmann::json::parse(contents(path("there") + "/runs/00-woodcock-seed0.json"));
  const nlohmann::json progress = show(record["job"])["progress"];
  EXPECT_EQ(progress["samples_done"], 8 * 24 * 24) << progress;
}

TEST_F(ServiceSweep, GoesOnAfterItsClientWasKilled) {
  start_coordinator();
  start_worker();
  const auto killed = woodcock_in_background(sweep("s", true));
  ASSERT_TRUE(eventually(kPatience, [&] { return std::filesystem::exists(path("s") + "/runs/01-auto-seed1.json"); }));
  killed->signal(SIGKILL);
  ASSERT_EQ(killed->wait(kPatience), 128 + SIGKILL);
  const Ended rest = woodcock(sweep("s", true));
  ASSERT_EQ(rest.code, 0) << rest.err;
  EXPECT_EQ(errors("s").size(), 8u);
  const Ended other = woodcock(sweep("s", false));
  EXPECT_EQ(other.code, 1);
  EXPECT_THAT(other.err, ::testing::HasSubstr("rendered by"));
}

}  // namespace
}  // namespace woodcock::testing_service
