// Deletion, retention and back-up on the real programs, also where the coordinator is killed in the middle.
#include <signal.h>

#include "tests/service/farm_faults.h"

namespace woodcock::testing_service {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class RetentionOnAFarm : public FarmFault {
 protected:
  fs::path dir() const { return folder_ / "coordinator"; }
  Ended coordinator_command(const std::vector<std::string>& arguments) {
    Program program("woodcock-coordinator", arguments, folder_ / ("command" + std::to_string(++commands_)));
    Ended ended;
    ended.code = program.wait(kPatience).value_or(-1);
    ended.out = program.out();
    ended.err = program.err();
    return ended;
  }
  Ended back_up(const std::string& name) { return coordinator_command({"backup", path(name), "--dir", dir()}); }
  size_t blobs() const {
    size_t count = 0;
    for (const auto& entry : fs::recursive_directory_iterator(dir() / "blobs")) count += entry.is_regular_file();
    return count;
  }

 private:
  int commands_ = 0;
};

TEST_F(RetentionOnAFarm, DeleteRefusesWhatRunsAndForgetsWhatEnded) {
  start_coordinator();
  start_worker();
  const std::string job = start_job();
  const Ended refused = woodcock({"delete", job});
  EXPECT_EQ(refused.code, 1);
  EXPECT_THAT(refused.err, HasSubstr("cancel it before, or delete it with --cancel"));
  ASSERT_EQ(watch(job), 0);
  const Ended events = woodcock({"show", job, "--events"});
  ASSERT_EQ(events.code, 0) << events.err;
  for (const char* word : {"submitted", "lease granted", "task committed", "frame done", "worker"})
    EXPECT_THAT(events.out, HasSubstr(word));
  const nlohmann::json list = nlohmann::json::parse(woodcock({"show", job, "--events", "--json"}).out);
  ASSERT_GT(list["events"].size(), 40u);
  for (size_t i = 0; i < list["events"].size(); ++i) EXPECT_EQ(list["events"][i]["number"], i + 1);
  const nlohmann::json rest = nlohmann::json::parse(woodcock({"show", job, "--events", "--after", "40", "--json"}).out);
  EXPECT_EQ(rest["events"].size(), list["events"].size() - 40);
  EXPECT_EQ(woodcock({"delete", job}).code, 0);
  for (const char* command : {"show", "delete", "cancel", "watch"}) EXPECT_EQ(woodcock({command, job}).code, 1) << command;
  EXPECT_EQ(nlohmann::json::parse(woodcock({"jobs", "--json"}).out)["jobs"].size(), 0u);
  const std::string other = start_job();
  EXPECT_EQ(nlohmann::json::parse(woodcock({"delete", other, "--cancel", "--json"}).out)["deleted"], true);
  expect_undisturbed(start_job());
}

TEST_F(RetentionOnAFarm, LimitsAreTriedWithADryRunAndAppliedByCommand) {
  start_coordinator(3, 0, {"--pin", "1", "--keep-jobs", "1s"});
  start_worker();
  const std::string job = start_job();
  ASSERT_EQ(watch(job), 0);
  nlohmann::json plan;
  ASSERT_TRUE(eventually(kPatience, [&] {
    plan = nlohmann::json::parse(woodcock({"retain", "--dry-run", "--json"}).out);
    return plan["jobs_total"] == 1;
  })) << plan.dump(2);
  EXPECT_EQ(plan["jobs"][0]["job_id"], job);
  EXPECT_EQ(plan["jobs"][0]["cause"], "age");
  EXPECT_EQ(plan["freed_bytes"], plan["bytes_before"]);
  EXPECT_EQ(show(job)["state"], "done");
  EXPECT_EQ(nlohmann::json::parse(woodcock({"retain", "--dry-run", "--keep-jobs", "1d", "--json"}).out)["jobs_total"], 0);
  EXPECT_EQ(woodcock({"retain", "--keep-jobs", "1d"}).code, 2) << "only with --dry-run";
  EXPECT_EQ(woodcock({"retain", "--dry-run", "--keep-jobs", "1 fortnight"}).code, 2);
  EXPECT_THAT(woodcock({"retain", "--dry-run"}).out, HasSubstr("1 job would go"));
  EXPECT_THAT(woodcock({"retain"}).out, HasSubstr("1 job went"));
  EXPECT_EQ(woodcock({"show", job}).code, 1);
  // What was asked for a moment ago goes when its pin has ended.
  EXPECT_TRUE(eventually(kPatience, [&] {
    woodcock({"retain"});
    return blobs() == 0;
  }));
  expect_undisturbed(start_job());
  for (const char* wrong : {"1x", "-1d", "d"})
    EXPECT_EQ(coordinator_command({"--dir", path("other"), "--keep-jobs=" + std::string(wrong)}).code, 2) << wrong;
}

class KilledInRetention : public RetentionOnAFarm, public ::testing::WithParamInterface<const char*> {};

TEST_P(KilledInRetention, F03TheDeletedJobStaysAwayAndOthersAreWhole) {
  start_coordinator(3, 0, {"--pin", "1"});
  start_worker();
  const std::string kept = start_job(), gone = start_job({"--tile", "16", "--seed", "5"});
  ASSERT_EQ(watch(kept), 0);
  ASSERT_EQ(watch(gone), 0);
  kill_coordinator();
  const int port = std::stoi(address_.substr(address_.rfind(':') + 1));
  start_coordinator(3, port, {"--pin", "1", "--test-hook", GetParam()});
  const auto client = woodcock_in_background({"delete", gone});
  // The clean-up that meets the point may come before or after.
  const auto cleaner = woodcock_in_background({"retain"});
  ASSERT_EQ(coordinator_->wait(kPatience), 128 + SIGKILL) << "the failpoint did not fire";
  restart_coordinator();
  EXPECT_TRUE(client->wait(kPatience).has_value());
  EXPECT_TRUE(cleaner->wait(kPatience).has_value());
  EXPECT_EQ(woodcock({"delete", gone}).code, 1) << "it is deleted, by the first call or when that was repeated";
  expect_undisturbed(kept);
  EXPECT_TRUE(eventually(kPatience, [&] { return woodcock({"retain"}).code == 0; }));
  expect_undisturbed(start_job());
}

INSTANTIATE_TEST_SUITE_P(Service, KilledInRetention, ::testing::Values("job-taken-out@1", "job-rows-deleted@1"));

TEST_F(RetentionOnAFarm, F03ACoordinatorKilledInACleanUpHasLostNothing) {
  start_coordinator(3, 0, {"--pin", "1"});
  start_worker();
  const std::string job = start_job();
  ASSERT_EQ(watch(job), 0);
  kill_coordinator();
  const int port = std::stoi(address_.substr(address_.rfind(':') + 1));
  start_coordinator(3, port, {"--pin", "1", "--test-hook", "marked@1"});
  const auto cleaner = woodcock_in_background({"retain"});
  ASSERT_EQ(coordinator_->wait(kPatience), 128 + SIGKILL) << "the failpoint did not fire";
  restart_coordinator();
  EXPECT_TRUE(cleaner->wait(kPatience).has_value());
  expect_undisturbed(job);
}

TEST_F(RetentionOnAFarm, F25ARestoredBackUpOfARunningCoordinatorGoesOnWithItsJobs) {
  start_coordinator();
  start_worker();
  const std::string job = start_job();
  wait_until_mid_job(job);
  const Ended made = back_up("backup");
  ASSERT_EQ(made.code, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("hard links"));
  const Ended again = back_up("backup");
  EXPECT_EQ(again.code, 1);
  EXPECT_THAT(again.err, HasSubstr("is there already"));
  // It goes on, and is started once more: workers have seen a later term than the back-up's.
  kill_coordinator();
  restart_coordinator();
  kill_coordinator();
  restart_coordinator();
  const std::string lost = start_job({"--tile", "16", "--seed", "7"});
  kill_coordinator();
  fs::rename(dir(), folder_ / "broken");
  const Ended restored = coordinator_command({"restore", path("backup"), "--dir", dir()});
  ASSERT_EQ(restored.code, 0) << restored.err;
  EXPECT_EQ(coordinator_command({"restore", path("backup"), "--dir", dir()}).code, 1) << "it is there now";
  restart_coordinator();
  expect_undisturbed(job);
  EXPECT_TRUE(workers_.front()->running());
  EXPECT_THAT(workers_.front()->err(), ::testing::Not(HasSubstr("is of another cluster")));
  EXPECT_EQ(woodcock({"show", lost}).code, 1) << "the back-up does not know it";
  expect_undisturbed(start_job());
}

class KilledInBackUp : public RetentionOnAFarm, public ::testing::WithParamInterface<const char*> {};

TEST_P(KilledInBackUp, F03TheFolderDoesNotAppearAndTheNextBackUpDoes) {
  start_coordinator(3, 0, {"--test-hook", GetParam()});
  start_worker();
  const std::string job = start_job();
  wait_until_mid_job(job);
  const Ended ended = back_up("backup");
  EXPECT_EQ(ended.code, 1);
  EXPECT_THAT(ended.err, HasSubstr("the coordinator ended before the back-up was complete"));
  ASSERT_EQ(coordinator_->wait(kPatience), 128 + SIGKILL) << "the failpoint did not fire";
  EXPECT_FALSE(fs::exists(folder_ / "backup"));
  // One that does not run is backed up without its help, sockets of before notwithstanding.
  ASSERT_EQ(back_up("stopped").code, 0);
  restart_coordinator();
  const Ended made = back_up("backup");
  ASSERT_EQ(made.code, 0) << made.err;
  expect_undisturbed(job);
  expect_no_leftovers();
}

INSTANTIATE_TEST_SUITE_P(Service, KilledInBackUp, ::testing::Values("backup-database-copied@1", "backup-blobs-taken@1"));

TEST_F(RetentionOnAFarm, WaitsAreShownWatchedAndLogged) {
  start_coordinator();
  const std::string job = start_job();
  const auto watcher = woodcock_in_background({"watch", job});
  EXPECT_EQ(show(job)["frames"][0]["waiting"], "no_worker");
  EXPECT_TRUE(says(*watcher, "no worker is connected"));
  EXPECT_TRUE(says(*coordinator_, "job " + job + " waits: no worker is connected"));
  EXPECT_THAT(woodcock({"show", job, "--events"}).out, HasSubstr("waits: no worker is connected"));
  start_worker();
  EXPECT_EQ(watcher->wait(kPatience), 0);
  EXPECT_EQ(show(job)["frames"][0]["waiting"], "");
}

}  // namespace
}  // namespace woodcock::testing_service
