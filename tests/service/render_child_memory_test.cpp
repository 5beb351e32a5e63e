// A render child must not grow from task to task: it lives for days.
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <optional>
#include <utility>

#include "tests/support/little_kept_back.h"
#include "tests/support/temporary_folder.h"
#include "worker/frame_task_renderer.h"

namespace woodcock {
namespace {

/// Resident memory of this process, MiB.
double resident_mib() {
  std::ifstream file("/proc/self/statm");
  double total = 0, resident = 0;
  file >> total >> resident;
  return resident * static_cast<double>(::sysconf(_SC_PAGESIZE)) / (1 << 20);
}

TEST(RenderChild, MemoryDoesNotGrowOver200Tasks) {
  const testing::TemporaryFolder folder;
  FrameTaskRenderer renderer;
  RenderCommand command;
  command.scene_path = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/cornell.pbrt";
  command.settings.resolution = {64, 64};
  command.x1 = command.y1 = 32;
  command.sample_end = 1;
  command.threads = 2;
  command.output_path = folder / "tile.exr";
  double early = 0;
  for (int task = 0; task < 200; ++task) {
    command.sample_begin = task, command.sample_end = task + 1;
    renderer.begin();
    const auto tile = renderer.render(command);
    ASSERT_TRUE(tile.has_value());
    ASSERT_EQ(tile->world_reused, task > 0);
    if (task == 40) early = resident_mib();
  }
  EXPECT_LT(resident_mib() - early, 4) << "MiB in 160 tasks";
}

TEST(RenderChild, KeepsTheLastTwoWorlds) {
  const testing::TemporaryFolder folder;
  FrameTaskRenderer renderer;
  const auto reused = [&](const char* scene, int depth) {
    RenderCommand command;
    command.scene_path = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/" + scene;
    command.settings.resolution = {16, 16};
    command.settings.max_depth = depth;
    command.x1 = command.y1 = 8;
    command.sample_end = 1;
    command.output_path = folder / "tile.exr";
    renderer.begin();
    return renderer.render(command)->world_reused;
  };
  EXPECT_FALSE(reused("cornell.pbrt", 1));
  EXPECT_FALSE(reused("sphere.pbrt", 1));
  EXPECT_TRUE(reused("cornell.pbrt", 1));
  EXPECT_FALSE(reused("cornell.pbrt", 2)) << "other settings are another world";
  EXPECT_TRUE(reused("cornell.pbrt", 1));
  EXPECT_FALSE(reused("sphere.pbrt", 1)) << "used least recently";
}

TEST(RenderChild, AnotherSeedNeedsNoOtherWorldAndGivesItsOwnBits) {
  const testing::TemporaryFolder folder;
  const auto tile_of = [&](FrameTaskRenderer& renderer, std::optional<uint64_t> seed, bool& reused) {
    RenderCommand command;
    command.scene_path = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/cornell.pbrt";
    command.settings.resolution = {16, 16};
    command.settings.seed = seed;
    command.x1 = command.y1 = 8;
    command.sample_end = 4;
    command.output_path = folder / "tile.exr";
    renderer.begin();
    const auto tile = renderer.render(command);
    reused = tile->world_reused;
    return std::pair(tile->result_key, tile->digest);
  };
  FrameTaskRenderer kept;
  bool reused = false;
  bool first = true;
  for (const uint64_t seed : {1, 2, 77, 1}) {
    FrameTaskRenderer fresh;
    const auto expected = tile_of(fresh, seed, reused);
    EXPECT_FALSE(reused);
    EXPECT_EQ(tile_of(kept, seed, reused), expected) << seed;
    EXPECT_EQ(reused, !std::exchange(first, false)) << seed;
  }
  // The scene's own seed is none of those that are given.
  FrameTaskRenderer fresh;
  const auto own = tile_of(fresh, std::nullopt, reused);
  EXPECT_EQ(tile_of(kept, std::nullopt, reused), own);
}

}  // namespace
}  // namespace woodcock
