// Jobs with a target: the bytes of `render` with the same target, with 1, 2 and 5 workers, after a kill of a worker and of the
// coordinator, and after an extension; and those of its sample map after a limit of time.
#include <signal.h>

#include <algorithm>
#include <thread>

#include "tests/service/service_fixture.h"

namespace woodcock::testing_service {
namespace {

class AdaptiveJobs : public ServiceTest {
 protected:
  static std::vector<std::string> scene(const std::string& error) {
    return {std::string(WOODCOCK_SOURCE_DIR) + "/scenes/cornell.pbrt",
            "--target-error",
            error,
            "--resolution",
            "100x75",
            "--crop",
            "3,90,0,75",
            "--seed",
            "11"};
  }
  std::string fetched(const std::string& job) {
    const Ended run = woodcock({"fetch", job, "-o", path("image.exr")});
    EXPECT_EQ(run.code, 0) << run.err;
    return contents(path("image.exr"));
  }
};

TEST_F(AdaptiveJobs, MakeTheBytesOfARenderWithOneTwoAndFiveWorkersAndRenderNothingTwice) {
  start_coordinator();
  const std::string expected = rendered(scene("11%"));
  const char* tiles[] = {"8", "16", "32"};
  size_t round = 0;
  for (const size_t count : {1, 2, 5}) {
    while (workers_.size() < count) start_worker();
    std::vector<std::string> arguments = scene("11%");
    const std::string out = path("image" + std::to_string(round) + ".exr");
    arguments.insert(arguments.begin(), {"submit", "-o", out, "--tile", tiles[round++]});
    const Ended run = woodcock(arguments);
    ASSERT_EQ(run.code, 0) << run.err;
    EXPECT_THAT(run.out, ::testing::HasSubstr("target reached"));
    EXPECT_TRUE(contents(out) == expected) << count << " workers";
  }
  const std::string again = submit(scene("11%"));
  ASSERT_EQ(watch(again), 0);
  EXPECT_EQ(show(again)["progress"]["worker_seconds"], 0);
  EXPECT_GT(show(again)["frames"][0]["adaptive"]["pass"], 2);
  EXPECT_TRUE(fetched(again) == expected);
}

TEST_F(AdaptiveJobs, SurviveAKilledWorkerAndAKilledCoordinator) {
  start_coordinator();
  start_worker();
  start_worker();
  const std::string job = submit(scene("9%"));
  const auto in_pass = [&](int pass) {
    return eventually(kPatience, [&] {
      const nlohmann::json frame = show(job)["frames"][0];
      return frame["state"] == "done" || frame["adaptive"]["pass"] >= pass;
    });
  };
  ASSERT_TRUE(in_pass(2));
  workers_.front()->signal(SIGKILL);
  ASSERT_TRUE(in_pass(3));
  kill_coordinator();
  restart_coordinator();
  ASSERT_EQ(watch(job), 0) << show(job).dump(2);
  EXPECT_LE(show(job)["frames"][0]["statistics"]["relative_error"], 0.0901);
  EXPECT_TRUE(fetched(job) == rendered(scene("9%")));
}

TEST_F(AdaptiveJobs, AnExtensionRendersOnlyTheDifference) {
  start_coordinator();
  start_worker();
  const std::string job = submit(scene("25%"));
  ASSERT_EQ(watch(job), 0);
  const int64_t before = show(job)["progress"]["samples_done"];
  EXPECT_EQ(woodcock({"extend", job, "--target-error", "50%"}).code, 1);
  ASSERT_EQ(woodcock({"extend", job, "--target-error", "16%"}).code, 0);
  ASSERT_EQ(watch(job), 0);
  // The same in this process.
  std::vector<std::string> first = scene("25%"), then = scene("16%");
  first.insert(first.begin(), {"render", "-o", path("local.exr")});
  then.insert(then.begin(), {"render", "-o", path("local.exr"), "--resume", "--json"});
  ASSERT_EQ(woodcock(first).code, 0);
  const Ended run = woodcock(then);
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_TRUE(fetched(job) == contents(path("local.exr")));
  EXPECT_EQ(show(job)["progress"]["samples_done"].get<int64_t>() - before, nlohmann::json::parse(run.out)["new_samples"]);

  // A plain job becomes one with a target, and ends at a limit.
  std::vector<std::string> plain = scene("1%");
  plain[1] = "--spp";
  plain[2] = "24";
  const std::string other = submit(plain);
  ASSERT_EQ(watch(other), 0);
  ASSERT_EQ(woodcock({"extend", other, "--target-error", "1%", "--max-spp", "30"}).code, 0);
  ASSERT_EQ(watch(other), 0);
  plain[2] = "30";
  EXPECT_TRUE(fetched(other) == rendered(plain));
}

TEST_F(AdaptiveJobs, ALimitOfTimeLeavesAFrameWhoseMapIsReplayed) {
  start_coordinator();
  start_worker();
  // A busy machine may not reach the first samples of every block in two seconds; then the frame is partial or has nothing at all, and
  // twice the time is given.
  Ended run;
  bool too_short = true;
  for (int seconds = 2; too_short && seconds <= 64; seconds *= 2) {
    std::vector<std::string> limited = scene("0.01%");
    limited.insert(limited.begin(), {"submit", "--max-time", std::to_string(seconds) + "s", "-o", path("image.exr")});
    std::filesystem::remove(path("image.exr"));
    run = woodcock(limited);
    too_short = run.code == 3 || run.err.find("before anything was rendered") != std::string::npos;
    if (!too_short) {
      EXPECT_THAT(run.out, ::testing::HasSubstr("ended by its limit of " + std::to_string(seconds) + " s"));
    }
  }
  ASSERT_EQ(run.code, 0) << run.err;
  std::vector<std::string> replay = scene("");
  replay[1] = "--sample-map";
  replay[2] = path("image.exr");
  EXPECT_TRUE(contents(path("image.exr")) == rendered(replay));
}

}  // namespace
}  // namespace woodcock::testing_service
