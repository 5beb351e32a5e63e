#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <variant>

#include "coordinator/task_grid.h"
#include "tests/service/scheduler_fixture.h"

namespace woodcock::coordinator {
namespace {

TEST(Scheduler, EveryTaskIsCommittedOnceAndTheFrameIsAssembled) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  world.finish_everything("w1");
  EXPECT_EQ(world.commits.size(), 16u);
  std::set<int64_t> numbers;
  for (const TaskRef& task : world.commits) numbers.insert(task.number);
  EXPECT_EQ(numbers.size(), 16u);
  ASSERT_EQ(world.assembled.size(), 1u);
  EXPECT_EQ(world.scheduler.find("j1")->row.state, JobState::Assembling);
  world.scheduler.frame_assembled("j1", 0, std::string(64, 'e'), 1, {});
  EXPECT_EQ(world.scheduler.find("j1")->row.state, JobState::Done);
}

TEST(Scheduler, AWorkerGetsOneTaskMoreThanItsSlots) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  EXPECT_EQ(world.sync("w1").size(), 2u);
  EXPECT_EQ(world.sync("w1").size(), 0u);
}

TEST(Scheduler, F01ALeaseWithoutProgressExpiresAndIsGrantedAtAHigherEpoch) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const std::vector<Grant> first = world.sync("w1");
  world.now += 41 * kSecond;
  world.scheduler.tick(world.now);
  world.settle();
  EXPECT_EQ(world.events[EventKind::LeaseExpired], 2);
  const std::vector<Grant> second = world.sync("w2");
  ASSERT_FALSE(second.empty());
  EXPECT_EQ(second[0].task, first[0].task);
  EXPECT_GT(second[0].epoch, first[0].epoch);
}

TEST(Scheduler, F12ALeaseLivesAsLongAsItsCounterMovesAndNoLonger) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  world.sync("w1");
  for (int i = 0; i < 20; ++i) {
    world.now += 30 * kSecond;
    world.sync("w1");  // counters move
    world.scheduler.tick(world.now);
  }
  EXPECT_EQ(world.scheduler.live_leases(), 2u);
  for (int i = 0; i < 4; ++i) {  // the heartbeat goes on, the counters stand
    world.now += 15 * kSecond;
    WorkerReport r = world.report("w1");
    for (LeaseReport& lease : r.leases) lease.renewal_counter = 1'000'000;
    world.sync("w1", r);
    world.scheduler.tick(world.now);
  }
  world.settle();
  EXPECT_EQ(world.events[EventKind::LeaseExpired], 2);
}

TEST(Scheduler, F02AStaleWorkerIsRefusedButItsResultCommitsOnceWhileTheTaskIsOpen) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const std::vector<Grant> stale = world.sync("w1");
  ASSERT_EQ(stale.size(), 2u);
  const Grant grant = stale[0];
  world.now += 60 * kSecond;
  world.scheduler.tick(world.now);
  const Grant again = world.sync("w2").at(0);
  ASSERT_EQ(again.task, grant.task);
  EXPECT_EQ(world.events[EventKind::LeaseExpired], 2);
  // Its failure report is stale and changes nothing; the lease that it renews is no more.
  world.fail("w1", grant);
  EXPECT_EQ(world.cancelled.count(stale[1].lease_id), 1u);
  EXPECT_EQ(world.events[EventKind::TaskFailed], 0);
  EXPECT_EQ(world.finish("w1", grant), OfferStatus::Pending);
  EXPECT_EQ(world.commits.size(), 1u);
  EXPECT_EQ(world.finish("w2", again), OfferStatus::AlreadyCommitted);
  EXPECT_EQ(world.commits.size(), 1u);
}

TEST(Scheduler, AReportedLeaseOfAnotherEpochOrNoLeaseIsCancelled) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const Grant grant = world.sync("w1").at(0);
  WorkerReport r = world.report("w1");
  for (LeaseReport& lease : r.leases) lease.epoch += 5;
  r.leases.push_back({"L9-9", "j1.0.3", (uint64_t{1} << 32) + 99, 1, 5, 0});
  world.sync("w1", r);
  EXPECT_EQ(world.cancelled.at(grant.lease_id), CancelReason::StaleEpoch);
  EXPECT_EQ(world.cancelled.at("L9-9"), CancelReason::UnknownLease);
}

