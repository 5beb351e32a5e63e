// What jobs ask of workers: the scheduler alone, with time that is told. Also how it is written down, and workers that leave.
#include "coordinator/policy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <stdexcept>

#include "rpc/error.h"
#include "tests/service/policy_fixture.h"

namespace woodcock::coordinator {
namespace {

using ::testing::HasSubstr;

// --- what is asked of workers ------------------------------------------------------------------------------------

TEST(Policy, ATaskGoesOnlyToAWorkerWithAllOfTheTags) {
  SchedulerWorld world;
  world.scheduler.add_job(job_of("j1", [](JobPolicy& p) { p.demands.tags = {"big", "gpu-room"}; }));
  EXPECT_TRUE(world.sync("plain").empty());
  EXPECT_TRUE(world.sync("big", worker_report(world, "big", {"big"})).empty());
  EXPECT_EQ(reason(world, "j1"), "no connected worker has the tag gpu-room");
  EXPECT_TRUE(world.sync("room", worker_report(world, "room", {"gpu-room"})).empty());
  EXPECT_EQ(reason(world, "j1"), "no connected worker has all of the tags big, gpu-room");
  EXPECT_EQ(world.sync("both", worker_report(world, "both", {"big", "gpu-room", "other"})).size(), 2u);
  EXPECT_EQ(reason(world, "j1"), "");
}

TEST(Policy, ATaskGoesOnlyToAWorkerWhoseSlotsHaveTheMemory) {
  SchedulerWorld world;
  world.scheduler.add_job(job_of("j1", [](JobPolicy& p) { p.demands.memory = 8 * kGib; }));
  EXPECT_TRUE(world.sync("unknown").empty());
  EXPECT_EQ(reason(world, "j1"), "no connected worker has 8.0 GiB of memory for a task");
  EXPECT_TRUE(world.sync("shared", worker_report(world, "shared", {}, 16 * kGib, 4)).empty());
  EXPECT_EQ(reason(world, "j1"), "no connected worker has 8.0 GiB of memory for a task; the most is 4.0 GiB");
  EXPECT_EQ(world.sync("two", worker_report(world, "two", {}, 16 * kGib, 2)).size(), 3u);
  EXPECT_EQ(reason(world, "j1"), "");
}

TEST(Policy, MemoryIsNamedTogetherWithTheTagsThatItIsWantedWith) {
  SchedulerWorld world;
  world.scheduler.add_job(job_of("j1", [](JobPolicy& p) { p.demands = {{"big"}, 8 * kGib}; }));
  world.sync("big", worker_report(world, "big", {"big"}, 4 * kGib));
  world.sync("rich", worker_report(world, "rich", {}, 64 * kGib));
  EXPECT_EQ(reason(world, "j1"), "no connected worker has 8.0 GiB of memory for a task and the tag big; the most is 4.0 GiB");
}

TEST(Policy, ATaskThatFailedIsTriedAgainWhereItMayRunAndWaitsForNobodyElse) {
  SchedulerWorld world;
  world.scheduler.add_job(job_of("j1", [](JobPolicy& p) { p.demands.tags = {"big"}; }));
  const auto report = [&] { return worker_report(world, "big", {"big"}); };
  world.sync("plain1");
  world.sync("plain2");
  const Grant grant = world.sync("big", report()).at(0);
  world.held["big"].erase(grant.lease_id);
  WorkerReport failing = report();
  failing.failures.push_back({grant.lease_id, to_string(grant.task), grant.epoch, FailureCause::Crash, "it crashed", ""});
  world.sync("big", failing);
  // The only worker that may have it has failed it: it is cut into parts, as with one worker on the farm.
  EXPECT_EQ(world.events[EventKind::TaskSplit], 1);
  for (int i = 0; i < 100 && world.scheduler.find("j1")->row.state != JobState::Assembling; ++i) {
    world.now += kSecond;
    world.sync("big", report());
    if (!world.held["big"].empty()) world.finish("big", world.held["big"].begin()->second);
  }
  EXPECT_EQ(world.scheduler.find("j1")->row.state, JobState::Assembling);
}

TEST(Policy, ASceneErrorOfTheOnlyWorkerThatMayRenderItCountsWhenItIsSaidTwice) {
  SchedulerWorld world;
  JobSpec spec = job_of("j1", [](JobPolicy& p) { p.demands.tags = {"big"}; });
  spec.frames[0].header = test_header(32, 32);
  world.scheduler.add_job(spec);
  world.sync("plain");
  ASSERT_EQ(world.sync("big", worker_report(world, "big", {"big"})).size(), 1u);
  for (int time = 0; time < 2; ++time) {
    EXPECT_NE(world.scheduler.find("j1")->row.state, JobState::Failed);
    ASSERT_EQ(world.held["big"].size(), 1u) << "nobody else could have it";
    const Grant grant = world.held["big"].begin()->second;
    world.held["big"].clear();
    WorkerReport failing = worker_report(world, "big", {"big"});
    failing.failures.push_back({grant.lease_id, to_string(grant.task), grant.epoch, FailureCause::SceneError, "scene.pbrt:1:1", ""});
    world.sync("big", failing);
  }
  EXPECT_EQ(world.scheduler.find("j1")->row.state, JobState::Failed);
}

TEST(Policy, NoCopyOfASlowTaskGoesToAWorkerThatMayNotHaveIt) {
  SchedulerWorld world;
  JobSpec spec = job_of("j1", [](JobPolicy& p) {
    p.demands.tags = {"big"};
    p.max_workers = 1;
  });
  spec.frames[0].header = test_header(64, 32);
  world.scheduler.add_job(spec);
  ASSERT_EQ(world.sync("big", worker_report(world, "big", {"big"})).size(), 2u);
  for (int i = 0; i < 10; ++i) {
    world.now += 10 * kSecond;
    world.sync("big", worker_report(world, "big", {"big"}));
    EXPECT_TRUE(world.sync("plain").empty());
    EXPECT_TRUE(world.sync("second", worker_report(world, "second", {"big"})).empty()) << "one worker at once";
  }
}

// --- how many workers --------------------------------------------------------------------------------------------

TEST(Policy, AJobHasAtMostSoManyWorkersAndTheNextJoinsWhenOneHasNothingOfIt) {
  SchedulerWorld world;
  world.scheduler.add_job(job_of("j1", [](JobPolicy& p) { p.max_workers = 2; }));
  EXPECT_EQ(world.sync("w1").size(), 2u);
  EXPECT_EQ(world.sync("w2").size(), 2u);
  EXPECT_TRUE(world.sync("w3").empty());
  // One of the two goes on with it.
  const Grant grant = world.held["w1"].begin()->second;
  world.finish("w1", grant);
  EXPECT_EQ(world.sync("w1").size(), 1u);
  EXPECT_TRUE(world.sync("w3").empty());
  // It drains: what it gives back goes to the third.
  WorkerReport draining = world.report("w2");
  draining.leases.clear();
  draining.draining = true;
  for (const auto& [id, held] : world.held["w2"]) draining.releases.push_back({id, held.epoch});
  world.held["w2"].clear();
  world.sync("w2", draining);
  EXPECT_EQ(world.sync("w3").size(), 2u);
}

TEST(Policy, FramesThatWaitForOneOfTheJobsWorkersSaySo) {
  SchedulerWorld world;
  JobSpec spec = job_of("j1", [](JobPolicy& p) { p.max_workers = 1; });
  spec.frames.push_back(spec.frames[0]);
  spec.frames[1].header.frame = 1;
  world.scheduler.add_job(spec);
  world.sync("w1");
  world.sync("w2");
  const std::vector<Waiting> waits = world.scheduler.waiting_of_frames(*world.scheduler.find("j1"), world.now);
  EXPECT_EQ(waits[0].reason, WaitingReason::None);
  EXPECT_EQ(waits[1].reason, WaitingReason::MaxWorkers);
  EXPECT_EQ(waits[1].text, "as many workers render the job as it may have at once: 1");
}

TEST(Policy, ALeaseOfAnEarlierLeaderIsNotAdoptedBeyondTheLimitOrByWhoMayNotHaveIt) {
  FrameRow row;
  row.pinned = true;
  row.build = "build";
  row.arithmetic_class = "class";
  for (const bool by_tag : {false, true}) {
    SchedulerWorld world(2);
    const JobSpec spec = job_of("j1", [&](JobPolicy& p) {
      p.max_workers = by_tag ? 0 : 1;
      if (by_tag) p.demands.tags = {"big"};
    });
    world.scheduler.recover_job(restored(spec, {}, {row}, {}), {}, world.now);
    world.settle();
    ASSERT_EQ(world.sync("w1", worker_report(world, "w1", {"big"})).size(), 2u);
    WorkerReport late = world.report("w2");
    late.leases.push_back({"L1-9", "j1.0.9", (uint64_t{1} << 32) + 9, 4, 5, 0});
    world.sync("w2", late);
    EXPECT_EQ(world.cancelled.at("L1-9"), CancelReason::UnknownLease);
    EXPECT_EQ(world.scheduler.find("j1")->workers.size(), 1u);
  }
}

// --- workers that leave ------------------------------------------------------------------------------------------

TEST(Policy, AWorkerThatLeavesGivesAllBackAtOnceAndIsShownForAMinute) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const Grant grant = world.sync("w1").at(0);
  WorkerReport last = world.report("w1");
  last.left = true;
  EXPECT_TRUE(world.sync("w1", last).empty());
  EXPECT_EQ(world.events[EventKind::LeaseReleased], 2);
  EXPECT_EQ(world.events[EventKind::TaskFailed], 0);
  EXPECT_EQ(world.scheduler.live_leases(), 0u);
  EXPECT_EQ(world.scheduler.connected_workers(world.now), 0);
  EXPECT_EQ(reason(world, "j1"), "no worker is connected");
  const auto listed = [&] { return world.scheduler.list_workers("", 10, world.now); };
  ASSERT_EQ(listed().size(), 1u);
  EXPECT_EQ(listed()[0].condition, WorkerCondition::Left);
  EXPECT_EQ(world.sync("w2").at(0).task, grant.task);
  world.now += 61 * kSecond;
  world.sync("w2");
  ASSERT_EQ(listed().size(), 1u);
  EXPECT_EQ(listed()[0].last->worker_id, "w2");
  // Started again it is as new.
  world.incarnation["w1"] = 1;
  world.held["w1"].clear();
  EXPECT_EQ(world.sync("w1").size(), 2u);
}

// --- what is written ---------------------------------------------------------------------------------------------

TEST(Policy, IsKeptAsItWasAskedFor) {
  JobPolicy policy{"ada \"x\" ü", {{"big", "gpu"}, 8 * kGib}, 7, {"j1", "j2"}, {"j2"}};
  EXPECT_EQ(parse_policy(policy_text(policy)), policy);
  EXPECT_EQ(policy_text({}), "");
  EXPECT_EQ(parse_policy(""), JobPolicy{});
  EXPECT_THROW(parse_policy("{}"), std::runtime_error);
  EXPECT_THROW(parse_policy("nonsense"), std::runtime_error);
  v1::JobPolicy wire = to_wire(policy);
  wire.add_required_tags("big");
  policy.waits_for = policy.after;
  EXPECT_EQ(checked_policy(wire), policy) << "what is asked for twice is asked for";
}

TEST(Policy, F22WhatIsOutOfBoundsIsRefusedByTheNameOfItsField) {
  const auto refuses = [](const std::string& field, const std::function<void(v1::JobPolicy&)>& spoil) {
    v1::JobPolicy wire;
    spoil(wire);
    try {
      checked_policy(wire);
      ADD_FAILURE() << field << " is taken";
    } catch (const rpc::RpcError& error) {
      EXPECT_EQ(error.code(), rpc::Code::kInvalidArgument);
      EXPECT_THAT(error.what(), HasSubstr("policy." + field + ": "));
      EXPECT_THAT(error.what(), HasSubstr("expected"));
      EXPECT_THAT(error.what(), ::testing::Not(HasSubstr("\x1b")));
    }
  };
  refuses("user", [](auto& p) { p.set_user("a\x1b[2J"); });
  refuses("user", [](auto& p) { p.set_user(std::string(65, 'a')); });
  refuses("required_tags", [](auto& p) { p.add_required_tags(""); });
  refuses("required_tags", [](auto& p) { p.add_required_tags("a b"); });
  refuses("required_tags", [](auto& p) { p.add_required_tags("\x1b[2J"); });
  refuses("required_tags", [](auto& p) {
    for (int i = 0; i < 33; ++i) p.add_required_tags(numbered("t", i));
  });
  refuses("memory_bytes", [](auto& p) { p.set_memory_bytes(-1); });
  refuses("memory_bytes", [](auto& p) { p.set_memory_bytes((int64_t{1} << 50) + 1); });
  refuses("max_workers", [](auto& p) { p.set_max_workers(100'001); });
  refuses("after", [](auto& p) { p.add_after("../j1"); });
  refuses("after", [](auto& p) {
    for (int i = 0; i < 65; ++i) p.add_after(numbered("j", i));
  });
}

}  // namespace
}  // namespace woodcock::coordinator
