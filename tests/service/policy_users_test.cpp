// How users share the workers, and the order in which jobs have their turns: the scheduler and its queue alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "coordinator/run_queue.h"
#include "tests/service/policy_fixture.h"

namespace woodcock::coordinator {
namespace {

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

}  // namespace
}  // namespace woodcock::coordinator