TEST(Scheduler, AGrantWhoseReplyWasLostIsGrantedAgain) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const Grant lost = world.sync("w1").at(0);
  world.held["w1"].clear();
  const std::vector<Grant> again = world.sync("w1");
  ASSERT_EQ(again.size(), 2u);
  EXPECT_TRUE(again[0].lease_id == lost.lease_id || again[1].lease_id == lost.lease_id);
  EXPECT_EQ(world.scheduler.live_leases(), 2u);
}

TEST(Scheduler, ANewIncarnationGivesTheOldOnesLeasesBackAndTheOldOneIsAborted) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  world.sync("w1");
  const WorkerReport old = world.report("w1");
  world.incarnation["w1"] = 1;
  world.held["w1"].clear();
  EXPECT_EQ(world.sync("w1").size(), 2u);
  EXPECT_EQ(world.events[EventKind::LeaseReleased], 2);
  EXPECT_EQ(world.scheduler.report(old, world.now), ReportStatus::OlderIncarnation);
}

TEST(Scheduler, AnOlderSequenceIsRefused) {
  SchedulerWorld world;
  const WorkerReport first = world.report("w1");
  world.sync("w1");
  EXPECT_EQ(world.scheduler.report(first, world.now), ReportStatus::OlderSequence);
}

TEST(Scheduler, F05RepeatedOffersAreIdempotentAndADifferentResultIsAnAlarm) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const Grant grant = world.sync("w1").at(0);
  EXPECT_EQ(world.finish("w1", grant), OfferStatus::Pending);
  EXPECT_EQ(world.finish("w1", grant), OfferStatus::AlreadyCommitted);
  EXPECT_EQ(world.finish("w2", grant, std::string(64, 'f')), OfferStatus::Refused);
  EXPECT_EQ(world.events[EventKind::DeterminismAlarm], 1);
  EXPECT_EQ(world.commits.size(), 1u);
}

TEST(Scheduler, AResultWithAnotherKeyOrWithoutItsBlobDoesNotCommit) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const Grant grant = world.sync("w1").at(0);
  Offer offer{grant.lease_id, to_string(grant.task), grant.epoch, {grant.result_key, std::string(64, 'd'), 100, {}, {}}};
  EXPECT_EQ(world.scheduler.offer(offer, "w1", false, world.now).status, OfferStatus::UploadNeeded);
  offer.result.key = std::string(64, '0');
  EXPECT_EQ(world.scheduler.offer(offer, "w1", true, world.now).status, OfferStatus::Refused);
  world.settle();
  EXPECT_TRUE(world.commits.empty());
}

TEST(Scheduler, F07APoisonPixelEndsAsOneSmallHoleAndAPartialJob) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const std::vector<std::string> workers{"w1", "w2", "w3"};
  const auto poisoned = [](const Grant& g) { return g.area.rect.contains({40, 40, 41, 41}); };
  for (int round = 0; round < 2000 && world.assembled.empty(); ++round) {
    world.now += 31 * kSecond;
    for (const std::string& worker : workers) {
      world.sync(worker);
      const auto held = world.held[worker];
      for (const auto& [id, grant] : held) {
        if (poisoned(grant))
          world.fail(worker, grant);
        else
          world.finish(worker, grant);
      }
    }
  }
  ASSERT_EQ(world.assembled.size(), 1u);
  const Frame& frame = world.scheduler.find("j1")->frames[0];
  EXPECT_LE(frame.splits, 64);
  int64_t hole = 0, covered = 0;
  for (int64_t number = 0; number < frame.tasks.size(); ++number) {
    const TaskArea area = frame.tasks.area(number);
    const TaskState state = frame.state(number);
    if (state == TaskState::GivenUp) hole += area.samples();
    if (state == TaskState::Done) covered += area.samples();
    EXPECT_TRUE(state != TaskState::GivenUp || area.rect.area() <= kMinTileEdge * kMinTileEdge);
  }
  EXPECT_EQ(hole + covered, 128 * 128 * 64);
  EXPECT_EQ(hole, kMinTileEdge * kMinTileEdge * 64);
  world.scheduler.frame_assembled("j1", 0, std::string(64, 'e'), 1, {});
  EXPECT_EQ(world.scheduler.find("j1")->row.state, JobState::Partial);
}

