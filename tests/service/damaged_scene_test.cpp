// F28: a scene that is damaged on the coordinator's disk, or in the cache of one worker.
#include <signal.h>

#include "tests/service/farm_faults.h"

namespace woodcock::testing_service {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// Writes over one letter of a word of the scene, in place: the file keeps its size, and its other names.
void damage(const fs::path& file) {
  const std::string text = contents(file);
  const size_t at = text.find("WorldBegin");
  ASSERT_NE(at, std::string::npos) << file;
  std::fstream(file, std::ios::in | std::ios::out | std::ios::binary).seekp(static_cast<std::streamoff>(at)).put('w');
}

class F28 : public FarmFault {
 protected:
  /// The scene file in a folder of blobs.
  fs::path scene_in(const fs::path& blobs) const {
    const std::string text = contents(cornell_);
    for (const auto& entry : fs::recursive_directory_iterator(blobs))
      if (entry.is_regular_file() && contents(entry.path()) == text) return entry.path();
    ADD_FAILURE() << "the scene is not in " << blobs;
    return {};
  }
  fs::path cache() const { return folder_ / "worker0" / "assets" / "blobs"; }
  /// A job that ends and leaves its scene in the worker's cache.
  void fill_cache() { ASSERT_EQ(watch(submit({cornell_, "--spp", "1", "--resolution", "16x16"})), 0); }
};

TEST_F(F28, F28_ASceneDamagedAtTheCoordinatorIsSaidAndHealedByANewSubmit) {
  start_coordinator();
  const std::string job = start_job();
  kill_coordinator();
  damage(scene_in(folder_ / "coordinator" / "blobs"));
  restart_coordinator();
  start_worker();
  std::string reason;
  ASSERT_TRUE(eventually(kPatience, [&] {
    return (reason = show(job)["frames"][0].value("waiting_reason", "")).find("damaged") != std::string::npos;
  })) << reason;
  EXPECT_THAT(reason, HasSubstr("cornell.pbrt"));
  EXPECT_THAT(reason, HasSubstr("submit the scene again"));
  const std::string again = start_job();
  expect_undisturbed(job);
  EXPECT_EQ(watch(again), 0);
}

TEST_F(F28, F28_ASceneDamagedInAWorkersCacheIsFetchedAgain) {
  start_coordinator();
  start_worker();
  fill_cache();
  damage(scene_in(cache()));
  expect_undisturbed(start_job());
  EXPECT_THAT(workers_.front()->err(), HasSubstr("damaged in this worker's cache"));
}

TEST_F(F28, F28_ACacheThatCannotBeReadAfterARestartIsFetchedAgain) {
  start_coordinator();
  start_worker();
  fill_cache();
  workers_.front()->signal(SIGKILL);
  workers_.front()->wait(kPatience);
  make_unreadable(scene_in(cache()), Unreadable::kFolder);
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "worker0" / "assets" / "scenes"))
    if (entry.path().filename() == "cornell.pbrt") make_unreadable(entry.path(), Unreadable::kIoError);
  restart_workers();
  expect_undisturbed(start_job());
  EXPECT_TRUE(workers_.front()->running());
}

TEST_F(F28, F28_ASceneErrorOfAWorkerNamesFilesAsTheUserDoes) {
  start_coordinator();
  start_worker();
  fs::create_directories(folder_ / "scene");
  std::ofstream(path("scene/bad.pbrt")) << "Sampler \"zsobol\" \"integer pixelsamples\" 1\nCamera \"perspective\"\nWorldBegin\n"
                                           "LightSource \"infinite\"\nShape \"plymesh\" \"string filename\" \"bad.ply\"\n";
  std::ofstream(path("scene/bad.ply")) << "nonsense";
  const std::string job = submit({path("scene/bad.pbrt"), "--resolution", "8x8"});
  ASSERT_EQ(watch(job), 1);
  const std::string shown = show(job).dump();
  EXPECT_THAT(shown, HasSubstr("bad.pbrt:5:"));
  EXPECT_THAT(shown, ::testing::Not(HasSubstr((folder_ / "worker0").string())));
}

}  // namespace
}  // namespace woodcock::testing_service
