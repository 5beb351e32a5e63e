// What jobs ask of workers and of each other, and how users share: the scheduler alone, with time that is told.
#include "coordinator/policy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <set>
#include <stdexcept>

#include "rpc/error.h"
#include "tests/service/scheduler_fixture.h"

namespace woodcock::coordinator {
namespace {

using ::testing::HasSubstr;

constexpr int64_t kGib = int64_t{1} << 30;

std::string numbered(std::string name, int number) { return name.append(std::to_string(number)); }

JobSpec job_of(const std::string& id, const std::function<void(JobPolicy&)>& adjust, int priority = 0) {
  JobSpec job = test_job(id, priority);
  adjust(job.policy);
  job.policy.waits_for = job.policy.after;
  return job;
}

WorkerReport worker_report(SchedulerWorld& world, const std::string& worker, const std::vector<std::string>& tags, int64_t memory = 0,
                           int slots = 1) {
  WorkerReport report = world.report(worker);
  report.tags = tags;
  report.memory = memory;
  report.slots = slots;
  return report;
}

std::string reason(const SchedulerWorld& world, const std::string& job) {
  const Job& found = *world.scheduler.find(job);
  return world.scheduler.waiting_reason(found, found.frames[0], world.now);
}

/// Ends the job with all its frames done.
void complete(SchedulerWorld& world, const std::string& job) {
  world.finish_everything("w1");
  world.scheduler.frame_assembled(job, 0, std::string(64, 'e'), 1, {});
  world.settle();
  ASSERT_EQ(world.scheduler.find(job)->row.state, JobState::Done);
}

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

// --- jobs after jobs ---------------------------------------------------------------------------------------------

TEST(Policy, AJobBeginsWhenAllThatItWaitsForAreDone) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("a"));
  world.scheduler.add_job(test_job("b"));
  world.scheduler.add_job(job_of(
      "c",
      [](JobPolicy& p) {
        p.after = {"a", "b"};
      },
      50));
  EXPECT_EQ(reason(world, "c"), "job a and 1 other, after which it begins, are not done yet");
  world.finish_everything("w1");
  EXPECT_EQ(world.commits.size(), 32u);
  for (const TaskRef& task : world.commits) EXPECT_NE(task.job, "c") << "its priority is higher, and it waits all the same";
  world.scheduler.frame_assembled("b", 0, std::string(64, 'e'), 1, {});
  world.settle();
  EXPECT_EQ(reason(world, "c"), "job a, after which it begins, is not done yet");
  EXPECT_TRUE(world.sync("w1").empty());
  world.scheduler.frame_assembled("a", 0, std::string(64, 'e'), 1, {});
  world.settle();
  EXPECT_EQ(reason(world, "c"), "its workers have other work; its turn comes");
  EXPECT_TRUE(world.scheduler.find("c")->spec.policy.waits_for.empty());
  EXPECT_EQ(world.scheduler.find("c")->spec.policy.after.size(), 2u) << "what was asked for stays";
  EXPECT_EQ(world.sync("w1").size(), 2u);
}

TEST(Policy, AJobFailsByNameWithWhatItWaitsForAndSoDoThoseBehindIt) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("a"));
  world.scheduler.add_job(test_job("other"));
  world.scheduler.add_job(job_of("b", [](JobPolicy& p) { p.after = {"a", "other"}; }));
  world.scheduler.add_job(job_of("c", [](JobPolicy& p) { p.after = {"b"}; }));
  world.scheduler.cancel("a");
  world.settle();
  for (const auto& [job, why] : std::map<std::string, std::string>{{"b", "job a, after which this one was to begin, is cancelled"},
                                                                   {"c", "job b, after which this one was to begin, is failed"}}) {
    EXPECT_EQ(world.scheduler.find(job)->row.state, JobState::Failed);
    EXPECT_EQ(world.scheduler.find(job)->row.reason, why);
    EXPECT_EQ(world.scheduler.find(job)->frames[0].row.state, FrameState::Failed);
  }
  EXPECT_FALSE(world.scheduler.extend("b", 128)) << "it cannot be brought back, only submitted again";
  // The other one that it waited for ends later, and nobody is there any more to be told.
  world.scheduler.cancel("other");
  world.settle();
  EXPECT_EQ(world.scheduler.find("b")->row.reason, "job a, after which this one was to begin, is cancelled");
}

