// Jobs that ask for something of workers or of each other, under the scheduler of scheduler_fixture.h.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "tests/service/scheduler_fixture.h"

namespace woodcock::coordinator {

inline constexpr int64_t kGib = int64_t{1} << 30;

inline std::string numbered(std::string name, int number) { return name.append(std::to_string(number)); }

inline JobSpec job_of(const std::string& id, const std::function<void(JobPolicy&)>& adjust, int priority = 0) {
  JobSpec job = test_job(id, priority);
  adjust(job.policy);
  job.policy.waits_for = job.policy.after;
  return job;
}

inline WorkerReport worker_report(SchedulerWorld& world, const std::string& worker, const std::vector<std::string>& tags,
                                  int64_t memory = 0, int slots = 1) {
  WorkerReport report = world.report(worker);
  report.tags = tags;
  report.memory = memory;
  report.slots = slots;
  return report;
}

inline std::string reason(const SchedulerWorld& world, const std::string& job) {
  const Job& found = *world.scheduler.find(job);
  return world.scheduler.waiting_reason(found, found.frames[0], world.now);
}

/// Ends the job with all its frames done.
inline void complete(SchedulerWorld& world, const std::string& job) {
  world.finish_everything("w1");
  world.scheduler.frame_assembled(job, 0, std::string(64, 'e'), 1, {});
  world.settle();
  ASSERT_EQ(world.scheduler.find(job)->row.state, JobState::Done);
}

}  // namespace woodcock::coordinator