TEST(Scheduler, ASceneThatCrashesEverywhereFailsAfterABoundedNumberOfTries) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  int failures = 0;
  for (; failures < 5000 && !has_ended(world.scheduler.find("j1")->row.state); ++failures) {
    world.now += 31 * kSecond;
    world.sync("w1");
    if (!world.held["w1"].empty()) world.fail("w1", world.held["w1"].begin()->second);
  }
  EXPECT_EQ(world.scheduler.find("j1")->row.state, JobState::Failed);
  EXPECT_LE(failures, 16 + 64 * 5);
}

TEST(Scheduler, AnUnreadableSceneFailsWhenTwoWorkersSaySo) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const Grant a = world.sync("w1").at(0), b = world.sync("w2").at(0);
  world.fail("w1", a, FailureCause::SceneError);
  EXPECT_FALSE(has_ended(world.scheduler.find("j1")->row.state));
  world.fail("w2", b, FailureCause::SceneError);
  EXPECT_EQ(world.scheduler.find("j1")->row.state, JobState::Failed);
}

TEST(Scheduler, F28ASceneErrorOfOneWorkerIsNotBelievedWhereOthersRender) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  world.sync("bad"), world.sync("good");
  for (int i = 0; i < 6; ++i) {
    world.now += 31 * kSecond;
    world.sync("good"), world.sync("bad");
    if (!world.held["bad"].empty()) world.fail("bad", world.held["bad"].begin()->second, FailureCause::SceneError);
    ASSERT_FALSE(has_ended(world.scheduler.find("j1")->row.state)) << i;
  }
  world.finish_everything("good");
  EXPECT_EQ(world.scheduler.find("j1")->frames[0].row.state, FrameState::Assembling);
  EXPECT_EQ(world.scheduler.find("j1")->frames[0].splits, 0);
}

TEST(Scheduler, F28TheOnlyWorkerMustSayTwiceThatASceneCannotBeRead) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  world.fail("w1", world.sync("w1").at(0), FailureCause::SceneError);
  EXPECT_FALSE(has_ended(world.scheduler.find("j1")->row.state));
  world.now += 31 * kSecond;
  world.sync("w1");
  world.fail("w1", world.held["w1"].begin()->second, FailureCause::SceneError);
  EXPECT_EQ(world.scheduler.find("j1")->row.state, JobState::Failed);
}

TEST(Scheduler, F09AHostThatFailsEverythingIsQuarantinedProbedAndComesBack) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1", 0, 256));
  world.sync("good");
  world.fail_tasks("bad", 4);
  world.finish_tasks("good", 12);
  world.held["bad"].clear();
  world.now += 5 * kSecond;
  WorkerReport r = world.report("bad");
  for (const auto& [id, grant] : world.held["bad"]) r.releases.push_back({id, grant.epoch});
  ASSERT_EQ(world.scheduler.report(r, world.now), ReportStatus::Accepted);
  EXPECT_NE(world.scheduler.answer("bad", world.now).notice.find("quarantined"), std::string::npos);
  EXPECT_EQ(world.scheduler.find("j1")->frames[0].splits, 0);
  // The probe works: it is free again.
  world.held["bad"].clear();
  world.now += 400 * kSecond;
  world.sync("good");
  const std::vector<Grant> probe = world.sync("bad");
  ASSERT_GE(probe.size(), 1u);
  world.finish("bad", probe[0]);
  EXPECT_EQ(world.scheduler.answer("bad", world.now).notice, "");
}

TEST(Scheduler, F15AnIdleWorkerGetsACopyOfTheLastTasksAndTheLoserIsCancelled) {
  SchedulerWorld world;
  JobSpec job = test_job("j1");
  job.tile_size = 128;
  world.scheduler.add_job(job);
  const Grant slow = world.sync("slow").at(0);
  world.now += kSecond;
  EXPECT_TRUE(world.sync("idle").empty());
  world.now += 20 * kSecond;
  world.sync("slow");
  const std::vector<Grant> copy = world.sync("idle");
  ASSERT_EQ(copy.size(), 1u);
  EXPECT_EQ(copy[0].task, slow.task);
  EXPECT_EQ(copy[0].result_key, slow.result_key);
  world.finish("idle", copy[0]);
  world.sync("slow");
  EXPECT_EQ(world.cancelled.at(slow.lease_id), CancelReason::TaskSettled);
  EXPECT_EQ(world.commits.size(), 1u);
}

