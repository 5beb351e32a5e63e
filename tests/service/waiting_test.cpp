// No silence: every frame that has not ended is being rendered, or says what it waits for by one reason of a closed list.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <deque>
#include <fstream>
#include <random>

#include "coordinator/job_view.h"
#include "tests/service/scheduler_fixture.h"

namespace woodcock::coordinator {
namespace {

WaitingReason reason(const SchedulerWorld& world, const std::string& job = "j1") {
  const Job& found = *world.scheduler.find(job);
  const Waiting waiting = world.scheduler.waiting(found, found.frames[0], world.now);
  EXPECT_EQ(waiting.text.empty(), waiting.reason == WaitingReason::None);
  return waiting.reason;
}

TEST(Waiting, EachReasonIsGivenWhereItHolds) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  EXPECT_EQ(reason(world), WaitingReason::NoWorker);
  WorkerReport draining = world.report("w1");
  draining.draining = true;
  world.sync("w1", draining);
  EXPECT_EQ(reason(world), WaitingReason::WorkersUnavailable);
  world.sync("w1");
  EXPECT_EQ(reason(world), WaitingReason::None) << "it has leases";
  world.scheduler.add_job(test_job("j2"));
  EXPECT_EQ(reason(world, "j2"), WaitingReason::WorkersBusy);
  world.scheduler.set_paused("j2", true);
  EXPECT_EQ(reason(world, "j2"), WaitingReason::Paused);
  world.scheduler.set_paused("j2", false);
  world.scheduler.hold_leasing("the coordinator's disk is full");
  EXPECT_EQ(reason(world, "j2"), WaitingReason::DiskFull);
  EXPECT_EQ(reason(world, "j1"), WaitingReason::DiskFull) << "what is leased ends, nothing follows";
  world.scheduler.hold_leasing("");
  world.scheduler.scene_lost(std::string(64, 'c'), "a file is missing");
  EXPECT_EQ(reason(world, "j2"), WaitingReason::SceneMissing);
  world.scheduler.scene_found(std::string(64, 'c'));
  world.finish_everything("w1");
  EXPECT_EQ(reason(world), WaitingReason::Merging);
  EXPECT_EQ(reason(world, "j2"), WaitingReason::Merging);
  world.scheduler.cancel("j1");
  EXPECT_EQ(reason(world), WaitingReason::None) << "it has ended";
}

TEST(Waiting, WorkersOfABuildThatDrainAreNotTakenForNone) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  world.sync("w1");
  WorkerReport report = world.report("w1");
  report.draining = true;
  for (const auto& [id, grant] : world.held["w1"]) report.releases.push_back({id, grant.epoch});
  report.leases.clear();
  world.held["w1"].clear();
  world.sync("w1", report);
  EXPECT_EQ(reason(world), WaitingReason::WorkersUnavailable);
  world.now += 120 * kSecond;
  WorkerReport other = world.report("w2");
  other.build = "another";
  world.sync("w2", other);
  EXPECT_EQ(reason(world), WaitingReason::NoFittingWorker);
}

TEST(Waiting, WhatLastsIsLoggedOnceAndAgainAfterItWentOn) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("j1"));
  const auto tick = [&](int seconds) {
    for (int i = 0; i < seconds; ++i) {
      world.now += kSecond;
      world.scheduler.tick(world.now);
      world.settle();
    }
  };
  tick(5);
  EXPECT_EQ(world.events[EventKind::Waiting], 0) << "a moment is no wait";
  tick(60);
  EXPECT_EQ(world.events[EventKind::Waiting], 1);
  world.sync("w1");
  tick(3);
  EXPECT_EQ(world.events[EventKind::Waiting], 1);
  world.scheduler.set_paused("j1", true);
  tick(60);
  EXPECT_EQ(world.events[EventKind::Waiting], 2);
}

