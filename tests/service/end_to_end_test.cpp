// The service as users run it: real programs, real faults. After each fault the image is compared with the one that
// `woodcock render` makes of the same scene, byte by byte.
#include <signal.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "tests/service/service_fixture.h"

namespace woodcock::testing_service {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;
using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string kCornell = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/cornell.pbrt";
const std::string kSphere = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/sphere.pbrt";
const std::string kCloud = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/cloud.pbrt";
/// Fractions of a second of work.
const std::vector<std::string> kQuick{kCornell, "--spp", "8", "--resolution", "48x48"};
/// Some seconds of work in tasks of a fraction of a second: long enough to meet a fault half way.
const std::vector<std::string> kLong{kCornell, "--spp", "256", "--resolution", "64x64"};

std::vector<std::string> joined(std::vector<std::string> a, const std::vector<std::string>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// --- the same bits -----------------------------------------------------------------------------------------------

class ManyWorkers : public ServiceTest, public ::testing::WithParamInterface<int> {};

TEST_P(ManyWorkers, SubmitWritesTheFileThatRenderWrites) {
  start_coordinator();
  for (int i = 0; i < GetParam(); ++i) start_worker();
  const std::vector<std::string> scene{kCloud, "--spp", "4", "--resolution", "64x48", "--seed", "7"};
  const Ended run = woodcock(joined({"submit", "-o", path("image.exr"), "--tile", "16"}, scene));
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_THAT(run.out, AllOf(HasSubstr("image.exr"), HasSubstr("image.png"), HasSubstr("error")));
  EXPECT_TRUE(contents(path("image.exr")) == rendered(scene));
  EXPECT_TRUE(fs::exists(path("image.png")));
}

INSTANTIATE_TEST_SUITE_P(Service, ManyWorkers, ::testing::Values(1, 2, 5));

class Service : public ServiceTest {};

TEST_F(Service, ExtendRendersOnlyTheDifferenceAndGivesTheSameFile) {
  start_coordinator();
  start_worker();
  // Of each attempt the worker keeps a log named "TASK-EPOCH.log".
  const auto attempts = [&](const std::string& job) {
    int count = 0;
    for (const auto& entry : fs::directory_iterator(folder_ / "worker0" / "logs"))
      count += entry.path().filename().string().starts_with(job + ".");
    return count;
  };
  const std::string job = submit(joined(kQuick, {"--tile", "16"}));
  ASSERT_EQ(watch(job), 0);
  const int first = attempts(job);
  EXPECT_EQ(first, 9) << "9 tiles of 16 pixels, samples [0, 8)";
  ASSERT_EQ(woodcock({"extend", job, "--spp", "32"}).code, 0);
  ASSERT_EQ(watch(job), 0);
  EXPECT_EQ(attempts(job) - first, 9 * 2) << "[8, 16) and [16, 32) of each tile, and nothing of before";
  const nlohmann::json progress = show(job)["progress"];
  EXPECT_EQ(progress["samples_done"], 48 * 48 * 32);
  EXPECT_EQ(progress["tasks_done"], 27);
  ASSERT_EQ(woodcock({"fetch", job, "-o", path("image.exr")}).code, 0);
  EXPECT_TRUE(contents(path("image.exr")) == rendered({kCornell, "--spp", "32", "--resolution", "48x48"}));
}

/// What the sidecar of a picture says of its errors.
nlohmann::json convergence_beside(const std::string& exr) {
  std::ifstream in(fs::path(exr).replace_extension(".accuracy.json"));
  return nlohmann::json::parse(in).at("convergence");
}

TEST_F(Service, TheErrorsOfTheFirstSamplesAreThoseOfALocalRender) {
  start_coordinator();
  start_worker();
  const std::vector<std::string> scene{kCornell, "--spp", "160", "--resolution", "32x24"};
  const Ended run = woodcock(joined({"submit", "-o", path("image.exr")}, scene));
  ASSERT_EQ(run.code, 0) << run.err;
  ASSERT_EQ(woodcock(joined({"render", "-o", path("local.exr")}, scene)).code, 0);
  const nlohmann::json there = convergence_beside(path("image.exr")), here = convergence_beside(path("local.exr"));
  std::vector<double> counts;
  double spent = 0;
  for (const nlohmann::json& point : there.at("points")) {
    counts.push_back(point.at("samples"));
    EXPECT_GT(point.at("cpu_seconds"), spent);
    spent = point.at("cpu_seconds");
    for (nlohmann::json local : here.at("points"))
      if (local.at("samples") == point.at("samples")) {
        local["cpu_seconds"] = spent;
        EXPECT_EQ(point, local);
      }
  }
  EXPECT_EQ(counts, (std::vector<double>{16, 32, 64, 128, 160}));
  EXPECT_FALSE(there.at("predictions").empty());

  // What the first job rendered takes none of the time of the second.
  const std::vector<std::string> longer{kCornell, "--spp", "256", "--resolution", "32x24"};
  ASSERT_EQ(woodcock(joined({"submit", "-o", path("longer.exr")}, longer)).code, 0);
  const nlohmann::json points = convergence_beside(path("longer.exr")).at("points");
  ASSERT_EQ(points.size(), 5u);
  EXPECT_EQ(points[3].at("relative_error"), there.at("points")[3].at("relative_error"));
  EXPECT_FALSE(points[3].contains("cpu_seconds"));
  EXPECT_GT(points[4].at("cpu_seconds"), 0);
}

TEST_F(Service, ClampedSamplesAreCountedAndSaidAsRenderDoes) {
  std::string text = contents(kSphere);
  const std::string film = "Film \"rgb\"";
  ASSERT_NE(text.find(film), std::string::npos);
  text.insert(text.find(film) + film.size(), " \"float maxcomponentvalue\" 0.4");
  std::ofstream(path("clamped.pbrt")) << text;
  const std::vector<std::string> scene{path("clamped.pbrt"), "--spp", "4", "--resolution", "32x32"};
  const Ended local = woodcock(joined({"render", "--json", "-o", path("local.exr")}, scene));
  const auto clamped = nlohmann::json::parse(local.out)["counters"]["clamped_samples"];
  ASSERT_GT(clamped, 0) << "the fault did not fire";
  ASSERT_THAT(local.err, HasSubstr("clamped by the film's maxcomponentvalue"));

  start_coordinator();
  start_worker();
  const Ended run = woodcock(joined({"submit", "--tile", "16", "--watch", "--json"}, scene));
  ASSERT_EQ(run.code, 0) << run.err;
  const std::string warning = local.err.substr(local.err.rfind("warning: "));
  EXPECT_THAT(run.err, HasSubstr(warning));
  kill_coordinator();
  restart_coordinator();
  const std::string job = nlohmann::json::parse(run.out)["job_id"];
  EXPECT_EQ(show(job)["frames"][0]["health"]["clamped_samples"], clamped) << "the counts outlive a crash";
  EXPECT_THAT(woodcock({"show", job}).out, HasSubstr(warning));
  EXPECT_THAT(woodcock({"fetch", job, "-o", path("image.exr")}).err, HasSubstr(warning));

  const Ended again = woodcock(joined({"submit", "--tile", "16", "-o", path("again.exr")}, scene));
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_THAT(again.err, HasSubstr(warning)) << "results that were there already keep their counts";
}

TEST_F(Service, FramesOfASequenceAreNumbered) {
  for (const char* number : {"08", "09"}) fs::copy_file(kSphere, path(std::string("shot.") + number + ".pbrt"));
  start_coordinator();
  start_worker();
  const std::vector<std::string> settings{"--spp", "2", "--resolution", "16x16"};
  const Ended run = woodcock(joined({"submit", path("shot.##.pbrt"), "--frames", "8-9", "-o", path("out.##.exr")}, settings));
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_TRUE(fs::exists(path("out.08.exr")));
  EXPECT_TRUE(fs::exists(path("out.09.exr")));
  EXPECT_FALSE(contents(path("out.08.exr")) == contents(path("out.09.exr"))) << "each frame has its own random numbers";
}

TEST_F(Service, SecondSubmitOfTheSameSceneIsAnsweredFromFinishedResults) {
  start_coordinator();
  start_worker();
  ASSERT_EQ(woodcock(joined({"submit", "-o", path("one.exr")}, kQuick)).code, 0);
  workers_.front()->signal(SIGTERM);
  ASSERT_EQ(workers_.front()->wait(kPatience), 0);
  start_worker();  // of the same build: a frame is pinned to one
  ASSERT_EQ(woodcock(joined({"submit", "-o", path("two.exr")}, kQuick)).code, 0);
  EXPECT_TRUE(contents(path("one.exr")) == contents(path("two.exr")));
}

TEST_F(Service, PausedJobWaitsAndResumedJobEnds) {
  start_coordinator();
  const std::string job = submit(kQuick);
  EXPECT_EQ(woodcock({"pause", job}).code, 0);
  start_worker();
  // The worker renders what was submitted later, to its end, and nothing of the job that waits.
  const std::string later = submit({kSphere, "--spp", "64", "--resolution", "64x64", "--tile", "16"});
  EXPECT_EQ(watch(later), 0);
  const nlohmann::json paused = show(job);
  EXPECT_EQ(paused["progress"]["tasks_done"], 0);
  EXPECT_EQ(paused["progress"]["tasks_leased"], 0);
  EXPECT_EQ(paused["state"], "paused");
  EXPECT_EQ(woodcock({"resume", job}).code, 0);
  EXPECT_EQ(watch(job), 0);
  EXPECT_THAT(woodcock({"jobs"}).out, AllOf(HasSubstr(job), HasSubstr("done")));
}

TEST_F(Service, CancelledJobEndsAndItsPartIsFetched) {
  start_coordinator();
  start_worker();
  const std::string job = submit(joined(kLong, {"--tile", "16"}));
  wait_until_mid_job(job);
  EXPECT_EQ(woodcock({"cancel", job}).code, 0);
  EXPECT_EQ(watch(job), 1);
  EXPECT_EQ(show(job)["state"], "cancelled");
  EXPECT_EQ(woodcock({"fetch", job, "--partial", "-o", path("part.exr")}).code, 3);
  EXPECT_TRUE(fs::exists(path("part.exr")));
  EXPECT_TRUE(fs::exists(path("part.nodes.exr")));
}

TEST_F(Service, F30_APreviewOfAJobInFlightLacksNoPixelAfterItsFirstRound) {
  start_coordinator();
  start_worker();
  const std::string job = submit(joined(kLong, {"--tile", "16"}));
  // The first round has a task for each of 16 tiles.
  ASSERT_TRUE(eventually(kPatience, [&] { return show(job)["progress"]["tasks_done"] >= 17; }));
  const Ended part = woodcock({"fetch", job, "--partial", "--json", "-o", path("part.exr")});
  EXPECT_EQ(part.code, 3) << part.err;
  const nlohmann::json statistics = nlohmann::json::parse(part.out)["images"][0]["statistics"];
  EXPECT_EQ(statistics["missing_pixels"], 0) << statistics;
  EXPECT_GE(statistics["samples"], 16) << statistics;
  EXPECT_EQ(woodcock({"merge", path("part.exr"), "-o", path("again.exr")}).code, 0);
  EXPECT_TRUE(contents(path("again.exr")) == contents(path("part.exr"))) << "its nodes are beside it";
  EXPECT_EQ(woodcock({"cancel", job}).code, 0);
}

// --- faults ------------------------------------------------------------------------------------------------------

class Fault : public ServiceTest {
 protected:
  std::string start_long_job() { return submit(joined(kLong, {"--tile", "16"})); }
  void expect_undisturbed(const std::string& job) {
    ASSERT_EQ(watch(job), 0) << show(job).dump(2);
    ASSERT_EQ(woodcock({"fetch", job, "-o", path("image.exr")}).code, 0);
    EXPECT_TRUE(contents(path("image.exr")) == rendered(kLong));
  }
};

TEST_F(Fault, F01_WorkerKilledMidTile) {
  start_coordinator();
  start_worker();
  start_worker();
  const std::string job = start_long_job();
  wait_until_mid_job(job);
  workers_.front()->signal(SIGKILL);
  EXPECT_EQ(workers_.front()->wait(kPatience), 128 + SIGKILL);
  expect_undisturbed(job);
}

TEST_F(Fault, F02_WorkerStoppedPastItsLeaseThenContinued) {
  start_coordinator();
  start_worker();
  const std::string job = start_long_job();
  wait_until_mid_job(job);
  const auto watcher = woodcock_in_background({"watch", job});
  workers_.front()->signal(SIGSTOP);
  // There is nobody else: the job is where it was when the lease ends.
  ASSERT_TRUE(eventually(kPatience, [&] { return watcher->err().find("no progress within the lease") != std::string::npos; }))
      << "the lease of a stopped worker does not expire\n"
      << watcher->err();
  EXPECT_EQ(show(job)["progress"]["tasks_leased"], 0);
  start_worker();
  workers_.front()->signal(SIGCONT);
  expect_undisturbed(job);
  EXPECT_TRUE(workers_.front()->running());
}

TEST_F(Fault, F03_CoordinatorKilledMidJobAndStartedAgain) {
  start_coordinator();
  start_worker();
  start_worker();
  const std::string job = start_long_job();
  const auto watcher = woodcock_in_background({"watch", job});
  wait_until_mid_job(job);
  kill_coordinator();
  wait_until_workers_miss_the_coordinator();
  restart_coordinator();
  EXPECT_EQ(watcher->wait(kPatience), 0) << "a watch lives through the restart\n" << watcher->err();
  expect_undisturbed(job);
}

TEST_F(Fault, F07_TaskThatFailedIsTriedAgainInParts) {
  start_coordinator();
  start_worker({"--test-hook", "nan@1"});
  const std::vector<std::string> scene{kSphere, "--spp", "4", "--resolution", "32x16"};
  const Ended run = woodcock(joined({"submit", "--tile", "16", "-o", path("image.exr")}, scene));
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("not finite")) << "the fault did not fire, or was not shown";
  EXPECT_TRUE(contents(path("image.exr")) == rendered(scene));
}

TEST_F(Fault, F08_HungRenderIsKilledAndDoneElsewhere) {
  start_coordinator();
  start_worker({"--test-hook", "hang@2", "--progress-timeout", "2", "--loading-timeout", "2"});
  const std::string job = start_long_job();
  ASSERT_TRUE(eventually(kPatience, [&] { return workers_.front()->err().find("no progress") != std::string::npos; }))
      << "the fault did not fire";
  start_worker();
  expect_undisturbed(job);
}

TEST_F(Fault, F09_WorkerThatCrashesAtEveryTaskDoesNotHarmTheJob) {
  start_coordinator();
  start_worker({"--test-hook", "crash@*"});
  const std::string job = start_long_job();
  ASSERT_TRUE(eventually(kPatience, [&] { return workers_.front()->err().find("crashed with") != std::string::npos; }))
      << "the fault did not fire";
  start_worker();
  expect_undisturbed(job);
}

TEST_F(Fault, F13_ResultsOutliveTheCoordinatorsAbsence) {
  start_coordinator(30);
  start_worker();
  const std::string job = start_long_job();
  wait_until_mid_job(job);
  kill_coordinator();
  const fs::path spool = folder_ / "worker0" / "spool";
  const auto holds_result = [&] {
    for (const auto& entry : fs::directory_iterator(spool))
      if (entry.path().extension() == ".offer") return true;
    return false;
  };
  ASSERT_TRUE(eventually(kPatience, holds_result)) << "the fault did not fire";
  workers_.front()->signal(SIGKILL);
  workers_.front()->wait(kPatience);
  ASSERT_TRUE(holds_result());
  restart_coordinator(30);
  workers_.clear();
  start_worker();
  ASSERT_TRUE(eventually(kPatience, [&] { return !holds_result(); })) << "the spool is handed in again";
  expect_undisturbed(job);
}

TEST_F(Fault, DrainedWorkerEndsAndTheJobGoesOn) {
  start_coordinator();
  start_worker();
  start_worker();
  const std::string job = start_long_job();
  wait_until_mid_job(job);
  workers_.front()->signal(SIGTERM);
  EXPECT_EQ(workers_.front()->wait(kPatience), 0) << workers_.front()->err();
  expect_undisturbed(job);
}

// --- wrong use ---------------------------------------------------------------------------------------------------

class WrongUse : public ServiceTest {};

TEST_F(WrongUse, AbsentCoordinatorIsSaidWithinFiveSeconds) {
  for (const std::vector<std::string>& command : {std::vector<std::string>{"jobs"}, {"fetch", "x"}, {"submit", kCornell}}) {
    const Ended run = woodcock(command);
    EXPECT_EQ(run.code, 1) << command[0];
    EXPECT_LT(run.seconds, 5) << command[0];
    EXPECT_THAT(run.err, AllOf(HasSubstr("no coordinator answers at 127.0.0.1:1"), HasSubstr("woodcock up")));
    EXPECT_EQ(run.out, "");
  }
}

TEST_F(WrongUse, UnknownJobIsAnError) {
  start_coordinator();
  for (const char* command : {"show", "watch", "fetch", "cancel", "pause", "resume"})
    EXPECT_EQ(woodcock({command, "nosuchjob"}).code, 1) << command;
}

TEST_F(WrongUse, WrongArgumentsAreCodeTwo) {
  EXPECT_EQ(woodcock({"submit"}).code, 2);
  EXPECT_EQ(woodcock({"submit", kCornell, "--frames", "5-1"}).code, 2);
  // One and the same scene three times; one frame of it is a choice of its noise.
  const Ended same = woodcock({"submit", kCornell, "--frames", "1-3"});
  EXPECT_EQ(same.code, 2);
  EXPECT_THAT(same.err, AllOf(HasSubstr("found 3 frames of"), HasSubstr("has no ####"), HasSubstr("shot.####.pbrt")));
  EXPECT_EQ(woodcock({"submit", kCornell, "--frames", "7"}).code, 1) << "there is no coordinator, and nothing wrong with the words";
  EXPECT_EQ(woodcock({"submit", kCornell, "--spp", "0"}).code, 2);
  EXPECT_EQ(woodcock({"submit", kCornell, "--name", ""}).code, 2);
  for (const char* command : {"show", "watch", "fetch", "cancel", "pause", "resume", "repin", "extend", "delete"}) {
    const Ended run = woodcock({command, ""});
    EXPECT_EQ(run.code, 2) << command;
    EXPECT_THAT(run.err, HasSubstr("found an empty text, expected a job's id")) << command;
  }
  EXPECT_EQ(woodcock({"extend", "x"}).code, 2);
  EXPECT_EQ(woodcock({"nosuchcommand"}).code, 2);
  Program worker("woodcock-worker", {"--slots", "0", "--dir", path("w")}, folder_ / "wrong");
  EXPECT_EQ(worker.wait(kPatience), 2);
  Program without_folder("woodcock-worker", {}, folder_ / "wrong2");
  EXPECT_EQ(without_folder.wait(kPatience), 2);
}

TEST_F(WrongUse, OutputThatCannotBeWrittenIsSaidBeforeTheWork) {
  start_coordinator();
  const Ended run = woodcock({"submit", kCornell, "-o", path("no/such/folder/image.exr")});
  EXPECT_EQ(run.code, 1);
  EXPECT_THAT(run.err, HasSubstr("no/such/folder"));
  EXPECT_EQ(nlohmann::json::parse(woodcock({"jobs", "--json"}).out)["jobs"].size(), 0u);
}

TEST_F(WrongUse, ErrorInTheSceneIsSaidWithItsPlaceBeforeAnythingIsSent) {
  std::ofstream(path("bad.pbrt")) << "WorldBegin\nShape \"sphere\" \"float radios\" 1\n";
  const Ended run = woodcock({"submit", path("bad.pbrt")});
  EXPECT_EQ(run.code, 1);
  EXPECT_THAT(run.err, AllOf(HasSubstr("bad.pbrt:2:"), HasSubstr("radios")));
}

TEST_F(WrongUse, PortInUseEndsTheSecondCoordinator) {
  start_coordinator();
  Program second("woodcock-coordinator", {"--dir", path("other"), "--listen", address_}, folder_ / "second");
  EXPECT_EQ(second.wait(kPatience), 1);
  EXPECT_THAT(second.err(), HasSubstr(address_));
}

// --- up ----------------------------------------------------------------------------------------------------------

class Up : public ServiceTest {};

/// The process and everything it started, directly or not.
std::vector<pid_t> family(pid_t root) {
  std::vector<pid_t> members{root};
  for (size_t i = 0; i < members.size(); ++i)
    for (const auto& task : fs::directory_iterator("/proc/" + std::to_string(members[i]) + "/task")) {
      std::istringstream children(contents(task.path() / "children"));
      for (pid_t child = 0; children >> child;) members.push_back(child);
    }
  return members;
}

bool none_runs(const std::vector<pid_t>& pids) {
  return std::none_of(pids.begin(), pids.end(), [](pid_t pid) {
    const std::string stat = contents("/proc/" + std::to_string(pid) + "/stat");
    return !stat.empty() && stat.find(") Z") == std::string::npos;
  });
}

TEST_F(Up, ServesJobsAndLeavesNoProcess) {
  const auto up =
      woodcock_in_background({"up", "--workers", "2", "--threads-per-worker", "1", "--port", "0", "--dir", path("up"), "--json"});
  ASSERT_TRUE(eventually(kPatience, [&] { return up->out().find('\n') != std::string::npos || !up->running(); }));
  ASSERT_TRUE(up->running()) << up->err();
  address_ = nlohmann::json::parse(up->out())["address"];
  ASSERT_EQ(woodcock(joined({"submit", "-o", path("image.exr")}, kQuick)).code, 0);
  EXPECT_TRUE(contents(path("image.exr")) == rendered(kQuick));
  const auto processes = family(up->pid());
  EXPECT_GE(processes.size(), 6u) << "up, coordinator, two workers with a render process each";
  up->signal(SIGINT);
  EXPECT_EQ(up->wait(kPatience), 0) << up->err();
  EXPECT_TRUE(eventually(seconds(10), [&] { return none_runs(processes); }));
}

TEST_F(Up, F31_WhatIsKilledIsStartedAgainAndTheServiceStays) {
  const auto up =
      woodcock_in_background({"up", "--workers", "2", "--threads-per-worker", "1", "--port", "0", "--dir", path("up"), "--json"});
  ASSERT_TRUE(eventually(kPatience, [&] { return up->out().find('\n') != std::string::npos || !up->running(); }));
  ASSERT_TRUE(up->running()) << up->err();
  address_ = nlohmann::json::parse(up->out())["address"];
  // Every program that it started itself: the coordinator and both workers.
  std::vector<pid_t> started;
  std::istringstream children(contents("/proc/" + std::to_string(up->pid()) + "/task/" + std::to_string(up->pid()) + "/children"));
  for (pid_t child = 0; children >> child;) started.push_back(child);
  ASSERT_EQ(started.size(), 3u);
  for (const pid_t child : started) ASSERT_EQ(::kill(child, SIGKILL), 0);
  for (const char* name : {"coordinator", "worker-1", "worker-2"})
    EXPECT_TRUE(eventually(kPatience, [&] { return up->err().find(std::string(name) + " was ended by Killed") != std::string::npos; }))
        << name;
  // The killed one's address file may be there: the answer counts.
  ASSERT_TRUE(eventually(kPatience, [&] { return woodcock({"workers"}).out.find("ready") != std::string::npos; }));
  ASSERT_EQ(woodcock(joined({"submit", "-o", path("image.exr")}, kQuick)).code, 0);
  EXPECT_TRUE(contents(path("image.exr")) == rendered(kQuick));
  EXPECT_TRUE(up->running());
  const auto processes = family(up->pid());
  up->signal(SIGINT);
  EXPECT_EQ(up->wait(kPatience), 0) << up->err();
  EXPECT_TRUE(eventually(seconds(10), [&] { return none_runs(processes); }));
}

TEST_F(Up, KilledOutrightItStillLeavesNoProcess) {
  const auto up = woodcock_in_background({"up", "--workers", "1", "--port", "0", "--dir", path("up"), "--json"});
  ASSERT_TRUE(eventually(kPatience, [&] { return up->out().find('\n') != std::string::npos || !up->running(); }));
  const auto processes = family(up->pid());
  EXPECT_GE(processes.size(), 4u);
  up->signal(SIGKILL);
  up->wait(kPatience);
  EXPECT_TRUE(eventually(seconds(20), [&] { return none_runs(processes); }));
}

}  // namespace
}  // namespace woodcock::testing_service
