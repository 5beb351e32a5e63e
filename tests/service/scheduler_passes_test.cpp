// Adaptive frames in the scheduler: passes, closed blocks, restarts, another target.
#include <gtest/gtest.h>

#include <algorithm>

#include "coordinator/task_grid.h"
#include "tests/service/scheduler_fixture.h"

namespace woodcock::coordinator {
namespace {

/// 4 × 4 blocks, all at 16 after the first pass.
JobSpec adaptive_job() {
  JobSpec job = test_job("j1");
  job.target = SamplingTarget{0.1, 1000};
  job.rounds = {{0, kFirstCount}};
  return job;
}

Decision next_pass(const SampleMap& map, std::initializer_list<size_t> blocks, int64_t count) {
  Decision decision;
  decision.error = 0.5;
  decision.counts = map.counts;
  for (const size_t b : blocks) decision.counts[b] = count;
  decision.active = static_cast<int64_t>(blocks.size());
  return decision;
}

/// What a restart would find.
Job saved(const Job& job) {
  const Frame& frame = job.frames[0];
  std::vector<SettledTask> settled;
  for (int64_t number = 0; number < frame.tasks.size(); ++number) {
    if (frame.tasks.state(number) == TaskState::Open) continue;
    SettledTask& row = settled.emplace_back();
    row.number = number;
    row.state = frame.tasks.state(number);
    if (row.state == TaskState::GivenUp) row.error = frame.failures.at(number).error;
  }
  // Parts follow each other in the order of the splits.
  for (int64_t number = 0; number < frame.tasks.size(); ++number) {
    const int64_t parent = frame.tasks.parent(number);
    if (parent < 0) continue;
    SettledTask& row = *std::find_if(settled.begin(), settled.end(), [&](const SettledTask& task) { return task.number == parent; });
    if (row.first_part == 0) row.first_part = number;
  }
  JobSpec spec = job.spec;
  spec.frames = {frame.spec};
  return restored(spec, job.row, {frame.row}, settled);
}

TEST(Scheduler, AnAdaptiveFrameGoesOnPassByPassAndAFailedTaskClosesItsBlock) {
  SchedulerWorld world;
  world.scheduler.add_job(adaptive_job());
  world.finish_everything("w1");
  ASSERT_EQ(world.assembled.size(), 1u);
  const Frame& frame = world.scheduler.find("j1")->frames[0];
  EXPECT_TRUE(frame.to_be_assembled());
  EXPECT_EQ(frame.row.state, FrameState::Running);
  EXPECT_EQ(frame.settled_map(16).counts, std::vector<int64_t>(16, 16));
  EXPECT_FALSE(world.scheduler.pass_decided("j1", 0, next_pass(frame.settled_map(16), {5, 6}, 32), {}, 17));
  EXPECT_TRUE(world.scheduler.pass_decided("j1", 0, next_pass(frame.settled_map(16), {5, 6}, 32), {}, 18));
  world.settle();
  EXPECT_EQ(frame.tasks.size(), 18);
  EXPECT_EQ(world.events[EventKind::PassDecided], 1);
  EXPECT_EQ(world.events[EventKind::FramePinned], 1);  // looked up again, not pinned again
  EXPECT_EQ(frame.settled_map(16).counts, std::vector<int64_t>(16, 16));

  // Nobody can render block 6.
  const PixelRect poisoned = BlockGrid{frame.spec.header.bounds}.block(6);
  for (int round = 0; round < 2000 && world.assembled.size() < 2; ++round) {
    world.now += 31 * kSecond;
    world.sync("w1");
    const auto held = world.held["w1"];
    for (const auto& [id, grant] : held) {
      if (poisoned.contains(grant.area.rect))
        world.fail("w1", grant);
      else
        world.finish("w1", grant);
    }
  }
  ASSERT_EQ(world.assembled.size(), 2u);
  SampleMap settled = frame.settled_map(16);
  EXPECT_EQ(settled.counts[5], 32);
  EXPECT_EQ(settled.counts[6], 16);
  EXPECT_EQ(frame.closed_blocks()[6], true);
  EXPECT_EQ(std::count(settled.counts.begin(), settled.counts.end(), 16), 15);

  // The next pass leaves it alone; a restart in its middle knows the same tasks.
  EXPECT_TRUE(world.scheduler.pass_decided("j1", 0, next_pass(settled, {5}, 40), {}, 1000));
  world.settle();
  SchedulerWorld restarted(2);
  restarted.scheduler.recover_job(saved(*world.scheduler.find("j1")), {}, restarted.now);
  const Frame& again = restarted.scheduler.find("j1")->frames[0];
  ASSERT_EQ(again.tasks.size(), frame.tasks.size());
  for (int64_t i = 0; i < frame.tasks.size(); ++i) {
    EXPECT_EQ(again.tasks.area(i), frame.tasks.area(i));
    EXPECT_EQ(again.tasks.state(i), frame.tasks.state(i));
  }
  EXPECT_EQ(again.settled_map(16), frame.settled_map(16));
  EXPECT_EQ(again.closed_blocks(), frame.closed_blocks());
  restarted.settle();
  restarted.finish_everything("w1");
  ASSERT_EQ(restarted.assembled.size(), 1u);
  EXPECT_EQ(again.settled_map(16).counts[5], 40);
  restarted.scheduler.frame_assembled("j1", 0, std::string(64, 'e'), 1, {});
  EXPECT_EQ(again.row.state, FrameState::Partial);

  // Another target: it is decided anew.
  EXPECT_TRUE(restarted.scheduler.set_target("j1", {0.05, 1000}));
  restarted.settle();
  EXPECT_EQ(restarted.assembled.size(), 2u);
  EXPECT_TRUE(again.to_be_assembled());
}

TEST(Scheduler, ALimitOfTimeCountsWhileWorkersRenderAndLeavesTheBlocksOfThePassWhereTheyWere) {
  SchedulerWorld world;
  JobSpec spec = adaptive_job();
  spec.target->error = 0;
  spec.time_limit = TimeLimit{100};
  world.scheduler.add_job(spec);
  const Job& job = *world.scheduler.find("j1");
  const Frame& frame = job.frames[0];
  const auto tick = [&](int seconds, bool rendering) {
    for (int i = 0; i < seconds; ++i) {
      world.now += kSecond;
      if (rendering && i % 10 == 0) world.sync("w1");
      world.scheduler.tick(world.now);
    }
    world.settle();
  };
  tick(500, false);
  EXPECT_EQ(job.spec.time_limit->spent, 0);
  world.finish_everything("w1");
  ASSERT_EQ(world.assembled.size(), 1u);
  EXPECT_TRUE(world.scheduler.pass_decided("j1", 0, next_pass(frame.settled_map(16), {5, 6, 7}, 32), {}, 1000));
  world.settle();

  // One task is done, two are being rendered when the time is over.
  tick(1, false);
  world.sync("w1");
  world.finish("w1", world.held["w1"].begin()->second);
  world.sync("w1");
  tick(95, true);
  EXPECT_NEAR(job.spec.time_limit->spent, 95, 1e-6);
  EXPECT_EQ(frame.row.state, FrameState::Running);
  ASSERT_EQ(world.held["w1"].size(), 2u);
  tick(5, false);
  EXPECT_EQ(frame.row.state, FrameState::Assembling);
  EXPECT_TRUE(frame.to_be_assembled());
  EXPECT_EQ(world.assembled.size(), 2u);
  SampleMap map = frame.settled_map(16);
  EXPECT_EQ(std::count(map.counts.begin(), map.counts.end(), 32), 1);
  EXPECT_EQ(std::count(map.counts.begin(), map.counts.end(), 16), 15);
  world.sync("w1");
  EXPECT_TRUE(world.held["w1"].empty());  // cancelled, and nothing new

  // A restart before the image is there merges it; then the job is done and says why.
  SchedulerWorld restarted(2);
  restarted.scheduler.recover_job(saved(job), {}, restarted.now);
  restarted.settle();
  ASSERT_EQ(restarted.assembled.size(), 1u);
  const Job& again = *restarted.scheduler.find("j1");
  restarted.scheduler.frame_assembled("j1", 0, std::string(64, 'e'), 1, {}, again.spec.time_limit->reason());
  EXPECT_EQ(again.row.state, JobState::Done);
  EXPECT_EQ(again.row.reason, "ended by its limit of 100 s");
  EXPECT_EQ(again.frames[0].settled_map(16), map);

  // Without a limit, or with more time, the pass goes on where it was.
  EXPECT_TRUE(restarted.scheduler.set_target("j1", *again.spec.target));
  restarted.settle();
  EXPECT_EQ(again.row.state, JobState::Running);
  EXPECT_FALSE(again.spec.time_limit);
  EXPECT_TRUE(restarted.scheduler.set_target("j1", *again.spec.target, 50));
  restarted.settle();
  EXPECT_EQ(again.row.state, JobState::Running);
  restarted.finish_everything("w1");
  map = again.frames[0].settled_map(16);
  EXPECT_EQ(std::count(map.counts.begin(), map.counts.end(), 32), 3);
  EXPECT_TRUE(again.frames[0].to_be_assembled());
}

TEST(Scheduler, WhatIsDamagedAfterTheTimeIsRenderedAgainBeforeTheFrameEnds) {
  SchedulerWorld world;
  JobSpec spec = adaptive_job();
  spec.time_limit = TimeLimit{1};
  world.scheduler.add_job(spec);
  const Frame& frame = world.scheduler.find("j1")->frames[0];
  world.finish_everything("w1");
  EXPECT_TRUE(world.scheduler.pass_decided("j1", 0, next_pass(frame.settled_map(16), {5, 6, 7}, 32), {}, 1000));
  world.settle();
  const auto tick = [&] {
    world.sync("w1");
    world.scheduler.tick(world.now += 2 * kSecond);
    world.settle();
  };
  tick();
  tick();
  ASSERT_EQ(frame.row.state, FrameState::Assembling);
  const uint64_t revision = frame.revision;
  world.scheduler.reopen({"j1", 0, 3}, world.settled.at("j1.0.3").result, "damaged");
  EXPECT_GT(frame.revision, revision);  // a merge of before is not the frame's any more
  for (int i = 0; i < 3; ++i) tick();
  EXPECT_EQ(frame.row.state, FrameState::Running);
  ASSERT_EQ(frame.active.at(3).leases.size(), 1u);
  world.finish("w1", world.held["w1"].at(frame.active.at(3).leases[0]));
  tick();
  EXPECT_EQ(frame.row.state, FrameState::Assembling);
  EXPECT_EQ(frame.state(3), TaskState::Done);
}

TEST(Scheduler, AResultThatIsBeingCommittedWhenTheTimeEndsCounts) {
  SchedulerWorld world;
  JobSpec spec = adaptive_job();
  spec.time_limit = TimeLimit{1};
  world.scheduler.add_job(spec);
  world.sync("w1");
  const Grant grant = world.held["w1"].begin()->second;
  world.scheduler.tick(world.now);
  // Offered, and not yet on the disk: its action is not carried out.
  world.scheduler.offer({grant.lease_id, to_string(grant.task), grant.epoch, {grant.result_key, std::string(64, 'd'), 100, {1, 1, 1}, {}}},
                        "w1", true, world.now);
  world.scheduler.tick(world.now += 2 * kSecond);
  EXPECT_EQ(world.scheduler.find("j1")->frames[0].row.state, FrameState::Running);
  world.settle();
  world.scheduler.tick(world.now += kSecond);
  EXPECT_EQ(world.scheduler.find("j1")->frames[0].row.state, FrameState::Assembling);
}

TEST(Scheduler, AnExtensionTriesFailedFramesAgain) {
  SchedulerWorld world;
  JobSpec spec = test_job("j1");
  spec.frames.push_back(spec.frames[0]);
  spec.frames[1].header.frame = 1;
  world.scheduler.add_job(spec);
  const Job& job = *world.scheduler.find("j1");
  world.sync("w1");
  for (int attempt = 0; attempt < 2; ++attempt)  // of the only worker there is
    world.fail("w1", world.held["w1"].begin()->second, FailureCause::SceneError);
  ASSERT_EQ(job.frames[0].row.state, FrameState::Failed);
  ASSERT_FALSE(has_ended(job.row.state));
  EXPECT_TRUE(world.scheduler.extend("j1", 128));
  world.finish_everything("w1");
  EXPECT_EQ(world.assembled.size(), 2u);
  EXPECT_EQ(job.frames[0].done, 32);
}

TEST(Scheduler, ATimeThatDoesNotSufficeForASequenceLeavesItPartialAndToBeExtended) {
  SchedulerWorld world;
  JobSpec spec = adaptive_job();
  spec.time_limit = TimeLimit{1};
  spec.frames.push_back(spec.frames[0]);
  spec.frames[1].header.frame = 1;
  world.scheduler.add_job(spec);
  const Job& job = *world.scheduler.find("j1");
  world.sync("w1");
  world.finish("w1", world.held["w1"].begin()->second);
  world.sync("w1");
  world.scheduler.tick(world.now);
  world.scheduler.tick(world.now += 2 * kSecond);
  world.settle();
  EXPECT_EQ(job.frames[1].row.state, FrameState::Failed);
  world.scheduler.frame_assembled("j1", 0, std::string(64, 'e'), 1, {}, "time");
  EXPECT_EQ(job.row.state, JobState::Partial);
  EXPECT_TRUE(world.scheduler.set_target("j1", *job.spec.target));
  world.finish_everything("w1");
  EXPECT_TRUE(job.frames[0].to_be_assembled());
  EXPECT_TRUE(job.frames[1].to_be_assembled());
}

TEST(Scheduler, ALimitOfTimeThatEndsBeforeTheFirstSamplesLeavesAPartialFrameOrNone) {
  for (const bool some : {false, true}) {
    SchedulerWorld world;
    JobSpec spec = adaptive_job();
    spec.time_limit = TimeLimit{3};
    world.scheduler.add_job(spec);
    world.sync("w1");
    if (some) world.finish("w1", world.held["w1"].begin()->second);
    for (int i = 0; i < 5; ++i) world.scheduler.tick(world.now += kSecond);
    world.settle();
    const Job& job = *world.scheduler.find("j1");
    if (some) {
      FrameStatistics statistics;
      statistics.missing_pixels = 15 * 1024;
      world.scheduler.frame_assembled("j1", 0, std::string(64, 'e'), 1, statistics, job.spec.time_limit->reason());
    }
    EXPECT_EQ(job.row.state, some ? JobState::Partial : JobState::Failed);
    EXPECT_EQ(job.row.reason.substr(0, 25), "ended by its limit of 3 s");
  }
}

TEST(Scheduler, AnOfferBesideTheCommitOfAnotherWaitsForItAndIsDecidedByItsRow) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const Grant grant = world.sync("w1").at(0);
  Offer offer{grant.lease_id, to_string(grant.task), grant.epoch, {grant.result_key, std::string(64, 'd'), 100, {}, {}}};
  EXPECT_EQ(world.decide(offer, "w1"), OfferStatus::Pending);
  offer.result.key = std::string(64, '0');
  offer.result.digest = std::string(64, 'e');
  EXPECT_EQ(world.decide(offer, "w2"), OfferStatus::Pending) << "whatever its key";
  world.settle();
  EXPECT_EQ(world.commits.size(), 1u);
  EXPECT_EQ(world.decide(offer, "w2"), OfferStatus::Refused);
}

TEST(TaskGrid, TasksOfAPassLieInOneBlockEach) {
  SampleMap map{{3, 5, 130, 97}, {}};
  map.counts.assign(map.grid().size(), 24);
  std::vector<int64_t> after = map.counts;
  after[1] = 28;
  after[7] = 1024;
  int64_t samples = 0;
  for (const TaskArea& task : pass_tasks(map, after, 16)) {
    EXPECT_TRUE(is_dyadic(task.range));
    const size_t b = map.grid().index(task.rect.x0, task.rect.y0);
    EXPECT_TRUE(b == 1 || b == 7);
    EXPECT_TRUE(map.grid().block(b).contains(task.rect));
    samples += task.samples();
  }
  EXPECT_EQ(samples, map.grid().block(1).area() * 4 + map.grid().block(7).area() * 1000);
}

}  // namespace
}  // namespace woodcock::coordinator