TEST(Scheduler, F19AFramePinnedToABuildIsRenderedByNoOther) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  world.sync("w1");
  WorkerReport other = world.report("w2");
  other.build = "another";
  EXPECT_TRUE(world.sync("w2", other).empty());
  // The pinned build goes away: the frame says what it waits for.
  world.now += 120 * kSecond;
  other = world.report("w2");
  other.build = "another";
  world.sync("w2", other);
  const Job& job = *world.scheduler.find("j1");
  EXPECT_NE(world.scheduler.waiting_reason(job, job.frames[0], world.now).find("no connected worker has build build"), std::string::npos);
}

TEST(Scheduler, HigherPriorityFirstAndEqualOnesShare) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("low", -1));
  world.scheduler.add_job(test_job("a"));
  world.scheduler.add_job(test_job("b"));
  std::map<std::string, int> served;
  for (int i = 0; i < 16; ++i) {
    world.now += kSecond;
    world.sync("w1");
    const Grant grant = world.held["w1"].begin()->second;
    ++served[grant.task.job];
    world.finish("w1", grant);
  }
  EXPECT_EQ(served["low"], 0);
  EXPECT_NEAR(served["a"], 8, 2);
  EXPECT_NEAR(served["b"], 8, 2);
}

TEST(Scheduler, F24PauseStopsNewLeasesCancelEndsThemAndALateResultChangesNothing) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const std::vector<Grant> grants = world.sync("w1");
  EXPECT_TRUE(world.scheduler.set_paused("j1", true));
  world.finish("w1", grants[0]);
  EXPECT_TRUE(world.sync("w1").empty());
  EXPECT_EQ(world.scheduler.find("j1")->row.state, JobState::Paused);
  EXPECT_TRUE(world.scheduler.cancel("j1"));
  EXPECT_EQ(world.finish("w1", grants[1]), OfferStatus::Refused);
  EXPECT_FALSE(world.scheduler.set_paused("j1", false));
  EXPECT_EQ(world.scheduler.find("j1")->row.state, JobState::Cancelled);
}

TEST(Scheduler, F24AnExtensionBesideAPinThatIsNotDurableYetKeepsIt) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  EXPECT_EQ(world.scheduler.report(world.report("w1"), world.now), ReportStatus::Accepted);
  world.scheduler.answer("w1", world.now);
  EXPECT_TRUE(world.scheduler.extend("j1", 128));
  FrameRow row;
  int pins = 0;
  for (const Action& any : world.scheduler.take_actions()) {
    if (const auto* pin = std::get_if<action::PinFrame>(&any)) {
      row = pin->row;
      ++pins;
    }
    if (const auto* save = std::get_if<action::SaveFrame>(&any)) row = save->row;
  }
  EXPECT_EQ(pins, 1);
  EXPECT_TRUE(row.pinned);
  EXPECT_EQ(row.build, world.scheduler.list_workers("", 1, world.now).at(0).last->build);
  EXPECT_FALSE(world.scheduler.find("j1")->frames[0].row.pinned) << "nothing is leased before the pin is durable";
}

TEST(Scheduler, AJobCancelledWhileItsLastTaskCommitsEndsInOneFinalState) {
  for (const bool while_merging : {false, true}) {
    SchedulerWorld world;
    JobSpec spec = test_job("j1");
    spec.frames[0].header = test_header(32, 32);
    world.scheduler.add_job(spec);
    const Grant grant = world.sync("w1").at(0);
    ASSERT_EQ(world.scheduler.find("j1")->frames[0].tasks.size(), 1);
    const Offer offer{grant.lease_id, to_string(grant.task), grant.epoch, {grant.result_key, std::string(64, 'd'), 100, {}, {}}};
    world.held["w1"].clear();
    EXPECT_EQ(world.scheduler.offer(offer, "w1", true, world.now).status, OfferStatus::Pending);
    for (int i = 0; while_merging && i < 2; ++i) world.settle();  // the commit, then what follows from it
    world.events.clear();
    EXPECT_TRUE(world.scheduler.cancel("j1"));
    world.settle();  // without `while_merging` the commit is durable only now
    world.scheduler.frame_assembled("j1", 0, std::string(64, 'e'), 1, {});
    world.scheduler.tick(world.now);
    world.settle();
    const Job& job = *world.scheduler.find("j1");
    EXPECT_EQ(job.row.state, JobState::Cancelled);
    EXPECT_EQ(job.frames[0].row.state, FrameState::Cancelled);
    EXPECT_EQ(job.frames[0].row.image_digest, "");
    EXPECT_EQ(job.frames[0].done, 1) << "the result stays for later jobs";
    EXPECT_EQ(world.events[EventKind::StateChanged], 1);
    EXPECT_EQ(world.events[EventKind::FrameDone], 0);
    EXPECT_EQ(world.scheduler.live_leases(), 0u);
    EXPECT_EQ(world.decide(offer, "w1"), OfferStatus::AlreadyCommitted);
    EXPECT_FALSE(world.scheduler.cancel("j1"));
  }
}

