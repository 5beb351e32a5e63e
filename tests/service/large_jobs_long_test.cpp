// F32, the figures: lists during the submit of a million tasks; from a start to the first lease beside a million tasks that ended.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "tests/service/large_jobs.h"

namespace woodcock::coordinator {
namespace {

using std::chrono::steady_clock;

TEST(LargeJobsLong, F32_ListsTakeLessThanATenthOfASecondDuringASubmitOfAMillionTasks) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  for (int i = 0; i < 20; ++i) world.coordinator->submit(world.request(fmt::format("small{}", i)));
  for (const uint64_t frames : {1, 10'000}) {
    std::vector<double> slowest;
    for (int round = 0; round < 3; ++round) {
      const std::string name = fmt::format("r{}-{}", frames, round);
      const v1::SubmitJobRequest request = frames == 1 ? million_tasks(world, name) : ten_thousand_frames(world, name);
      std::string id;
      slowest.push_back(slowest_list_during(world, [&] { id = world.coordinator->submit(request).job_id(); }));
      EXPECT_EQ(world.coordinator->job(id).progress().tasks_total(), 1'000'000);
      world.coordinator->remove(id, true);
      world.coordinator->clean_up();
    }
    std::sort(slowest.begin(), slowest.end());
    std::printf("slowest list during a submit of a million tasks in %llu frames: %.0f, %.0f and %.0f ms\n",
                static_cast<unsigned long long>(frames), 1000 * slowest[0], 1000 * slowest[1], 1000 * slowest[2]);
    EXPECT_LT(slowest[1], 0.1);
  }
}

/// Settles the first `count` tasks of each of the first `frames` frames, each with a result of its own, in one transaction.
void settle_many(const std::string& dir, const std::string& job, int frames, int64_t count) {
  soci::session sql(soci::sqlite3, "db=" + dir + "/woodcock.sqlite timeout=5");
  soci::transaction transaction(sql);
  const std::string numbers = fmt::format("with recursive n(i) as (select 0 union all select i + 1 from n where i < {})", count - 1);
  for (int frame = 0; frame < frames; ++frame) {
    const std::string key =
        fmt::format("printf('%064x', {} + i)", frame * 1'000'003LL + static_cast<long long>(std::hash<std::string>()(job) >> 8));
    sql << numbers + fmt::format(
                         " insert into settled (job_id, frame, number, state, result_key, digest, bytes, cpu_ns, wall_ns, samples,"
                         " first_part, error, worker_id) select '{}', {}, i, 2, {}, {}, 4096, 30000000, 40000000, 1024, 0, '', 'w1'"
                         " from n",
                         job, frame, key, key);
    sql << numbers + fmt::format(
                         " insert into results (result_key, digest, bytes, cpu_ns, wall_ns, samples, worker_id, uses)"
                         " select {}, {}, 4096, 30000000, 40000000, 1024, 'w1', 1 from n",
                         key, key);
  }
  transaction.commit();
}

/// How long a coordinator takes from its start until a worker has its first lease, seconds.
double seconds_to_first_lease(CoordinatorWorld& world) {
  const auto begin = steady_clock::now();
  world.start();
  ++world.incarnation;
  const double started = seconds_since(begin);
  while (world.sync(world.sync_request("w1")).second.grants_size() == 0)
    if (seconds_since(begin) > 60) {
      ADD_FAILURE() << "no lease within a minute";
      break;
    }
  const double leased = seconds_since(begin);
  std::printf("the coordinator is there after %.2f s, the first lease is granted after %.2f s\n", started, leased);
  return leased;
}

TEST(LargeJobsLong, F32_AStartLeasesWithinTwoSecondsBesideAMillionTasksOfJobsThatEnded) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  std::vector<std::string> ended;
  for (int i = 0; i < 100; ++i) {
    v1::SubmitJobRequest request = ten_thousand_frames(world, fmt::format("ended{}", i), 100);
    ended.push_back(world.coordinator->submit(request).job_id());
    world.coordinator->cancel(ended.back());
  }
  // Ten that are open, of ten frames each: 10 000 tasks.
  for (int i = 0; i < 10; ++i) world.coordinator->submit(ten_thousand_frames(world, fmt::format("open{}", i), 10));
  world.stop();
  for (const std::string& id : ended) settle_many(folder.path(), id, 100, 100);
  EXPECT_LT(seconds_to_first_lease(world), 2);
}

TEST(LargeJobsLong, F32_AStartLeasesWithinTwoSecondsWhereAJobHas990000TasksDoneAnd10000Open) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = world.coordinator->submit(million_tasks(world, "r1")).job_id();
  // Its frame is pinned.
  for (int i = 0; i < 20 && world.sync(world.sync_request("w1")).second.grants_size() == 0; ++i) {
  }
  world.stop();
  settle_many(folder.path(), id, 1, 990'000);
  const double seconds = seconds_to_first_lease(world);
  EXPECT_EQ(world.coordinator->job(id).progress().tasks_done(), 990'000);
  EXPECT_LT(seconds, 2);
}

}  // namespace
}  // namespace woodcock::coordinator