TEST(Policy, AJobThatIsPartialIsNotDone) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("a"));
  world.scheduler.add_job(job_of("b", [](JobPolicy& p) { p.after = {"a"}; }));
  world.finish_everything("w1");
  FrameStatistics statistics;
  statistics.missing_pixels = 1;
  world.scheduler.frame_assembled("a", 0, std::string(64, 'e'), 1, statistics);
  world.settle();
  EXPECT_EQ(world.scheduler.find("b")->row.reason, "job a, after which this one was to begin, is partial");
}

TEST(Policy, WhatAJobWaitsForIsAskedOfTheDatabaseWhereItIsNotInMemory) {
  const std::vector<std::pair<std::optional<JobState>, std::string>> cases{
      {JobState::Done, "its workers have other work; its turn comes"},
      {JobState::Running, "job a, after which it begins, is not done yet"},
      {JobState::Failed, "job a, after which this one was to begin, is failed"},
      {std::nullopt, "job a, after which this one was to begin, does not exist any more"}};
  for (const auto& [state, expected] : cases) {
    SchedulerWorld world;
    world.sync("w1");
    world.scheduler.add_job(job_of("b", [](JobPolicy& p) { p.after = {"a"}; }));
    int asked = 0;
    for (const Action& any : world.scheduler.take_actions())
      if (const auto* find = std::get_if<action::FindJob>(&any)) {
        EXPECT_EQ(find->job, "a");
        ++asked;
      }
    EXPECT_EQ(asked, 1);
    EXPECT_TRUE(world.sync("w1").empty());
    world.scheduler.job_found("a", state);
    world.settle();
    const Job& job = *world.scheduler.find("b");
    EXPECT_EQ(has_ended(job.row.state) ? job.row.reason : reason(world, "b"), expected);
    EXPECT_EQ(world.sync("w1").size(), state == JobState::Done ? 2u : 0u);
  }
}

TEST(Policy, AJobThatWaitsCanBeCancelledAndNothingIsLeftOfIt) {
  SchedulerWorld world;
  world.scheduler.add_job(test_job("a"));
  world.scheduler.add_job(job_of("b", [](JobPolicy& p) { p.after = {"a"}; }));
  EXPECT_TRUE(world.scheduler.cancel("b"));
  world.settle();
  EXPECT_TRUE(world.scheduler.release("b").has_value());
  complete(world, "a");
  EXPECT_EQ(world.scheduler.find("b"), nullptr);
}

// --- users -------------------------------------------------------------------------------------------------------

/// How many of the next `tasks` tasks each job gets on one worker.
std::map<std::string, int> served(SchedulerWorld& world, int tasks) {
  std::map<std::string, int> count;
  for (int i = 0; i < tasks; ++i) {
    world.now += kSecond;
    world.sync("w1");
    EXPECT_FALSE(world.held["w1"].empty());
    if (world.held["w1"].empty()) break;
    // In the order in which they were granted, which is not that of their ids as texts.
    const Grant grant = std::min_element(world.held["w1"].begin(), world.held["w1"].end(), [](const auto& a, const auto& b) {
                          return a.second.epoch < b.second.epoch;
                        })->second;
    ++count[grant.task.job];
    world.finish("w1", grant);
  }
  return count;
}

TEST(Policy, UsersShareAPriorityHoweverManyJobsEachHas) {
  SchedulerWorld world;
  for (const std::string id : {"a1", "a2", "a3"}) world.scheduler.add_job(job_of(id, [](JobPolicy& p) { p.user = "ada"; }));
  world.scheduler.add_job(job_of("b1", [](JobPolicy& p) { p.user = "bob"; }));
  std::map<std::string, int> count = served(world, 24);
  EXPECT_NEAR(count["b1"], 12, 1);
  for (const std::string id : {"a1", "a2", "a3"}) EXPECT_NEAR(count[id], 4, 1) << id;
}

TEST(Policy, AUserWithALargerShareHasMoreUnderWay) {
  SchedulerOptions options;
  options.shares = {{"ada", 3}};
  SchedulerWorld world;
  world.scheduler = Scheduler(options);
  world.scheduler.add_job(job_of("a", [](JobPolicy& p) { p.user = "ada"; }));
  world.scheduler.add_job(job_of("b", [](JobPolicy& p) { p.user = "bob"; }));
  std::map<std::string, int> held;
  for (int i = 0; i < 8; ++i)
    for (const Grant& grant : world.sync(numbered("w", i))) ++held[grant.task.job];
  EXPECT_EQ(held["a"], 12);
  EXPECT_EQ(held["b"], 4);
}