TEST(Scheduler, WhatWentWrongIsSummedOverTheResultsOfAFrame) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const Frame& frame = world.scheduler.find("j1")->frames[0];
  std::vector<TaskRef> done;
  for (int i = 0; i < 2; ++i) {
    const Grant grant = world.sync("w1").at(0);
    Offer offer{grant.lease_id, to_string(grant.task), grant.epoch, {grant.result_key, std::string(64, 'd'), 100, {}, {1, 2, 3, 4}}};
    world.scheduler.offer(offer, "w1", true, world.now);
    world.held["w1"].erase(grant.lease_id);
    world.settle();
    done.push_back(grant.task);
  }
  EXPECT_EQ(frame.health, (HealthCounts{2, 4, 6, 8}));
  world.scheduler.reopen(done[0], world.settled.at(to_string(done[0])).result, "damaged");
  EXPECT_EQ(frame.health, (HealthCounts{1, 2, 3, 4})) << "a result that is thrown away takes its counts along";
}

TEST(Scheduler, ExtendingRendersOnlyTheDifference) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  world.finish_everything("w1");
  world.scheduler.frame_assembled("j1", 0, std::string(64, 'e'), 1, {});
  EXPECT_TRUE(world.scheduler.extend("j1", 128));
  world.commits.clear();
  world.finish_everything("w1");
  EXPECT_EQ(world.commits.size(), 16u);
  for (const TaskRef& task : world.commits)
    EXPECT_EQ(world.scheduler.find("j1")->frames[0].tasks.area(task.number).range, (SampleRange{64, 128}));
}

TEST(Scheduler, F10NothingIsLeasedWhileTheDiskIsFullAndItGoesOnByItself) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  world.scheduler.hold_leasing("disk full");
  EXPECT_TRUE(world.sync("w1").empty());
  world.scheduler.hold_leasing("");
  EXPECT_FALSE(world.sync("w1").empty());
}

TEST(Scheduler, ADrainingWorkerGetsNothingAndItsReleasesAreNoFailures) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const Grant grant = world.sync("w1").at(0);
  world.held["w1"].erase(grant.lease_id);
  WorkerReport r = world.report("w1");
  r.draining = true;
  r.releases.push_back({grant.lease_id, grant.epoch});
  EXPECT_TRUE(world.sync("w1", r).empty());
  EXPECT_EQ(world.events[EventKind::TaskFailed], 0);
  EXPECT_EQ(world.sync("w2").at(0).task, grant.task);
}

