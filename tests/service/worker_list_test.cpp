// The list of workers: who is on it, how it is told, what a hostile worker can put there.
#include <gtest/gtest.h>

#include "rpc/limits.h"
#include "tests/service/coordinator_world.h"
#include "tests/service/scheduler_fixture.h"

namespace woodcock::coordinator {
namespace {

/// Those that the scheduler lists, by id.
std::map<std::string, WorkerView> listed(const SchedulerWorld& world) {
  std::map<std::string, WorkerView> views;
  for (const WorkerView& view : world.scheduler.list_workers("", 1000, world.now)) views[view.last->worker_id] = view;
  return views;
}

TEST(WorkerList, SaysWhatEachWorkerIsAndDoes) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  WorkerReport big = world.report("big");
  big.slots = 2;
  big.threads = 8;
  world.sync("big", big);
  WorkerReport leaving = world.report("leaving");
  leaving.draining = true;
  world.sync("leaving", leaving);
  world.now += 7 * kSecond;
  world.sync("small");
  const std::map<std::string, WorkerView> views = listed(world);
  ASSERT_EQ(views.size(), 3u);
  EXPECT_EQ(views.at("big").last->slots, 2);
  EXPECT_EQ(views.at("big").last->threads, 8);
  EXPECT_EQ(views.at("big").condition, WorkerCondition::Ready);
  EXPECT_EQ(views.at("big").leases, 3u) << "two slots, and one task fetched ahead";
  EXPECT_EQ(views.at("big").silent, 7 * kSecond);
  EXPECT_EQ(views.at("leaving").condition, WorkerCondition::Draining);
  EXPECT_EQ(views.at("leaving").leases, 0u);
  EXPECT_EQ(views.at("small").silent, 0);
}

TEST(WorkerList, AWorkerThatFailsWhatOthersDoIsListedAsQuarantined) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  world.sync("good");
  world.fail_tasks("bad", 4);
  EXPECT_EQ(listed(world).at("bad").condition, WorkerCondition::Ready) << "nobody has shown yet that the tasks can be done";
  world.finish_tasks("good", 12);
  EXPECT_EQ(listed(world).at("bad").condition, WorkerCondition::Quarantined);
  EXPECT_EQ(listed(world).at("good").condition, WorkerCondition::Ready);
}

TEST(WorkerList, AWorkerThatIsAwayForAMinuteIsNotListed) {
  SchedulerWorld world;
  world.sync("away");
  world.now += 60 * kSecond;
  world.sync("here");
  EXPECT_EQ(listed(world).size(), 2u);
  world.now += kSecond;
  const std::map<std::string, WorkerView> views = listed(world);
  EXPECT_EQ(views.size(), 1u);
  EXPECT_TRUE(views.contains("here"));
}

TEST(WorkerList, IsToldInPagesWithoutLossOrRepetition) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  for (const char* name : {"w3", "w1", "w5", "w4", "w2"}) {
    world.sequence = 0;
    ASSERT_TRUE(world.sync(world.sync_request(name)).first.ok());
  }
  std::vector<std::string> names;
  std::string token;
  do {
    const v1::ListWorkersResponse page = world.coordinator->list_workers(2, token);
    EXPECT_LE(page.workers_size(), 2);
    for (const v1::WorkerStatus& worker : page.workers()) {
      names.push_back(worker.worker_id());
      EXPECT_EQ(worker.build(), "build");
      EXPECT_EQ(worker.condition(), v1::WORKER_CONDITION_READY);
    }
    token = page.next_page_token();
  } while (!token.empty());
  EXPECT_EQ(names, (std::vector<std::string>{"w1", "w2", "w3", "w4", "w5"}));
  for (const int size : {-1, 1001}) EXPECT_THROW(world.coordinator->list_workers(size, ""), rpc::RpcError) << size;
}

TEST(WorkerList, F22AWorkerCannotSteerTheTerminalOfWhoeverLooks) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const auto code = [&](const std::function<void(v1::SyncRequest&)>& spoil) {
    v1::SyncRequest request = world.sync_request("w1");
    spoil(request);
    return world.sync(request).first.code;
  };
  EXPECT_EQ(code([](auto& r) { r.set_host_name("host\x1b[2J"); }), rpc::Code::kInvalidArgument);
  EXPECT_EQ(code([](auto& r) { r.set_build("b\n"); }), rpc::Code::kInvalidArgument);
  EXPECT_EQ(code([](auto& r) { r.set_arithmetic_class("\x7f"); }), rpc::Code::kInvalidArgument);
  EXPECT_TRUE(world.coordinator->list_workers(0, "").workers().empty());
  EXPECT_EQ(code([](auto& r) {
              r.set_sequence(1);
              r.set_threads(0);
            }),
            rpc::Code::kOk);
  EXPECT_EQ(world.coordinator->list_workers(0, "").workers(0).threads(), 1u);
}

}  // namespace
}  // namespace woodcock::coordinator
