// F27: more connections than the coordinator has descriptors for.
#include <arpa/inet.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/service/farm_faults.h"

namespace woodcock::testing_service {
namespace {

using ::testing::HasSubstr;

class F27 : public FarmFault {
 protected:
  ~F27() override { hang_up(); }
  /// Connects without a word, as often as asked. Those that the kernel keeps waiting count.
  void connect(int times) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to.sin_port = htons(static_cast<uint16_t>(std::stoi(address_.substr(address_.rfind(':') + 1))));
    for (int i = 0; i < times; ++i) {
      lines_.push_back(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
      ::connect(lines_.back(), reinterpret_cast<const sockaddr*>(&to), sizeof to);
    }
  }
  void hang_up() {
    for (const int line : lines_) ::close(line);
    lines_.clear();
  }
  std::vector<int> lines_;
};

TEST_F(F27, F27_TheLimitOfOpenFilesIsRaisedAtTheStart) {
  start_coordinator();
  rlimit limit{};
  ASSERT_EQ(::prlimit(coordinator_->pid(), RLIMIT_NOFILE, nullptr, &limit), 0);
  EXPECT_EQ(limit.rlim_cur, limit.rlim_max);
}

TEST_F(F27, F27_ConnectionsBeyondTheLimitWaitAndHarmNobody) {
  start_coordinator();
  const rlimit few{128, 128};
  ASSERT_EQ(::prlimit(coordinator_->pid(), RLIMIT_NOFILE, &few, nullptr), 0);
  start_worker();
  const std::string job = start_job();
  const auto watcher = woodcock_in_background({"watch", job});
  wait_until_mid_job(job);
  connect(200);
  ASSERT_TRUE(says(*coordinator_, "as many connections as the limit of 128 open files allows"));
  EXPECT_EQ(watcher->wait(kPatience), 0) << "the job ends meanwhile: files and children have their reserve\n" << watcher->err();
  hang_up();
  ASSERT_TRUE(says(*coordinator_, "there is room for connections again"));
  expect_undisturbed(job);
}

}  // namespace
}  // namespace woodcock::testing_service
