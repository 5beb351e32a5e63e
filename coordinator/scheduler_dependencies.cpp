// Jobs that begin after others: until these are done they lease nothing; where one ends otherwise they fail.
#include <utility>

#include "coordinator/scheduler.h"

namespace woodcock::coordinator {

/// Of a job that has just come to memory.
void Scheduler::wait_for_jobs(Job& job) {
  if (has_ended(job.row.state)) return;
  for (const std::string& id : job.spec.policy.waits_for) {
    dependents_[id].insert(job.spec.id);
    const Job* before = find(id);
    if (!before)
      actions_.push_back(action::FindJob{id});
    else if (has_ended(before->row.state))
      ended_.push_back(id);
  }
}

/// Of a job that has ended.
void Scheduler::stop_waiting(const Job& job) {
  for (const std::string& id : job.spec.policy.waits_for) {
    const auto it = dependents_.find(id);
    if (it == dependents_.end()) continue;
    it->second.erase(job.spec.id);
    if (it->second.empty()) dependents_.erase(it);
  }
}

void Scheduler::job_found(const std::string& id, std::optional<JobState> state) {
  // It may have come back to memory meanwhile. One that runs and is not here yet comes soon: after a restart jobs come one by one.
  if (!find(id) && (!state || has_ended(*state))) tell_dependents(id, state);
}

/// The job has ended so; without a state there is none of this id.
void Scheduler::tell_dependents(const std::string& id, std::optional<JobState> state) {
  const auto dependents = dependents_.extract(id);
  if (dependents.empty()) return;
  for (const std::string& dependent : dependents.mapped()) {
    Job& job = jobs_.at(dependent);
    if (state != JobState::Done) {
      fail_job(job, state ? "job " + id + ", after which this one was to begin, is " + to_string(*state)
                          : "job " + id + ", after which this one was to begin, does not exist any more");
      continue;
    }
    std::erase(job.spec.policy.waits_for, id);
    save_job(job);
    log(dependent, EventKind::StateChanged, {}, "", "",
        std::string(to_string(job.row.state)) + ": job " + id + " is done, for which this one waited");
    take_turn(job);
  }
}

void Scheduler::fail_job(Job& job, const std::string& reason) {
  for (Frame& frame : job.frames) {
    if (has_ended(frame.row.state)) continue;
    frame.deciding = false;
    frame.row.state = FrameState::Failed;
    frame.row.reason = reason;
    end_leases(frame, CancelReason::JobEnded);
    save_frame(job, frame);
  }
  set_state(job, JobState::Failed, reason);
  take_turn(job);
}

}  // namespace woodcock::coordinator