TEST(Policy, WorkIsCountedInThreadsThatRenderForAUser) {
  SchedulerWorld world;
  world.scheduler.add_job(job_of("a", [](JobPolicy& p) { p.user = "ada"; }));
  WorkerReport large = world.report("large");
  large.threads = 6;
  ASSERT_EQ(world.sync("large", large).size(), 2u);
  world.scheduler.add_job(job_of("b", [](JobPolicy& p) { p.user = "bob"; }));
  std::map<std::string, int> held;
  for (int i = 0; i < 6; ++i)
    for (const Grant& grant : world.sync(numbered("w", i))) ++held[grant.task.job];
  EXPECT_EQ(held["b"], 12) << "twelve threads for each";
  EXPECT_EQ(held["a"], 0);
}

TEST(Policy, AmongTheJobsOfAUserWhichComesLaterOrWasPausedDoesNotCatchUp) {
  SchedulerWorld world;
  for (const std::string id : {"a", "b"}) {
    JobSpec job = job_of(id, [](JobPolicy& p) { p.user = "ada"; });
    job.frames[0].header = test_header(512, 512);
    world.scheduler.add_job(job);
    if (id == "a") served(world, 40);
  }
  EXPECT_NEAR(served(world, 20)["b"], 10, 2);
  world.scheduler.set_paused("b", true);
  served(world, 40);
  world.scheduler.set_paused("b", false);
  EXPECT_NEAR(served(world, 20)["b"], 10, 2);
}

TEST(RunQueue, AWorkerIsComparedWithDemandsAndNotWithJobs) {
  RunQueue queue;
  for (int i = 0; i < 10'000; ++i) {
    const std::string id = numbered("j", i);
    queue.add(id, i % 5, numbered("user", i % 7), i % 2 == 0 ? Demands{{"big"}, 0} : Demands{{"gpu"}, 0});
    queue.set_queued(id, true);
  }
  queue.add("plain", 0, "ada", {});
  queue.set_queued("plain", true);
  int compared = 0;
  std::vector<std::string> seen;
  const auto meets = [&](const Demands& demands) {
    ++compared;
    return demands.tags.empty();
  };
  queue.visit(meets, {}, [&](const std::string& id) {
    seen.push_back(id);
    return false;
  });
  EXPECT_EQ(compared, 3);
  EXPECT_EQ(seen, std::vector<std::string>{"plain"});
}

TEST(RunQueue, GivesAllTurnsInOneOrderWhateverTheJobsDemand) {
  RunQueue queue({{"ada", 2}});
  const auto add = [&](const std::string& id, int priority, const std::string& user, const std::string& tag) {
    queue.add(id, priority, user, {{tag}, 0});
    queue.set_queued(id, true);
  };
  add("a1", 0, "ada", "x");
  add("a2", 0, "ada", "y");
  add("b1", 0, "bob", "x");
  add("b2", 0, "bob", "z");
  add("urgent", 5, "eve", "z");
  add("full", 0, "eve", "x");
  queue.set_queued("full", false);
  queue.lease_begins("a1", 3, 100);
  queue.lease_begins("b1", 2, 100);
  queue.lease_begins("full", 1, 100);
  const auto order = [&](const std::vector<std::string>& others) {
    std::vector<std::string> seen;
    queue.visit([](const Demands&) { return true; }, others,
                [&](const std::string& id) {
                  seen.push_back(id);
                  return false;
                });
    return seen;
  };
  // 3 threads for two shares are less than 2 for one.
  EXPECT_EQ(order({}), (std::vector<std::string>{"urgent", "a2", "a1", "b2", "b1"}));
  EXPECT_EQ(order({"full"}), (std::vector<std::string>{"urgent", "full", "a2", "a1", "b2", "b1"}));
  queue.lease_ends("b1", 2);
  EXPECT_EQ(order({}), (std::vector<std::string>{"urgent", "b2", "b1", "a2", "a1"}));
  for (const std::string id : {"b1", "b2"}) queue.set_queued(id, false);
  EXPECT_EQ(order({}), (std::vector<std::string>{"urgent", "a2", "a1"}));
  queue.remove("b1");
  queue.remove("b2");
  add("b3", 0, "bob", "x");
  queue.lease_ends("a1", 3);
  EXPECT_EQ(order({}), (std::vector<std::string>{"urgent", "a2", "a1", "b3"})) << "who comes anew waits for those who are here";
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
