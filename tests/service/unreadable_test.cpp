// F26: what cannot be read is damaged. It is rendered, merged or fetched again; no program ends because of it.
#include <signal.h>

#include "tests/service/farm_faults.h"

namespace woodcock::testing_service {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class F26 : public FarmFault {
 protected:
  int results_in_spool() const {
    int count = 0;
    for (const auto& entry : fs::directory_iterator(folder_ / "worker0" / "spool")) count += entry.path().extension() == ".offer";
    return count;
  }
  /// All at once: to remove a folder file by file would meet what its program removes at the same time.
  void take_away(const fs::path& folder) {
    if (fs::exists(folder)) fs::rename(folder, folder_ / ("gone" + std::to_string(gone_++)));
  }

 private:
  int gone_ = 0;
};

TEST_F(F26, F26_TilesThatCannotBeReadAreRenderedAgain) {
  start_coordinator();
  start_worker();
  const std::string job = start_job();
  std::vector<fs::path> tiles;
  ASSERT_TRUE(eventually(kPatience, [&] { return (tiles = exr_blobs()).size() >= kAllUnreadable.size(); }));
  ASSERT_EQ(woodcock({"pause", job}).code, 0);
  ASSERT_EQ(show(job)["state"], "paused") << "the job was too short for the fault";
  for (size_t i = 0; i < kAllUnreadable.size(); ++i) make_unreadable(tiles[i], kAllUnreadable[i]);
  ASSERT_EQ(woodcock({"resume", job}).code, 0);
  expect_undisturbed(job);
  EXPECT_THAT(coordinator_->err(), HasSubstr("damaged at rest"));
  EXPECT_TRUE(coordinator_->running());
}

TEST_F(F26, F26_AnImageThatCannotBeReadIsMergedAgain) {
  start_coordinator();
  start_worker();
  const std::string job = start_job();
  ASSERT_EQ(watch(job), 0);
  const std::string digest = show(job)["frames"][0]["image_digest"];
  const fs::path image = folder_ / "coordinator" / "blobs" / digest.substr(0, 2) / digest;
  make_unreadable(image, Unreadable::kFolder);
  ASSERT_EQ(woodcock({"fetch", job, "-o", path("first.exr")}).code, 0);
  EXPECT_THAT(coordinator_->err(), HasSubstr("merged again"));
  make_unreadable(image, Unreadable::kIoError);
  expect_undisturbed(job);
  EXPECT_TRUE(coordinator_->running());
}

TEST_F(F26, F26_CleanUpPassesWhatItCannotRead) {
  // The first clean-up comes when the first pins have ended.
  start_coordinator(3, 0, {"--pin", "3"});
  const fs::path dir = folder_ / "coordinator";
  const std::string digest(64, 'a');
  fs::create_directories(dir / "blobs" / "aa");
  std::ofstream(dir / "blobs" / "aa" / digest) << "nobody refers to this";
  make_unreadable(dir / "blobs" / "loop", Unreadable::kLinkLoop);
  make_unreadable(dir / "blobs" / "ab", Unreadable::kLinkLoop);
  make_unreadable(dir / "blobs" / "aa" / "loop", Unreadable::kLinkLoop);
  fs::create_directories(dir / "blobs" / "lost+found");
  const std::string found_again = dir / "blobs" / "lost+found" / std::string(64, 'b');
  std::ofstream(found_again) << "not the store's";
  take_away(dir / "uploads");
  EXPECT_TRUE(eventually(kPatience, [&] { return !fs::exists(dir / "blobs" / "aa" / digest) || !coordinator_->running(); }));
  ASSERT_TRUE(coordinator_->running()) << coordinator_->err();
  EXPECT_TRUE(fs::exists(found_again));
  start_worker();
  expect_undisturbed(start_job());
  EXPECT_TRUE(coordinator_->running());
}

TEST_F(F26, F26_FoldersThatGoAreMadeAgain) {
  start_coordinator();
  const fs::path dir = folder_ / "coordinator";
  for (const char* name : {"uploads", "temporary"}) take_away(dir / name);
  start_worker();
  const std::string job = start_job();
  wait_until_mid_job(job);
  for (const char* name : {"uploads", "temporary"}) take_away(dir / name);
  for (const char* name : {"logs", "spool"}) take_away(folder_ / "worker0" / name);
  expect_undisturbed(job);
  EXPECT_TRUE(coordinator_->running());
  EXPECT_TRUE(workers_.front()->running());
}

TEST_F(F26, F26_ResultsThatTheWorkerCannotReadAreRenderedAgain) {
  start_coordinator();
  start_worker();
  bool fired = false;
  // A result that was committed just before the coordinator went is not asked for again: then once more.
  for (int seed = 0; !fired && seed < 6; ++seed) {
    const std::string job = start_job({"--tile", "16", "--seed", std::to_string(seed)});
    wait_until_mid_job(job);
    kill_coordinator();
    // The worker finishes what it has leased; one of these may have been committed.
    eventually(std::chrono::seconds(5), [&] { return results_in_spool() >= 2; });
    size_t next = 0;
    for (const auto& entry : fs::directory_iterator(folder_ / "worker0" / "spool"))
      if (entry.path().extension() == ".exr") make_unreadable(entry.path(), kAllUnreadable[next++ % kAllUnreadable.size()]);
    restart_coordinator();
    ASSERT_EQ(watch(job), 0) << show(job).dump(2);
    const std::string image = "image" + std::to_string(seed) + ".exr";
    ASSERT_EQ(woodcock({"fetch", job, "-o", path(image)}).code, 0);
    std::vector<std::string> alone = scene_;
    alone.insert(alone.end(), {"--seed", std::to_string(seed)});
    EXPECT_TRUE(contents(path(image)) == rendered(alone)) << seed;
    fired = workers_.front()->err().find("is damaged on this disk") != std::string::npos;
  }
  EXPECT_TRUE(fired) << "the fault did not fire";
  EXPECT_TRUE(workers_.front()->running());
}

TEST_F(F26, F26_WorkerStartsWithASpoolItCannotRead) {
  start_coordinator();
  const fs::path spool = folder_ / "worker0" / "spool";
  fs::create_directories(spool);
  size_t next = 0;
  for (const Unreadable how : kAllUnreadable) {
    const std::string key(64, static_cast<char>('a' + next++));
    make_unreadable(spool / (key + ".exr"), how);
    make_unreadable(spool / (key + ".offer"), how);
  }
  start_worker();
  expect_undisturbed(start_job());
  EXPECT_TRUE(workers_.front()->running());
}

}  // namespace
}  // namespace woodcock::testing_service
