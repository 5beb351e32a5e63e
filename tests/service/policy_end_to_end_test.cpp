// Policies as users give them: real programs, options of the command line, signals.
#include <signal.h>

#include <algorithm>

#include "rpc/channel.h"
#include "tests/service/service_fixture.h"
#include "woodcock/v1/blobs_service.grpc.pb.h"

namespace woodcock::testing_service {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;
using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string kCornell = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/cornell.pbrt";
const std::string kSphere = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/sphere.pbrt";
const std::vector<std::string> kQuick{"--spp", "2", "--resolution", "16x16"};
/// Some seconds of work in tasks of a fraction of a second.
const std::vector<std::string> kLong{kCornell, "--spp", "256", "--resolution", "64x64"};

std::vector<std::string> joined(std::vector<std::string> a, const std::vector<std::string>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

class Policies : public ServiceTest {
 protected:
  /// The workers' states by the names of their folders' ids.
  std::map<std::string, std::string> worker_states() {
    std::map<std::string, std::string> states;
    const nlohmann::json list = nlohmann::json::parse(woodcock({"workers", "--json"}).out, nullptr, false);
    for (const nlohmann::json& worker : list["workers"]) states[worker["worker_id"]] = worker["condition"];
    return states;
  }
};

TEST_F(Policies, FramesAsFarmsWriteThemAreRenderedEachOnce) {
  for (const char* number : {"01", "03", "05", "20"}) fs::copy_file(kSphere, path(std::string("shot.") + number + ".pbrt"));
  start_coordinator();
  start_worker();
  const Ended run =
      woodcock(joined({"submit", path("shot.##.pbrt"), "--frames", "1-6x2,20,3", "-o", path("out.##.exr"), "--json"}, kQuick));
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("--frames names these more than once, and they are rendered once: 3"));
  EXPECT_EQ(nlohmann::json::parse(run.out)["frames"], 4);
  for (const char* number : {"01", "03", "05", "20"}) EXPECT_TRUE(fs::exists(path(std::string("out.") + number + ".exr"))) << number;
  const Ended wrong = woodcock({"submit", path("shot.##.pbrt"), "--frames", "1-6y2"});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("--frames: found \"y2\" at character 4 of \"1-6y2\""));
}

TEST_F(Policies, AJobWaitsForAWorkerWithItsTagsAndMemoryAndSaysSo) {
  start_coordinator();
  start_worker({"--memory", "2G"});
  const std::string job = submit(joined(
      {kSphere, "--user", "ada", "--require-tag", "big", "--require-tag", "gpu-room", "--memory", "4G", "--max-workers", "1"}, kQuick));
  const std::string other = submit(joined({kSphere, "--seed", "2"}, kQuick));
  EXPECT_EQ(watch(other), 0) << "whoever asks for nothing is rendered meanwhile";
  const nlohmann::json waits = show(job);
  EXPECT_EQ(waits["state"], "queued");
  EXPECT_EQ(waits["frames"][0]["waiting_reason"], "no connected worker has the tag big");
  EXPECT_EQ(waits["frames"][0]["waiting"], "no_suitable_worker");
  EXPECT_EQ(waits["policy"]["user"], "ada");
  EXPECT_EQ(waits["policy"]["max_workers"], 1);
  EXPECT_THAT(woodcock({"show", job}).out,
              AllOf(HasSubstr("user      ada"),
                    HasSubstr("needs     the tags big, gpu-room; 4.0 GiB of memory for a task; at most 1 worker at once")));
  start_worker({"--tag", "gpu-room", "--tag", "big", "--memory", "4G"});
  EXPECT_EQ(watch(job), 0);
  EXPECT_THAT(woodcock({"workers"}).out, AllOf(HasSubstr("big,gpu-room"), HasSubstr("4.0 GiB"), HasSubstr("2.0 GiB")));
}

TEST_F(Policies, AJobAfterAnotherBeginsWhenThatIsDoneAlsoPastACrashOfTheCoordinator) {
  start_coordinator();
  const std::string first = submit(joined({kSphere}, kQuick));
  const std::string second = submit(joined({kSphere, "--seed", "2", "--after", first}, kQuick));
  const Ended unknown = woodcock(joined({"submit", kSphere, "--after", "jnobody"}, kQuick));
  EXPECT_EQ(unknown.code, 1);
  EXPECT_THAT(unknown.err, HasSubstr("there is no job jnobody"));
  kill_coordinator();
  restart_coordinator();
  EXPECT_EQ(show(second)["frames"][0]["waiting_reason"], "job " + first + ", after which it begins, is not done yet");
  start_worker();
  EXPECT_EQ(watch(second), 0);
  EXPECT_EQ(show(first)["state"], "done");
}

