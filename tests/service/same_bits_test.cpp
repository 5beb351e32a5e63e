// The same bits for the two scenes that between them use everything, from `render` and from the service: with 1, 2 and
// 5 workers, with a worker killed in the middle, and with the coordinator killed in the middle and started again.
// (Tiles, threads and sample splits of `render` itself are in tests/client.)
#include <signal.h>

#include "tests/service/service_fixture.h"

namespace woodcock::testing_service {
namespace {

class SameBits : public ServiceTest, public ::testing::WithParamInterface<std::string> {
 protected:
  std::vector<std::string> scene(const std::string& samples) const {
    return {
        std::string(WOODCOCK_SOURCE_DIR) + "/scenes/" + GetParam() + ".pbrt", "--spp", samples, "--resolution", "64x36", "--seed", "11"};
  }
  /// A job of some seconds in many small tasks.
  std::string start_long_job() {
    std::vector<std::string> arguments = scene("128");
    arguments.insert(arguments.end(), {"--tile", "16"});
    return submit(arguments);
  }
  void expect_undisturbed(const std::string& job) {
    ASSERT_EQ(watch(job), 0) << show(job).dump(2);
    ASSERT_EQ(woodcock({"fetch", job, "-o", path("image.exr")}).code, 0);
    EXPECT_TRUE(contents(path("image.exr")) == rendered(scene("128")));
  }
};

TEST_P(SameBits, WithOneTwoAndFiveWorkers) {
  start_coordinator();
  const std::string expected = rendered(scene("16"));
  size_t round = 0;
  for (const size_t count : {1, 2, 5}) {
    while (workers_.size() < count) start_worker();
    // A finished task is never rendered again, so each round asks for tiles of another size.
    std::vector<std::string> arguments = scene("16");
    const std::string out = path("image" + std::to_string(round) + ".exr");
    const char* tiles[] = {"8", "16", "32"};
    arguments.insert(arguments.begin(), {"submit", "-o", out, "--tile", tiles[round++]});
    const Ended run = woodcock(arguments);
    ASSERT_EQ(run.code, 0) << run.err;
    EXPECT_TRUE(contents(out) == expected) << count << " workers";
  }
}

TEST_P(SameBits, WithAWorkerKilledInTheMiddle) {
  start_coordinator();
  start_worker();
  start_worker();
  const std::string job = start_long_job();
  wait_until_mid_job(job);
  workers_.front()->signal(SIGKILL);
  EXPECT_EQ(workers_.front()->wait(kPatience), 128 + SIGKILL);
  expect_undisturbed(job);
}

TEST_P(SameBits, WithTheCoordinatorKilledInTheMiddle) {
  start_coordinator();
  start_worker();
  start_worker();
  const std::string job = start_long_job();
  wait_until_mid_job(job);
  kill_coordinator();
  wait_until_workers_miss_the_coordinator();
  restart_coordinator();
  expect_undisturbed(job);
}

// What estimators are set by reaches the render child: otherwise the bits, or the header, would be others.
TEST_F(ServiceTest, EstimatorSettingsReachTheWorkers) {
  start_coordinator();
  start_worker();
  const std::string cloud = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/cloud.pbrt";
  const std::vector<std::vector<std::string>> settings{
      {"--estimator", "march", "--step", "0.37", "--directions", "2", "--only", "absorption,out-scattering,in-scattering"},
      {"--estimator", "line", "--step", "0.5", "--directions", "3"},
      {"--estimator", "uniform-path", "--branching", "2", "--only", "out-scattering"},
      {"--estimator", "woodcock-phase", "--max-depth", "4"},
      {"--without", "roulette,mis", "--plan", "off", "--kernel", "full"},
      {"--set", "camera.fov=33", "--set", "integrator.maxdepth=3"}};
  for (size_t i = 0; i < settings.size(); ++i) {
    std::vector<std::string> arguments{cloud, "--spp", "2", "--resolution", "16x9"};
    arguments.insert(arguments.end(), settings[i].begin(), settings[i].end());
    const std::string expected = rendered(arguments), out = path("settings" + std::to_string(i) + ".exr");
    arguments.insert(arguments.begin(), {"submit", "-o", out});
    const Ended run = woodcock(arguments);
    ASSERT_EQ(run.code, 0) << run.err;
    EXPECT_TRUE(contents(out) == expected) << settings[i][1];
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, SameBits, ::testing::Values("cloud", "effects"), [](const auto& scene) { return scene.param; });

}  // namespace
}  // namespace woodcock::testing_service
