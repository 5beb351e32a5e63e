// F21 and F33: merges in processes of their own, several at once.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <fstream>
#include <iterator>
#include <thread>

#include "coordinator/merge_pool.h"
#include "renderer/film/picture_file.h"
#include "tests/service/coordinator_world.h"
#include "tests/support/processes.h"

namespace woodcock::coordinator {
namespace {

using ::testing::HasSubstr;
constexpr const char* kProgram = WOODCOCK_BIN_DIR "/woodcock-coordinator";

std::string bytes_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// A frame of one tile with so many samples, whose tile lies in `folder`.
AssembleRequest frame_of(const TemporaryFolder& folder, int64_t samples) {
  AssembleRequest request;
  request.header.scene_digest = std::string(64, 'a');
  request.header.settings_digest = std::string(64, 'b');
  request.header.build = "build";
  request.header.arithmetic_class = "class";
  request.header.width = request.header.height = 32;
  request.header.bounds = {0, 0, 32, 32};
  request.header.settings = {{"estimator", "auto"}};
  request.map = {request.header.bounds, {samples}};
  request.prefixes = true;
  v1::TaskSpec task;
  *task.mutable_header() = rpc::to_wire(request.header);
  *task.mutable_rect() = rpc::to_wire(request.header.bounds);
  *task.mutable_range() = rpc::to_wire(SampleRange{0, samples});
  request.tile_paths = {(folder / "tile-").string() + std::to_string(samples) + ".exr"};
  std::ofstream(request.tile_paths[0], std::ios::binary) << CoordinatorWorld::tile_bytes(task);
  request.output_path = (folder / "frame-").string() + std::to_string(samples) + ".exr";
  return request;
}

/// What this process makes of it.
std::string merged_here(AssembleRequest request) {
  request.output_path += ".here.exr";
  EXPECT_TRUE(assemble(request).ok);
  return bytes_of(request.output_path);
}

TEST(MergePool, F33_MergesAtOnceGiveTheBitsOfOneAfterTheOther) {
  const TemporaryFolder folder;
  std::atomic<int> begun{0};
  MergePool pool(kProgram, 2, [&begun] { ++begun; });
  std::vector<std::thread> threads;
  for (const int64_t samples : {1, 2, 4, 8, 16, 32})
    threads.emplace_back([&, samples] {
      const AssembleRequest request = frame_of(folder, samples);
      const AssembleResult result = pool.merge(request);
      EXPECT_TRUE(result.ok) << result.error;
      EXPECT_TRUE(bytes_of(request.output_path) == merged_here(request)) << samples;
      EXPECT_EQ(text_of(result), text_of(assemble(request)));
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(begun, 6);
  EXPECT_EQ(testing::children_of(::getpid()).size(), 2u) << "merges beyond the limit wait for those before them";
}

TEST(MergePool, StopsAMergeThatRunsAndBeginsNoOther) {
  const TemporaryFolder folder;
  const AssembleRequest request = frame_of(folder, 4);
  MergePool* stopped = nullptr;
  MergePool pool(kProgram, 1, [&stopped] { stopped->stop(); });
  stopped = &pool;
  EXPECT_THAT(pool.merge(request).error, HasSubstr("has ended"));
  EXPECT_THAT(pool.merge(request).error, HasSubstr("the coordinator is stopping"));
}

TEST(MergePool, F33_AServerThatIsKilledIsAnErrorOfOneMergeAndIsReplaced) {
  const TemporaryFolder folder;
  const AssembleRequest request = frame_of(folder, 4);
  bool kill = false;
  MergePool pool(kProgram, 1, [&kill] {
    if (std::exchange(kill, false))
      for (const pid_t server : testing::children_of(::getpid())) ::kill(server, SIGKILL);
  });
  ASSERT_TRUE(pool.merge(request).ok);
  kill = true;
  const AssembleResult lost = pool.merge(request);
  // It may have replied before.
  if (!lost.ok) {
    EXPECT_THAT(lost.error, HasSubstr("has ended"));
  }
  const AssembleResult result = pool.merge(request);
  EXPECT_TRUE(result.ok || pool.merge(request).ok) << result.error;
  EXPECT_TRUE(bytes_of(request.output_path) == merged_here(request));
}

TEST(MergePool, F21_AMergeThatCrashesEndsItselfOnly) {
  const TemporaryFolder folder;
  const AssembleRequest request = frame_of(folder, 4);
  MergePool pool(kProgram, 1);
  ASSERT_TRUE(pool.merge(request).ok);
  const std::vector<pid_t> servers = testing::children_of(::getpid());
  ASSERT_EQ(servers.size(), 1u);
  // As by a crafted file: whatever merges is killed, until one was met.
  std::atomic<bool> met{false};
  std::thread killer([&] {
    while (!met)
      for (const pid_t merge : testing::children_of(servers[0])) ::kill(merge, SIGKILL);
  });
  std::string error;
  for (int i = 0; i < 1000 && error.empty(); ++i) error = pool.merge(request).error;
  met = true;
  killer.join();
  EXPECT_THAT(error, HasSubstr("ended by signal Killed"));
  EXPECT_TRUE(pool.merge(request).ok);
  EXPECT_EQ(testing::children_of(::getpid()), servers) << "the server stays";
  EXPECT_TRUE(bytes_of(request.output_path) == merged_here(request));
}

TEST(MergePool, F33_AProgramThatCannotBeStartedIsSaid) {
  const TemporaryFolder folder;
  MergePool pool((folder / "nothing").string(), 1);
  for (int i = 0; i < 2; ++i) EXPECT_THAT(pool.merge(frame_of(folder, 1)).error, HasSubstr("cannot start"));
}

TEST(MergePool, F35_APictureIsMadeOfNodesAsTheClientMakesIt) {
  const TemporaryFolder folder;
  const AssembleRequest frame = frame_of(folder, 8);
  ASSERT_TRUE(assemble(frame).ok);
  AssembleRequest request;
  request.picture_of = frame.output_path;
  request.output_path = (folder / "picture.exr").string();
  MergePool pool(kProgram, 1);
  const AssembleResult result = pool.merge(request);
  ASSERT_TRUE(result.ok) << result.error;
  make_picture(frame.output_path, (folder / "here.exr").string())->commit();
  EXPECT_TRUE(bytes_of(request.output_path) == bytes_of((folder / "here.exr").string()));
}

}  // namespace
}  // namespace woodcock::coordinator
