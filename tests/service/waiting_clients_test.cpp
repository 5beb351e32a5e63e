// F29: clients wait as long as their job lives, and come back by themselves.
#include <signal.h>

#include "tests/service/farm_faults.h"

namespace woodcock::testing_service {
namespace {

using ::testing::HasSubstr;

class F29 : public FarmFault {};

TEST_F(F29, F29_WatchAndSubmitComeBackAfterTheCoordinatorWasAway) {
  start_coordinator();
  std::vector<std::string> words{"submit", "--tile", "16", "-o", path("image.exr")};
  words.insert(words.end(), scene_.begin(), scene_.end());
  const auto waiting = woodcock_in_background(words);
  ASSERT_TRUE(says(*waiting, " is queued")) << waiting->err();
  const std::string text = waiting->err();
  const size_t at = text.find("job j");
  const std::string job = text.substr(at + 4, text.find(' ', at + 4) - at - 4);
  const auto watcher = woodcock_in_background({"watch", job});
  ASSERT_TRUE(says(*watcher, " is queued")) << watcher->err();
  // Killed in the first round, told to end in the second.
  for (const int signal : {SIGKILL, SIGTERM}) {
    coordinator_->signal(signal);
    ASSERT_TRUE(coordinator_->wait(kPatience).has_value());
    for (Program* client : {waiting.get(), watcher.get()}) ASSERT_TRUE(says(*client, "the coordinator does not answer")) << client->err();
    restart_coordinator();
    for (Program* client : {waiting.get(), watcher.get()}) ASSERT_TRUE(says(*client, "the coordinator answers again")) << client->err();
  }
  start_worker();
  EXPECT_EQ(watcher->wait(kPatience), 0) << watcher->err();
  EXPECT_EQ(waiting->wait(kPatience), 0) << waiting->err();
  EXPECT_TRUE(contents(path("image.exr")) == rendered(scene_));
}

}  // namespace
}  // namespace woodcock::testing_service
