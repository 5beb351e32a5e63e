// What a quote makes of the costs that workers reported.
#include "client/worker_times.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace woodcock {
namespace {

using ::testing::HasSubstr;

v1::WorkerStatus worker(const std::string& id, uint32_t slots, uint32_t threads) {
  v1::WorkerStatus status;
  status.set_worker_id(id);
  status.set_slots(slots);
  status.set_threads(threads);
  return status;
}

/// `count` results of 1000 camera paths each, which took `microseconds` a path; every second one `scatter` more, the others less.
void add_results(std::vector<v1::TaskResult>& results, const std::string& id, int count, double microseconds, double scatter = 0,
                 double wall_of_cpu = 1) {
  for (int i = 0; i < count; ++i) {
    const double ns = 1e6 * microseconds * (1 + (i % 2 == 0 ? scatter : -scatter));
    v1::TaskResult result;
    result.set_worker_id(id);
    result.set_samples(1000);
    result.set_cpu_ns(static_cast<int64_t>(ns));
    result.set_wall_ns(static_cast<int64_t>(ns * wall_of_cpu));
    results.push_back(result);
  }
}

WorkerTimes judged(const std::vector<v1::WorkerStatus>& present, const std::vector<v1::TaskResult>& results) {
  return judge_workers(by_worker(present, results));
}

TEST(WorkerTimes, EqualWorkersCostTheMeanAndAllTheirThreadsCount) {
  std::vector<v1::TaskResult> results;
  add_results(results, "a", 10, 5, 0.2);
  add_results(results, "b", 6, 5, 0.2);
  const WorkerTimes times = judged({worker("a", 2, 4), worker("b", 1, 3)}, results);
  EXPECT_NEAR(times.seconds_per_path, 5e-6, 1e-15);
  EXPECT_NEAR(times.cpu_seconds, 16 * 5e-3, 1e-12);
  EXPECT_EQ(times.workers, 2);
  EXPECT_EQ(times.threads, 11);
  EXPECT_NEAR(times.deviation, 0, 1e-6) << "the scatter is that of the picture, all of which was measured";
  EXPECT_EQ(times.doubt, "");
}

TEST(WorkerTimes, WorkersThatDifferCountByTheShareTheyTakeAndMakeItUncertain) {
  std::vector<v1::TaskResult> results;
  add_results(results, "fast", 8, 4, 0.05);
  add_results(results, "slow", 8, 12, 0.05);
  const WorkerTimes times = judged({worker("fast", 1, 1), worker("slow", 1, 1)}, results);
  // In 12 µs the fast one renders 3 paths and the slow one 1: 4 paths for 24 µs of CPU time.
  EXPECT_NEAR(times.seconds_per_path, 6e-6, 1e-12);
  EXPECT_GT(times.deviation, 0.1);
  EXPECT_THAT(times.doubt, HasSubstr("from 4 to 12 µs"));
}

TEST(WorkerTimes, ADifferenceThatThePicturesPartsExplainIsNone) {
  std::vector<v1::TaskResult> results;
  add_results(results, "a", 4, 5, 0.9);
  add_results(results, "b", 4, 7, 0.9);
  const WorkerTimes times = judged({worker("a", 1, 1), worker("b", 1, 1)}, results);
  EXPECT_NEAR(times.seconds_per_path, 6e-6, 1e-12);
  EXPECT_GT(times.deviation, 0.02) << "other shares of the tasks would have made another mean";
  EXPECT_EQ(times.doubt, "");
}

TEST(WorkerTimes, ABusyMachineStretchesTheWallTimeOnly) {
  std::vector<v1::TaskResult> results;
  add_results(results, "a", 8, 5, 0, 0.75);  // two threads at 2/3 of a processor each
  const WorkerTimes times = judged({worker("a", 1, 2)}, results);
  EXPECT_NEAR(times.stretch, 1.5, 1e-9);
  EXPECT_NEAR(times.seconds_per_path, 5e-6, 1e-15);
  results.clear();
  add_results(results, "a", 8, 5, 0, 0.4);
  EXPECT_EQ(judged({worker("a", 1, 2)}, results).stretch, 1) << "no machine is faster than its threads";
}

TEST(WorkerTimes, WhoWasNotMeasuredIsSaid) {
  std::vector<v1::TaskResult> results;
  add_results(results, "gone", 8, 5);
  EXPECT_THAT(judged({worker("new", 1, 4)}, results).doubt, HasSubstr("only 0 of the 1 workers"));
  EXPECT_NEAR(judged({worker("new", 1, 4)}, results).seconds_per_path, 5e-6, 1e-15) << "an earlier job's results tell it";
  EXPECT_EQ(judged({worker("new", 1, 4)}, results).threads, 4);
  add_results(results, "new", 8, 5);
  EXPECT_EQ(judged({worker("new", 1, 4)}, results).doubt, "");
}

TEST(WorkerTimes, CostsThatWereNotKeptAreNoCosts) {
  std::vector<v1::TaskResult> results;
  add_results(results, "", 4, 0);
  EXPECT_THROW(judged({worker("a", 1, 1)}, results), NoQuote);
  add_results(results, "a", 4, 5);
  EXPECT_NEAR(judged({worker("a", 1, 1)}, results).seconds_per_path, 5e-6, 1e-15);
  EXPECT_THROW(judged({}, results), NoQuote) << "nobody is there to take the job";
}

}  // namespace
}  // namespace woodcock