TEST_F(Policies, AWorkerThatIsToldToEndGivesBackWhatItHasAndIsShownAsLeft) {
  start_coordinator(30);
  start_worker({"--name", "stays"});
  start_worker({"--name", "goes"});
  const std::string job = submit(joined(kLong, {"--tile", "16"}));
  wait_until_mid_job(job);
  workers_.back()->signal(SIGTERM);
  EXPECT_EQ(workers_.back()->wait(kPatience), 0) << workers_.back()->err();
  std::map<std::string, std::string> states = worker_states();
  EXPECT_EQ(states["goes"], "left");
  EXPECT_EQ(states["stays"], "ready");
  // With leases of thirty seconds the job would wait for what was not given back.
  ASSERT_EQ(watch(job), 0);
  ASSERT_EQ(woodcock({"fetch", job, "-o", path("image.exr")}).code, 0);
  EXPECT_TRUE(contents(path("image.exr")) == rendered(kLong));
}

TEST_F(Policies, AWorkerIsShownAsDrainingWhileItFinishesAndEndsAtOnceWhenToldTwice) {
  start_coordinator(600);
  start_worker({"--name", "slow", "--drain", "600", "--progress-timeout", "600", "--test-hook", "hang@*"});
  const std::string job = submit(joined({kSphere}, kQuick));
  ASSERT_TRUE(eventually(kPatience, [&] { return show(job)["progress"]["tasks_leased"] == 1; }));
  workers_.back()->signal(SIGTERM);
  ASSERT_TRUE(eventually(kPatience, [&] { return worker_states()["slow"] == "draining"; }));
  EXPECT_TRUE(workers_.back()->running()) << "it has ten minutes";
  workers_.back()->signal(SIGINT);
  EXPECT_EQ(workers_.back()->wait(seconds(20)), 0) << workers_.back()->err();
  EXPECT_THAT(workers_.back()->err(), HasSubstr("quitting at once"));
  start_worker({"--name", "sound"});
  EXPECT_EQ(watch(job), 0);
}

TEST_F(Policies, TheCoordinatorEndsAtOnceWhenToldTwice) {
  start_coordinator();
  // An upload that does not move keeps it for two seconds.
  const auto blobs = v1::BlobsService::NewStub(rpc::make_channel(address_));
  grpc::ClientContext context;
  rpc::set_deadline(context, seconds(60));
  v1::UploadResponse response;
  const auto writer = blobs->Upload(&context, &response);
  v1::UploadRequest request;
  request.mutable_header()->set_content_digest(std::string(64, 'a'));
  request.mutable_header()->set_total_bytes(100);
  ASSERT_TRUE(writer->Write(request));
  ASSERT_TRUE(eventually(kPatience, [&] { return !fs::is_empty(folder_ / "coordinator" / "uploads"); }));
  coordinator_->signal(SIGTERM);
  ASSERT_TRUE(eventually(kPatience, [&] { return coordinator_->err().find("stopping on signal") != std::string::npos; }));
  coordinator_->signal(SIGTERM);
  EXPECT_EQ(coordinator_->wait(kPatience), 0);
  EXPECT_THAT(coordinator_->err(), HasSubstr("ending at once on signal 15"));
  writer->Finish();
}

TEST_F(Policies, WrongOptionsAreNamedBeforeAnythingIsDone) {
  for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{{"--require-tag", "a b"},
                                                                                     {"--memory", "8Q"},
                                                                                     {"--max-workers", "0"},
                                                                                     {"--user", ""},
                                                                                     {"--user", "a\x1b[2J"},
                                                                                     {"--after", "../x"}}) {
    const Ended run = woodcock(joined({"submit", kSphere}, wrong));
    EXPECT_EQ(run.code, 2) << wrong[0] << " " << run.err;
    EXPECT_THAT(run.err, HasSubstr(wrong[0]));
  }
  for (const std::vector<std::string>& wrong :
       std::vector<std::vector<std::string>>{{"--tag", ".a"}, {"--memory", "8Q"}, {"--memory", "1e9"}}) {
    Program program("woodcock-worker", joined({"--dir", path("w")}, wrong), folder_ / "wrong");
    EXPECT_EQ(program.wait(kPatience), 2) << wrong[0];
    EXPECT_THAT(program.err(), HasSubstr(wrong[0]));
  }
  Program program("woodcock-coordinator", {"--dir", path("c"), "--share", "ada"}, folder_ / "wrong");
  EXPECT_EQ(program.wait(kPatience), 2);
  EXPECT_THAT(program.err(), HasSubstr("--share: found \"ada\""));
}

}  // namespace
}  // namespace woodcock::testing_service
