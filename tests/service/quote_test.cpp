// Quotes on the workers of a coordinator, and what they became: real programs.
#include <signal.h>

#include <cmath>

#include "tests/service/service_fixture.h"

namespace woodcock::testing_service {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;

const std::string kScene = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/paper/fig10.pbrt";
const std::string kSphere = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/sphere.pbrt";

class ServiceQuote : public ServiceTest {
 protected:
  /// `words`, then the scene with what makes it small.
  std::vector<std::string> with_scene(std::vector<std::string> words) const {
    words.insert(words.end(), {kScene, "--resolution", "48x32", "--json"});
    return words;
  }
  json run_json(const std::vector<std::string>& words) {
    const Ended run = woodcock(words);
    EXPECT_EQ(run.code, 0) << run.err;
    return json::parse(run.out, nullptr, false);
  }
  size_t jobs() { return run_json({"jobs", "--json"})["jobs"].size(); }
};

TEST_F(ServiceQuote, ComesFromTheWorkersAndIsComparedWithWhatTheJobBecame) {
  start_coordinator();
  start_worker();
  start_worker({"--slots", "2"});
  ASSERT_TRUE(eventually(kPatience, [&] { return run_json({"workers", "--json"})["workers"].size() == 2; }));
  EXPECT_THAT(woodcock({"workers"}).out, HasSubstr("render on 3 threads"));

  const json quote = run_json(with_scene({"quote", "--error", "5%", "--server", address_}));
  const json here = run_json(with_scene({"quote", "--error", "5%"}));
  EXPECT_EQ(quote["samples"], here["samples"]) << "samples are the same bits everywhere";
  EXPECT_EQ(quote["samples_interval"], here["samples_interval"]);
  EXPECT_EQ(quote["threads"], 3);
  EXPECT_EQ(quote["workers"]["connected"], 2);
  const std::string pilot = quote["workers"]["job_id"];
  const json pilot_job = show(pilot);
  EXPECT_EQ(pilot_job["name"], "quote of fig10.pbrt");
  EXPECT_GE(pilot_job["progress"]["tasks_done"], 4 * 3) << "enough for each slot to be measured";
  const double pilot_cpu = pilot_job["progress"]["result_seconds"];
  EXPECT_GT(pilot_cpu, 0);
  EXPECT_NEAR(quote["workers"]["cpu_seconds"].get<double>(), pilot_cpu, 1e-9);
  if (quote["uncertain"] == "") {  // else the workers differed, by what else the machine had to do
    EXPECT_NEAR(quote["cpu_seconds"].get<double>(), pilot_cpu / quote["workers"]["samples"].get<double>() * quote["samples"].get<double>(),
                1e-6 * pilot_cpu);
  }
  EXPECT_NEAR(quote["seconds"].get<double>(), quote["cpu_seconds"].get<double>() / 3, 1e-9);

  const json report = run_json(with_scene({"submit", "--spp", "64", "--quote", "--watch"}));
  const std::string id = report["job_id"];
  const json job = show(id);
  EXPECT_EQ(job["quote"], report["quote"]);
  EXPECT_EQ(job["quote"]["samples"], 64);
  const json became = job["quote_outcome"];
  EXPECT_EQ(became["samples"], 64);
  EXPECT_EQ(became["relative_error"], job["frames"][0]["statistics"]["relative_error"]);
  EXPECT_EQ(became["cpu_seconds"], job["progress"]["result_seconds"]);
  EXPECT_GT(became["cpu_seconds"], 0);
  const double ratio = became["relative_error"].get<double>() / job["quote"]["relative_error"].get<double>();
  EXPECT_NEAR(became["samples_off"].get<double>(), ratio * ratio - 1, 1e-9);
  EXPECT_NEAR(became["cpu_off"].get<double>(), became["cpu_seconds"].get<double>() / job["quote"]["cpu_seconds"].get<double>() - 1, 1e-9);
  const std::string shown = woodcock({"show", id}).out;
  EXPECT_THAT(shown, HasSubstr("quote     "));
  EXPECT_THAT(shown, HasSubstr("3 threads of 2 workers"));
  EXPECT_THAT(shown, HasSubstr("became    "));

  // The same again finds all results: they cost what they cost.
  const std::string again = run_json(with_scene({"submit", "--spp", "64", "--quote", "--watch"}))["job_id"];
  EXPECT_EQ(show(again)["progress"]["worker_seconds"], 0);
  EXPECT_NEAR(show(again)["quote_outcome"]["cpu_seconds"].get<double>(), became["cpu_seconds"].get<double>(), 1e-9);

  kill_coordinator();
  restart_coordinator();
  EXPECT_EQ(show(id)["quote_outcome"], became) << "it outlives a crash";
  ASSERT_EQ(woodcock({"extend", again, "--spp", "80"}).code, 0);
  ASSERT_EQ(watch(again), 0);
  const json record = run_json({"jobs", "--quotes", "--json"});
  EXPECT_EQ(record["jobs"].size(), 2u);
  EXPECT_EQ(record["quotes"]["finished"], 1);
  EXPECT_EQ(record["quotes"]["extended"], 1);
  EXPECT_EQ(record["quotes"]["samples_held"], std::abs(ratio * ratio - 1) <= 0.1 ? 1 : 0);
  EXPECT_EQ(record["quotes"]["cpu_held"], std::abs(became["cpu_off"].get<double>()) <= 0.15 ? 1 : 0);
  EXPECT_THAT(woodcock({"jobs", "--quotes"}).out, HasSubstr("of 1 finished quotes held"));
}

TEST_F(ServiceQuote, OfADryRunMakesNoJobOfTheUsers) {
  start_coordinator();
  start_worker();
  for (const char* number : {"08", "09"}) fs::copy_file(kSphere, path(std::string("shot.") + number + ".pbrt"));
  const std::vector<std::string> sequence{"submit", path("shot.##.pbrt"), "--frames", "8-9", "--resolution", "48x32", "--spp", "16",
                                          "--json"};
  const auto dry_run = [&](std::vector<std::string> more) {
    more.insert(more.begin(), sequence.begin(), sequence.end());
    return run_json(more);
  };
  const json here = dry_run({"--dry-run", "--here"});
  EXPECT_EQ(here["machines"], "this machine");
  EXPECT_EQ(jobs(), 0u) << "nothing was sent";
  const json there = dry_run({"--dry-run"});
  EXPECT_EQ(there["machines"], "workers");
  EXPECT_EQ(there["samples"], 16);
  EXPECT_EQ(there["frames"], 2);
  EXPECT_THAT(there["uncertain"].get<std::string>(), HasSubstr("first of 2 frames"));
  EXPECT_NEAR(there["cpu_seconds"].get<double>(),
              2 * 16 * there["workers"]["cpu_seconds"].get<double>() / there["workers"]["samples"].get<double>(), 1e-9);
  EXPECT_EQ(jobs(), 1u) << "the pilot alone";
}

TEST_F(ServiceQuote, AnAdaptiveJobTakesThePilotsResultsForItsFirstPass) {
  start_coordinator();
  start_worker();
  const std::vector<std::string> scene{kScene, "--resolution", "128x96", "--target-error", "5%"};
  std::vector<std::string> words{"submit", "--quote", "--watch", "--json"};
  words.insert(words.end(), scene.begin(), scene.end());
  const json report = run_json(words);
  const json job = show(report["job_id"]);
  EXPECT_THAT(job["quote"]["uncertain"].get<std::string>(), HasSubstr("a target samples where the error is"));
  EXPECT_NEAR(job["quote"]["relative_error"].get<double>(), 0.05, 1e-12);
  EXPECT_LT(job["progress"]["worker_seconds"], job["progress"]["result_seconds"]) << "the first pass was there";
  EXPECT_NEAR(job["progress"]["result_seconds"].get<double>(),
              job["progress"]["worker_seconds"].get<double>() +
                  show(run_json({"jobs", "--json"})["jobs"].back()["job_id"])["progress"]["worker_seconds"].get<double>(),
              1e-9);
}

TEST_F(ServiceQuote, WithoutAWorkerSaysSoInTime) {
  start_coordinator();
  const Ended quote = woodcock(with_scene({"quote", "--error", "5%", "--server", address_}));
  EXPECT_EQ(quote.code, 1);
  EXPECT_THAT(quote.err, HasSubstr("no worker is connected at " + address_));
  EXPECT_EQ(jobs(), 0u);
  EXPECT_THAT(woodcock({"workers"}).out, HasSubstr("no worker is connected"));
}

TEST_F(ServiceQuote, GivesUpOnAWorkerThatHangsAndCancelsItsPilot) {
  start_coordinator();
  Program& worker = start_worker();
  ASSERT_TRUE(eventually(kPatience, [&] { return run_json({"workers", "--json"})["workers"].size() == 1; }));
  worker.signal(SIGSTOP);
  const Ended quote = woodcock(with_scene({"quote", "--error", "5%", "--server", address_, "--quote-wait", "1"}));
  EXPECT_EQ(quote.code, 1);
  EXPECT_THAT(quote.err, HasSubstr("--quote-wait"));
  const json all = run_json({"jobs", "--json"})["jobs"];
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0]["state"], "cancelled");
}

}  // namespace
}  // namespace woodcock::testing_service