TEST(Waiting, WorkersThatLeftAreForgottenAfterATime) {
  SchedulerWorld world;
  LeaseRow lease;
  lease.lease_id = "L0-1";  // of an earlier leader
  lease.task = TaskRef{"j1", 0, 0};
  lease.worker_id = "never-seen";
  lease.epoch = 1;
  world.scheduler.recover_job(restored(test_job("j1"), {}, {FrameRow{}}, {}), {lease}, world.now);
  world.sync("w1");
  world.held["w1"].clear();
  const auto remembers = [&] {
    // One that is remembered refuses what an older incarnation says.
    WorkerReport old = world.report("w1");
    old.incarnation = 0;
    old.sequence = 1;
    return world.scheduler.report(old, world.now) != ReportStatus::Accepted;
  };
  for (int hour = 0; hour < 23; ++hour) {
    world.now += 3600 * kSecond;
    world.scheduler.tick(world.now);
  }
  EXPECT_EQ(world.scheduler.live_leases(), 0u);
  EXPECT_EQ(world.scheduler.known_workers(), 1u) << "who had only a lease of before is not kept";
  EXPECT_TRUE(remembers());
  world.now += 2 * 3600 * kSecond;
  world.scheduler.tick(world.now);
  EXPECT_EQ(world.scheduler.known_workers(), 0u);
  EXPECT_FALSE(remembers());
}

/// Workers come, go, drain, fail and finish; pins, look-ups and commits are answered late; users pause, extend and cancel.
class RandomSchedule : public ::testing::TestWithParam<unsigned> {
 protected:
  void check(const Scheduler& scheduler, Time now) {
    for (const auto& [id, job] : scheduler.jobs()) {
      const std::vector<Waiting> waits = scheduler.waiting_of_frames(job, now);
      ASSERT_EQ(waits.size(), job.frames.size());
      for (size_t i = 0; i < waits.size(); ++i) {
        const Frame& frame = job.frames[i];
        bool leased = false;
        for (const auto& [number, task] : frame.active) leased = leased || !task.leases.empty();
        const bool ended = has_ended(job.row.state) || has_ended(frame.row.state);
        ASSERT_TRUE(ended || leased || waits[i].reason != WaitingReason::None) << id << " frame " << i << " is silent";
        ASSERT_TRUE(!ended || waits[i].reason == WaitingReason::None);
        ASSERT_EQ(waits[i].text.empty(), waits[i].reason == WaitingReason::None);
        ASSERT_EQ(scheduler.waiting_reason(job, frame, now), waits[i].text) << "one by one or all at once";
        ++seen_[waits[i].reason];
      }
    }
  }
  std::map<WaitingReason, int> seen_;
};

