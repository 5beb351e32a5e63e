// Jobs that begin after other jobs: the scheduler alone.
#include <gtest/gtest.h>

#include <map>
#include <optional>

#include "tests/service/policy_fixture.h"

namespace woodcock::coordinator {
namespace {

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

}  // namespace
}  // namespace woodcock::coordinator
