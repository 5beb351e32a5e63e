// F29, F30 and F34 on a coordinator in this process: many watchers, previews, frames of a build that is gone.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <thread>
#include <vector>

#include "coordinator/server.h"
#include "rpc/channel.h"
#include "tests/service/coordinator_world.h"

namespace woodcock::coordinator {
namespace {

TEST(Coordinator, F30APreviewShowsTheFirstSamplesThatThereAre) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  struct Stage {
    int tasks;
    int64_t samples, missing;
  };
  // A block of a map in four tiles, and in one; of each tile 16, 16, 32 and then 64 samples a task.
  const std::map<uint32_t, std::vector<Stage>> stages{{16, {{1, 16, 768}, {4, 16, 0}, {6, 16, 0}, {8, 32, 0}}},
                                                      {32, {{1, 16, 0}, {2, 32, 0}, {3, 64, 0}, {6, 256, 0}, {8, 384, 0}}}};
  for (const auto& [tile, all] : stages) {
    v1::SubmitJobRequest request = world.request("r" + std::to_string(tile), 512);
    request.mutable_settings()->set_tile_size(tile);
    const std::string id = world.coordinator->submit(request).job_id();
    int committed = 0;
    const auto expect = [&](const Stage& stage) {
      const v1::GetFrameResponse preview = world.coordinator->frame(id, 0, true);
      EXPECT_TRUE(preview.partial());
      EXPECT_EQ(preview.statistics().missing_pixels(), stage.missing) << stage.tasks << " tasks of tile " << tile;
      EXPECT_EQ(preview.statistics().samples(), stage.samples) << stage.tasks << " tasks of tile " << tile;
      // Sample i of every pixel is i + 1.
      EXPECT_FLOAT_EQ(static_cast<float>(preview.statistics().image_mean()), 0.5f * static_cast<float>(stage.samples + 1));
    };
    for (const Stage& stage : all) {
      committed += world.work("w1", stage.tasks - committed);
      ASSERT_EQ(committed, stage.tasks);
      expect(stage);
    }
    world.coordinator->cancel(id);
    expect(all.back());
  }
}

/// A job that clients can watch by gRPC.
struct WatchedJob {
  const TemporaryFolder folder;
  CoordinatorWorld world{folder.path()};
  const std::string id = world.coordinator->submit(world.request("r1", 8)).job_id();
  CoordinatorServer server{*world.coordinator, "127.0.0.1:0"};
  const std::unique_ptr<v1::JobsService::Stub> stub = v1::JobsService::NewStub(rpc::make_channel(server.address()));

