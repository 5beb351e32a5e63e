// F11: the disk under the database fails. The coordinator ends at once, says why, and has acknowledged nothing that is not there when
// it is started again on a disk that works.
#include <fstream>

#include "tests/service/service_fixture.h"

namespace woodcock::testing_service {
namespace {

using ::testing::HasSubstr;

const std::string kCornell = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/cornell.pbrt";

/// "write" or "sync": what fails.
class FailingDisk : public ServiceTest, public ::testing::WithParamInterface<const char*> {
 protected:
  std::map<std::string, std::string> failing() const {
    return {{"LD_PRELOAD", WOODCOCK_FAILING_DISK},
            {"WOODCOCK_FAILING_DISK", path("disk-fails")},
            {"ASAN_OPTIONS", "verify_asan_link_order=0"},
            {"TSAN_OPTIONS", "verify_interceptors=0"}};
  }
  void break_disk() const { std::ofstream(path("disk-fails")) << GetParam(); }
  void expect_a_reason() {
    ASSERT_EQ(coordinator_->wait(kPatience), 1) << "the fault did not fire\n" << coordinator_->err();
    EXPECT_THAT(coordinator_->err(), HasSubstr("the database failed: "));
    EXPECT_THAT(coordinator_->err(), HasSubstr("disk I/O error"));
  }
};

TEST_P(FailingDisk, F11_InMidJobEndsTheCoordinatorAndTheJobGoesOnAfterwards) {
  start_coordinator(3, 0, {}, failing());
  start_worker();
  const std::vector<std::string> scene{kCornell, "--spp", "128", "--resolution", "64x64"};
  const std::string job = submit({kCornell, "--spp", "128", "--resolution", "64x64", "--tile", "16"});
  wait_until_mid_job(job);
  break_disk();
  expect_a_reason();
  std::filesystem::remove(path("disk-fails"));
  restart_coordinator();
  ASSERT_EQ(watch(job), 0) << show(job).dump(2);
  const nlohmann::json progress = show(job)["progress"];
  EXPECT_EQ(progress["tasks_done"], progress["tasks_total"]);
  EXPECT_EQ(progress["samples_done"], 64 * 64 * 128) << "each sample counts once";
  ASSERT_EQ(woodcock({"fetch", job, "-o", path("image.exr")}).code, 0);
  EXPECT_TRUE(contents(path("image.exr")) == rendered(scene));
  expect_no_leftovers();
}

TEST_P(FailingDisk, F11_ASubmitIsNotAcknowledgedByADatabaseThatCannotKeepIt) {
  start_coordinator(3, 0, {}, failing());
  const std::string kept = submit({kCornell, "--spp", "8", "--resolution", "32x32"});
  break_disk();
  const auto client = woodcock_in_background({"submit", kCornell, "--spp", "4", "--resolution", "32x32"});
  expect_a_reason();
  EXPECT_EQ(client->out(), "") << "it has a job's id although the job is not kept";
  client->signal(SIGKILL);
  client->wait(kPatience);
  std::filesystem::remove(path("disk-fails"));
  restart_coordinator();
  const Ended jobs = woodcock({"jobs", "--json"});
  EXPECT_EQ(jobs.code, 0) << jobs.err;
  EXPECT_THAT(jobs.out, HasSubstr(kept));
  const nlohmann::json list = nlohmann::json::parse(jobs.out).at("jobs");
  EXPECT_EQ(list.size(), 1u) << jobs.out;
}

INSTANTIATE_TEST_SUITE_P(Service, FailingDisk, ::testing::Values("write", "sync"));

}  // namespace
}  // namespace woodcock::testing_service