TEST(Scheduler, ARestartKeepsSettledTasksSplitsAndLeases) {
  FrameRow row;
  row.pinned = true;
  row.build = "build";
  row.arithmetic_class = "class";
  SettledTask done, split;
  done.number = 0;
  done.result.digest = std::string(64, 'd');
  split.number = 1;
  split.state = TaskState::Split;
  split.first_part = 16;
  SchedulerWorld world(2);
  std::vector<LeaseRow> leases(1);
  leases[0].lease_id = "L1-7";
  leases[0].task = TaskRef{"j1", 0, 2};
  leases[0].worker_id = "w1";
  leases[0].epoch = (uint64_t{1} << 32) + 7;
  world.scheduler.recover_job(restored(test_job("j1"), {}, {row}, {done, split}), leases, world.now);
  const Frame& frame = world.scheduler.find("j1")->frames[0];
  EXPECT_EQ(frame.tasks.size(), 20);
  EXPECT_EQ(frame.done, 1);
  EXPECT_EQ(frame.unsettled, 18);
  EXPECT_EQ(world.scheduler.live_leases(), 1u);
  // The worker still holds its lease, and another whose row was lost in the crash: both go on.
  WorkerReport r = world.report("w1");
  r.leases.push_back({"L1-7", "j1.0.2", (uint64_t{1} << 32) + 7, 4, 5, 0});
  r.leases.push_back({"L1-9", "j1.0.5", (uint64_t{1} << 32) + 9, 4, 5, 0});
  EXPECT_TRUE(world.sync("w1", r).empty());
  EXPECT_TRUE(world.cancelled.empty());
  EXPECT_EQ(world.scheduler.live_leases(), 2u);
  for (const Grant& grant : world.sync("w2")) {
    EXPECT_NE(grant.task.number, 2);
    EXPECT_NE(grant.task.number, 5);
    EXPECT_GT(grant.epoch, (uint64_t{1} << 32) + 9);
  }
}

TEST(Scheduler, F03_ACancelThatACrashCutInTwoIsFinishedAtTheStart) {
  // The row of one frame was written, those of the other and of the job were not.
  JobSpec spec = test_job("j1");
  spec.frames.push_back(spec.frames[0]);
  spec.frames[1].header.frame = 2;
  FrameRow cancelled, running;
  cancelled.state = FrameState::Cancelled;
  running.pinned = true;
  JobRow row;
  row.state = JobState::Running;
  std::vector<LeaseRow> leases(1);
  leases[0].lease_id = "L1-7";
  leases[0].task = TaskRef{"j1", 1, 0};
  leases[0].worker_id = "w1";
  leases[0].epoch = 7;
  SchedulerWorld world(2);
  world.scheduler.recover_job(restored(spec, row, {cancelled, running}, {}), leases, world.now);
  const Job* job = world.scheduler.find("j1");
  ASSERT_NE(job, nullptr);
  EXPECT_EQ(job->row.state, JobState::Cancelled);
  for (const Frame& frame : job->frames) EXPECT_EQ(frame.row.state, FrameState::Cancelled);
  EXPECT_EQ(world.scheduler.live_leases(), 0u);
  const std::vector<Action> actions = world.scheduler.take_actions();
  EXPECT_TRUE(std::any_of(actions.begin(), actions.end(), [](const Action& a) { return std::holds_alternative<action::DropLease>(a); }));
}

TEST(TaskGrid, TasksPartitionPixelsTimesSamplesHoweverTheyAreSplit) {
  const PixelRect bounds{5, 9, 201, 130};
  std::vector<TaskArea> open = task_list(bounds, 64, {0, 100}, 16), leaves;
  EXPECT_EQ(static_cast<int64_t>(open.size()), task_count(bounds, 64, {0, 100}, 16));
  for (size_t i = 0; !open.empty(); ++i) {
    const TaskArea task = open.back();
    open.pop_back();
    EXPECT_TRUE(is_dyadic(task.range));
    const std::vector<TaskArea> parts = i % 3 == 0 ? split_task(task) : std::vector<TaskArea>{};
    if (parts.empty()) leaves.push_back(task);
    open.insert(open.end(), parts.begin(), parts.end());
  }
  int64_t samples = 0;
  for (size_t i = 0; i < leaves.size(); ++i) {
    samples += leaves[i].samples();
    for (size_t j = 0; j < i; ++j) EXPECT_FALSE(leaves[i].rect.overlaps(leaves[j].rect) && leaves[i].range.overlaps(leaves[j].range));
  }
  EXPECT_EQ(samples, bounds.area() * 100);
}

TEST(TaskId, RoundTripsAndRefusesEverythingElse) {
  const TaskRef task{"j12ab", 3, 77};
  EXPECT_EQ(to_string(task), "j12ab.3.77");
  EXPECT_EQ(parse_task_id(to_string(task)), task);
  for (const char* bad : {"", ".", "j.1", "j..1", "j.1.", "j.-1.2", "j.1.2x", ".1.2", "j.99999999999999999999.1"})
    EXPECT_FALSE(parse_task_id(bad)) << bad;
}

}  // namespace
}  // namespace woodcock::coordinator
