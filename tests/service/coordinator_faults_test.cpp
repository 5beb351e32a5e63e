// The coordinator ends at the worst moments, by SIGKILL at each of its failpoints and by SIGTERM, and starts again on the same
// folder. The image must be, byte by byte, the one that an undisturbed `woodcock render` makes.
#include <signal.h>

#include <array>
#include <fstream>
#include <set>

#include "coordinator/failpoint.h"
#include "tests/service/service_fixture.h"

namespace woodcock::testing_service {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

const std::string kSphere = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/sphere.pbrt";
const std::string kCornell = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/cornell.pbrt";

/// "POINT@N": the N-th time it is passed. The sources say where each lies.
class CoordinatorKilledAt : public ServiceTest, public ::testing::WithParamInterface<const char*> {};

TEST_P(CoordinatorKilledAt, F03F04TheImageIsTheSameAndNothingIsLeftBehind) {
  start_coordinator(3, 0, {"--test-hook", GetParam()});
  start_worker();
  const std::vector<std::string> scene{kSphere, "--spp", "8", "--resolution", "48x48"};
  const auto submit = woodcock_in_background({"submit", kSphere, "--spp", "8", "--resolution", "48x48", "--tile", "16"});
  ASSERT_EQ(coordinator_->wait(kPatience), 128 + SIGKILL) << "the failpoint did not fire";
  ASSERT_THAT(coordinator_->err(), HasSubstr("test hook: killed at"));
  restart_coordinator();
  ASSERT_EQ(submit->wait(kPatience), 0) << submit->err();
  const std::string job = submit->out().substr(0, submit->out().find('\n'));
  ASSERT_EQ(watch(job), 0) << show(job).dump(2);
  const nlohmann::json progress = show(job)["progress"];
  EXPECT_EQ(progress["tasks_done"], 9);
  EXPECT_EQ(progress["tasks_total"], 9);
  EXPECT_EQ(progress["samples_done"], 48 * 48 * 8) << "each sample counts once";
  ASSERT_EQ(woodcock({"fetch", job, "-o", path("image.exr")}).code, 0);
  EXPECT_TRUE(contents(path("image.exr")) == rendered(scene));
  expect_no_leftovers();
}

// Uploads 1 and 2 are the scene and its manifest; the job has 9 results and one image. The client repeats a submit without an answer.
constexpr std::array kKills{"upload-written@4", "upload-synced@4",  "upload-renamed@4", "upload-published@4", "job-inserted@1",
                            "frame-pinned@1",   "batch-written@12", "in-commit@3",      "after-commit@1",     "after-commit@9",
                            "before-verdict@2", "before-merge@1",   "during-merge@1",   "after-merge@1",      "image-synced@1",
                            "image-renamed@1",  "after-publish@1",  "after-frame-row@1"};
INSTANTIATE_TEST_SUITE_P(Service, CoordinatorKilledAt, ::testing::ValuesIn(kKills));

class CoordinatorKilledInASubmit : public ServiceTest {};

TEST_F(CoordinatorKilledInASubmit, F03AJobOfManyFramesIsThereWholeOrNotAtAll) {
  start_coordinator(3, 0, {"--test-hook", "frames-written@2"});
  const std::string scene = contents(kSphere);
  for (int frame = 1; frame <= 600; ++frame) {
    const std::string number = std::to_string(frame);
    std::ofstream(path("shot." + std::string(3 - number.size(), '0') + number + ".pbrt")) << scene << "# " << number << "\n";
  }
  const auto submit = woodcock_in_background({"submit", path("shot.###.pbrt"), "--frames", "1-600", "--spp", "1", "--resolution", "8x8"});
  ASSERT_EQ(coordinator_->wait(kPatience), 128 + SIGKILL) << "the failpoint did not fire";
  restart_coordinator();
  // The client submits it again.
  ASSERT_EQ(submit->wait(kPatience), 0) << submit->err();
  const nlohmann::json jobs = nlohmann::json::parse(woodcock({"jobs", "--json"}).out)["jobs"];
  ASSERT_EQ(jobs.size(), 1u);
  const nlohmann::json job = show(jobs[0]["job_id"]);
  ASSERT_EQ(job["frames"].size(), 600u);
  for (size_t i = 0; i < 600; ++i) EXPECT_EQ(job["frames"][i]["frame"], i + 1);
}

TEST(CoordinatorKilled, AtEveryFailpointOfItsSources) {
  std::set<std::string> points(coordinator::failpoints().begin(), coordinator::failpoints().end()), killed;
  for (const std::string kill : kKills) killed.insert(kill.substr(0, kill.find('@')));
  // retention_faults_test kills it at these, and a test of its own above in the middle of a submit.
  killed.insert({"frames-written", "job-taken-out", "job-rows-deleted", "marked", "backup-database-copied", "backup-blobs-taken"});
  EXPECT_EQ(killed, points) << "each failpoint has its kill above";
}

class CoordinatorStops : public ServiceTest {};

TEST_F(CoordinatorStops, BySigtermWithCodeZeroAndTheJobGoesOnAfterwards) {
  start_coordinator();
  start_worker();
  const std::vector<std::string> scene{kCornell, "--spp", "128", "--resolution", "64x64"};
  const std::string job = submit({kCornell, "--spp", "128", "--resolution", "64x64", "--tile", "16"});
  wait_until_mid_job(job);
  coordinator_->signal(SIGTERM);
  EXPECT_EQ(coordinator_->wait(std::chrono::seconds(30)), 0) << coordinator_->err();
  EXPECT_TRUE(fs::is_empty(folder_ / "coordinator" / "temporary"));
  EXPECT_FALSE(fs::exists(folder_ / "coordinator" / "address"));
  restart_coordinator();
  ASSERT_EQ(watch(job), 0) << show(job).dump(2);
  ASSERT_EQ(woodcock({"fetch", job, "-o", path("image.exr")}).code, 0);
  EXPECT_TRUE(contents(path("image.exr")) == rendered(scene));
  expect_no_leftovers();
}

TEST_F(CoordinatorStops, AtOnceWhenTheHookIsNoFailpoint) {
  for (const char* hook : {"nowhere@1", "after-commit", "after-commit@0", "after-commit@x", "@1"}) {
    Program program("woodcock-coordinator", {"--dir", path("c"), "--test-hook", hook}, folder_ / "wrong");
    EXPECT_EQ(program.wait(kPatience), 2) << hook;
    EXPECT_THAT(program.err(), HasSubstr("after-frame-row")) << hook;
  }
}

}  // namespace
}  // namespace woodcock::testing_service
