// F25: workers that stay up meet a coordinator with another folder, or with an older copy of its own.
#include <signal.h>

#include "tests/service/farm_faults.h"

namespace woodcock::testing_service {
namespace {

namespace fs = std::filesystem;

class F25 : public FarmFault {
 protected:
  fs::path dir() const { return folder_ / "coordinator"; }
  bool worker_renders() {
    return eventually(kPatience, [&] { return workers_.front()->err().find("connected to") != std::string::npos; });
  }
};

TEST_F(F25, F25_WorkersJoinACoordinatorWithANewFolderAnew) {
  start_coordinator();
  kill_coordinator();
  restart_coordinator();  // of a later term than the new folder's
  start_worker();
  const std::string lost = start_job();
  wait_until_mid_job(lost);
  kill_coordinator();
  fs::rename(dir(), folder_ / "moved");
  restart_coordinator();
  const std::string job = start_job();
  expect_undisturbed(job);
  EXPECT_TRUE(says(*workers_.front(), "is of another cluster"));
  EXPECT_TRUE(says(*coordinator_, "comes from another cluster"));
  EXPECT_TRUE(workers_.front()->running());
  EXPECT_EQ(woodcock({"show", lost}).code, 1) << "the new folder does not know it";
}

TEST_F(F25, F25_WorkersFollowACoordinatorOnAnOlderBackUp) {
  start_coordinator();
  coordinator_->signal(SIGTERM);
  ASSERT_EQ(coordinator_->wait(kPatience), 0);
  fs::copy(dir(), folder_ / "backup", fs::copy_options::recursive);
  restart_coordinator();
  kill_coordinator();
  restart_coordinator();
  start_worker();
  ASSERT_TRUE(worker_renders());
  const std::string lost = start_job();
  wait_until_mid_job(lost);
  kill_coordinator();
  fs::remove_all(dir());
  fs::rename(folder_ / "backup", dir());
  restart_coordinator();
  const std::string job = start_job();
  expect_undisturbed(job);
  EXPECT_TRUE(says(*coordinator_, "its folder is an older back-up"));
  EXPECT_TRUE(says(*workers_.front(), "its folder is an older back-up"));
  EXPECT_TRUE(workers_.front()->running());
  // The higher term is durable.
  kill_coordinator();
  restart_coordinator();
  EXPECT_TRUE(says(*coordinator_, "leader term 5"));
}

}  // namespace
}  // namespace woodcock::testing_service