TEST_P(RandomSchedule, EveryFrameThatHasNotEndedIsLeasedOrHasAReason) {
  std::mt19937 random(GetParam());
  const auto below = [&](size_t n) { return static_cast<size_t>(random() % n); };
  SchedulerWorld world;
  std::deque<Action> unanswered;
  int jobs = 0;
  for (int step = 0; step < 600; ++step) {
    world.now += static_cast<Time>(below(4)) * kSecond;
    const std::string worker = fmt::format("w{}", below(3));
    const std::string job = fmt::format("j{}", below(static_cast<size_t>(jobs) + 1));
    switch (below(12)) {
      case 0:
        if (jobs < 6) {
          JobSpec spec = test_job(fmt::format("j{}", jobs++), static_cast<int>(below(2)), 16);
          spec.frames.push_back(spec.frames[0]);
          spec.frames[1].header.frame = 1;
          world.scheduler.add_job(spec);
        }
        break;
      case 1:
        world.scheduler.set_paused(job, below(2) == 0);
        break;
      case 2:
        if (below(5) == 0) world.scheduler.cancel(job);
        break;
      case 3:
        world.scheduler.hold_leasing(below(4) == 0 ? "full" : "");
        break;
      case 4:
        if (below(10) == 0) world.now += 100 * kSecond;
        world.scheduler.tick(world.now);
        break;
      default: {
        WorkerReport report = world.report(worker);
        report.draining = below(8) == 0;
        if (below(20) == 0) report.build = "another";
        auto& held = world.held[worker];
        if (!held.empty() && below(2) == 0) {
          const Grant grant = held.begin()->second;
          held.erase(held.begin());
          std::erase_if(report.leases, [&](const LeaseReport& lease) { return lease.lease_id == grant.lease_id; });
          if (below(3) == 0) {
            report.failures.push_back({grant.lease_id, to_string(grant.task), grant.epoch, FailureCause::Crash, "it crashed", ""});
          } else {
            report.offered_leases.push_back(grant.lease_id);
            world.scheduler.offer({grant.lease_id, to_string(grant.task), grant.epoch, {grant.result_key, std::string(64, 'd'), 1, {}, {}}},
                                  worker, true, world.now);
          }
        }
        world.scheduler.report(report, world.now);
        const Answer answer = world.scheduler.answer(worker, world.now);
        for (const auto& [id, why] : answer.cancellations) held.erase(id);
        for (const Grant& grant : answer.grants) held.emplace(grant.lease_id, grant);
      }
    }
    for (Action& action : world.scheduler.take_actions()) unanswered.push_back(std::move(action));
    check(world.scheduler, world.now);
    if (HasFatalFailure()) return;
    for (size_t i = below(4); i > 0 && !unanswered.empty(); --i) {
      const Action action = std::move(unanswered.front());
      unanswered.pop_front();
      if (const auto* pin = std::get_if<action::PinFrame>(&action)) world.scheduler.frame_pinned(*pin);
      if (const auto* find = std::get_if<action::FindResults>(&action)) world.scheduler.results_found(*find, {});
      if (const auto* commit = std::get_if<action::CommitTask>(&action)) world.scheduler.committed(*commit, world.now);
      if (const auto* merge = std::get_if<action::AssembleFrame>(&action))
        world.scheduler.frame_assembled(merge->job, merge->frame, std::string(64, 'i'), 1, {});
    }
    check(world.scheduler, world.now);
    if (HasFatalFailure()) return;
  }
  EXPECT_GE(seen_.size(), 6u) << "too little happened";
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomSchedule, ::testing::Range(1u, 41u));

TEST(Waiting, TheListIsDocumented) {
  std::ifstream in(std::string(WOODCOCK_SOURCE_DIR) + "/docs/operations.md");
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  const auto* reasons = v1::WaitingReason_descriptor();
  for (int i = 0; i < reasons->value_count(); ++i) {
    if (reasons->value(i)->number() == 0) continue;
    std::string name = reasons->value(i)->name().substr(std::string("WAITING_REASON_").size());
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    EXPECT_NE(text.find("| `" + name + "` |"), std::string::npos) << name;
  }
  EXPECT_EQ(reasons->value_count(), static_cast<int>(WaitingReason::MaxWorkers) + 1) << "both lists have the same";
}

TEST(Waiting, F03_AfterARestartAFrameIsCalledWhatItIs) {
  SchedulerWorld world(2);
  JobSpec spec = test_job("j1");
  for (uint64_t i = 1; i < 3; ++i) {
    spec.frames.push_back(spec.frames[0]);
    spec.frames[i].header.frame = i;
  }
  FrameRow begun;
  begun.pinned = true;
  begun.build = "build";
  begun.arithmetic_class = "class";
  LeaseRow lease;
  lease.lease_id = "L1-7";
  lease.task = TaskRef{"j1", 0, 2};
  lease.worker_id = "w1";
  lease.epoch = (uint64_t{1} << 32) + 7;
  // The first has a lease, the second had some, the third never began.
  world.scheduler.recover_job(restored(spec, {}, {begun, begun, {}}, {}), {lease}, world.now);
  const Job& job = *world.scheduler.find("j1");
  EXPECT_EQ(job.row.state, JobState::Running);
  EXPECT_EQ(job.frames[0].row.state, FrameState::Running);
  EXPECT_EQ(job.frames[1].row.state, FrameState::Running);
  EXPECT_EQ(job.frames[2].row.state, FrameState::Queued);
}

}  // namespace
}  // namespace woodcock::coordinator