  std::unique_ptr<grpc::ClientReader<v1::WatchJobResponse>> watch(grpc::ClientContext& context, std::chrono::seconds deadline) const {
    rpc::set_deadline(context, deadline);
    v1::WatchJobRequest request;
    request.set_job_id(id);
    return stub->WatchJob(&context, request);
  }
};

TEST(Coordinator, F29AnyNumberOfWatchersIsServedAndEachHearsTheEnd) {
  WatchedJob job;
  constexpr int kWatchers = 150;
  std::atomic<int> begun{0}, heard{0};
  std::vector<std::thread> watchers;
  for (int i = 0; i < kWatchers; ++i)
    watchers.emplace_back([&] {
      grpc::ClientContext context;
      const auto reader = job.watch(context, std::chrono::seconds(100));
      v1::WatchJobResponse response;
      if (!reader->Read(&response)) return;
      ++begun;
      while (reader->Read(&response)) {
      }
      heard += reader->Finish().ok() && response.job().state() == v1::JOB_STATE_DONE;
    });
  for (int i = 0; i < 3000 && begun < kWatchers; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_EQ(begun, kWatchers);
  job.world.work("w1");
  job.world.wait_until_ended(job.id);
  for (std::thread& watcher : watchers) watcher.join();
  EXPECT_EQ(heard, kWatchers);
}

TEST(Coordinator, AWatcherIsToldWhenTheCoordinatorStops) {
  WatchedJob job;
  grpc::ClientContext context;
  const auto reader = job.watch(context, std::chrono::seconds(60));
  v1::WatchJobResponse response;
  ASSERT_TRUE(reader->Read(&response));
  job.server.stop();
  EXPECT_FALSE(reader->Read(&response));
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST(Coordinator, F03TheExtensionOfARunningJobSurvivesARestart) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = world.coordinator->submit(world.request("r1", 8)).job_id();
  EXPECT_EQ(world.work("w1", 1), 1);
  EXPECT_EQ(world.coordinator->extend(id, 12, {}).settings().samples(), 12);
  world.stop();
  world.start();
  EXPECT_EQ(world.coordinator->job(id).settings().samples(), 12);
  EXPECT_EQ(world.work("w1"), 7);
  EXPECT_EQ(world.wait_until_ended(id).state(), v1::JOB_STATE_DONE);
  EXPECT_TRUE(image_of(world, id) == whole_frame(world, 12));
}

TEST(Coordinator, F24AnAlarmBesideAnExtensionIsAnEventOfItsOwn) {
  const TemporaryFolder folder;
  bool threads = true;
  CoordinatorWorld world(folder.path(), [&threads](CoordinatorOptions& options) { options.own_threads = threads; });
  const std::string id = world.coordinator->submit(world.request("r1", 8)).job_id();
  EXPECT_EQ(world.work("w1"), 4);
  EXPECT_EQ(world.wait_until_ended(id).state(), v1::JOB_STATE_DONE);
  const FrameHeader pinned = rpc::from_wire(world.coordinator->frame(id, 0, false).frame().header());
  world.stop();
  threads = false;
  world.start();
  // Another result of a task that is settled: the alarm comes when the database is asked, which the extension does as well.
  v1::SyncRequest request = world.sync_request("w2");
  v1::ResultOffer* offer = request.add_offers();
  offer->set_lease_id("L1-1");
  offer->set_task_id(id + ".0.0");
  offer->set_result_key(result_key(pinned, {0, 0, 16, 16}, {0, 8}));
  offer->set_result_digest(std::string(64, 'e'));
  offer->set_bytes(1);
  std::optional<v1::SyncResponse> answer;
  world.coordinator->sync(request, [&](const rpc::Outcome&, const v1::SyncResponse& response) { answer = response; });
  EXPECT_EQ(world.coordinator->extend(id, 12, {}).settings().samples(), 12);
  bool finished = false;
  const v1::WatchJobResponse seen = world.coordinator->watch(id, 0, finished);
  int alarms = 0, extensions = 0, number = 0;
  for (const v1::JobEvent& event : seen.events()) {
    EXPECT_EQ(event.number(), ++number);
    alarms += event.kind() == v1::JOB_EVENT_KIND_DETERMINISM_ALARM;
    extensions += event.kind() == v1::JOB_EVENT_KIND_EXTENDED;
  }
  EXPECT_EQ(alarms, 1);
  EXPECT_EQ(extensions, 1);
  world.coordinator->answer_overdue();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->verdicts(0).verdict(), v1::VERDICT_REFUSED);
}

TEST(Coordinator, F34AFrameOfABuildThatIsGoneStartsAgainWhenAsked) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = world.coordinator->submit(world.request("r1", 12)).job_id();
  EXPECT_EQ(world.work("old", 3), 3);
  EXPECT_THROW(world.coordinator->repin(id), rpc::RpcError) << "its worker is there";
  world.now += 120 * kSecond;
  world.build = "new build";
  EXPECT_EQ(world.work("new"), 0);
  EXPECT_THAT(world.coordinator->job(id).state_reason(), ::testing::HasSubstr("no connected worker has build build"));
  EXPECT_EQ(world.coordinator->repin(id).frames(), 1);
  EXPECT_EQ(world.coordinator->job(id).progress().tasks_done(), 0);
  EXPECT_EQ(world.work("new", 2), 2);
  // What is settled is that of the new build, also after a restart.
  world.stop();
  world.start();
  EXPECT_EQ(world.coordinator->job(id).progress().tasks_done(), 2);
  EXPECT_EQ(world.work("new"), 6);
  EXPECT_EQ(world.wait_until_ended(id).state(), v1::JOB_STATE_DONE);
  EXPECT_TRUE(image_of(world, id) == whole_frame(world, 12));
}

TEST(Coordinator, F34AFrameOfABuildThatIsGoneStartsAgainByItselfWhereThatIsAllowed) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path(), [](CoordinatorOptions& options) { options.scheduler.repin_after = 200 * kSecond; });
  const std::string id = world.coordinator->submit(world.request("r1", 8)).job_id();
  EXPECT_EQ(world.work("old", 3), 3);
  world.now += 120 * kSecond;
  world.build = "new build";
  for (int i = 0; i < 300 && world.coordinator->job(id).state() < v1::JOB_STATE_DONE; ++i) world.work("new");
  EXPECT_EQ(world.wait_until_ended(id).state(), v1::JOB_STATE_DONE);
  EXPECT_TRUE(image_of(world, id) == whole_frame(world, 8));
}

}  // namespace
}  // namespace woodcock::coordinator
