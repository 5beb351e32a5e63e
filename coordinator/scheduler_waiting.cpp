// What frames wait for: one reason of a closed list, for people and for the log.
#include <algorithm>

#include "coordinator/scheduler.h"

namespace woodcock::coordinator {

/// What the connected workers say about a frame's build: nothing blocks it where one of them takes work.
Waiting Scheduler::waiting_for_workers(const Job& job, const Frame& frame, Time now) const {
  bool any = false, suitable = false, fitting = false, free = false, asked = false;
  for (const auto& [id, worker] : workers_) {
    if (!connected(worker, now)) continue;
    any = true;
    suitable = suitable || meets(worker, job.spec.policy.demands);
    if (!fits(worker, job, frame)) continue;
    fitting = true;
    if (!available(worker, now)) continue;
    free = true;
    // As answer() gives out work.
    asked = asked || worker.consecutive_failures < 3 || now >= worker.next_grant;
  }
  if (!any) return {WaitingReason::NoWorker, "no worker is connected"};
  if (!suitable) return {WaitingReason::NoSuitableWorker, unmet_demands(job.spec.policy.demands, now)};
  if (!fitting)
    return {WaitingReason::NoFittingWorker, "no connected worker has build " + frame.row.build + " and arithmetic class " +
                                                frame.row.arithmetic_class +
                                                (job.spec.policy.demands == Demands{} ? "" : " and what the job asks of workers") +
                                                "; `woodcock repin` starts it again for those there are"};
  if (!free)
    return {WaitingReason::WorkersUnavailable, frame.row.pinned ? "every connected worker of its build is draining or quarantined"
                                                                : "every connected worker is draining or quarantined"};
  if (!asked) return {WaitingReason::WorkersPause, "its workers failed again and again, and are asked again after a pause"};
  return {};
}

namespace {

std::string jobs_before(const Job& job) {
  const std::vector<std::string>& jobs = job.spec.policy.waits_for;
  const size_t others = jobs.size() - 1;
  if (others == 0) return "job " + jobs.front() + ", after which it begins, is not done yet";
  return "job " + jobs.front() + " and " + std::to_string(others) + (others == 1 ? " other" : " others") +
         ", after which it begins, are not done yet";
}

}  // namespace

Waiting Scheduler::waiting(const Job& job, const Frame& frame, Time now, KnownWaits& known) const {
  if (has_ended(job.row.state) || has_ended(frame.row.state)) return {};
  if (frame.unsettled == 0 || !frame.being_rendered()) return {WaitingReason::Merging, "its image is being merged"};
  if (job.row.paused) return {WaitingReason::Paused, "the job is paused"};
  if (!job.spec.policy.waits_for.empty()) return {WaitingReason::AfterJobs, jobs_before(job)};
  if (!hold_reason_.empty()) return {WaitingReason::DiskFull, hold_reason_};
  if (const auto lost = lost_scenes_.find(frame.spec.manifest_digest); lost != lost_scenes_.end())
    return {WaitingReason::SceneMissing, lost->second};
  const auto [workers, first] = known.try_emplace({frame.row.build, frame.row.arithmetic_class, job.spec.policy.demands});
  if (first) workers->second = waiting_for_workers(job, frame, now);
  if (workers->second.reason != WaitingReason::None) return workers->second;
  int64_t committing = 0;
  for (const auto& [number, task] : frame.active) {
    if (!task.leases.empty()) return {};
    committing += task.committing;
  }
  if (committing == frame.unsettled) return {WaitingReason::Committing, "its last results are being written"};
  if (frame.pin_pending || (frame.looking_up > frame.looked_up && frame.retry.empty() && frame.next_fresh >= frame.looked_up))
    return {WaitingReason::LookingUp, "the database is asked for results that are there already"};
  if (job.is_full())
    return {WaitingReason::MaxWorkers,
            "as many workers render the job as it may have at once: " + std::to_string(job.spec.policy.max_workers)};
  return {WaitingReason::WorkersBusy, "its workers have other work; its turn comes"};
}

Waiting Scheduler::waiting(const Job& job, const Frame& frame, Time now) const {
  KnownWaits known;
  return waiting(job, frame, now, known);
}

std::vector<Waiting> Scheduler::waiting_of_frames(const Job& job, Time now) const {
  KnownWaits known;
  std::vector<Waiting> waits;
  waits.reserve(job.frames.size());
  for (const Frame& frame : job.frames) waits.push_back(waiting(job, frame, now, known));
  return waits;
}

/// Of each job that runs the frame that comes first speaks for it. What lasts is logged once, until the job goes on.
void Scheduler::log_waits(Time now) {
  KnownWaits known;
  for (auto& [id, job] : jobs_) {
    if (has_ended(job.row.state) || job.first_unfinished >= job.frames.size()) continue;
    const Waiting wait = waiting(job, job.frames[job.first_unfinished], now, known);
    const bool lasts = blocks(wait.reason) || (wait.reason == WaitingReason::WorkersBusy && job.leases.empty());
    const WaitingReason reason = lasts ? wait.reason : WaitingReason::None;
    if (reason != job.waits) {
      job.waits = reason;
      job.waits_since = now;
    }
    if (reason == WaitingReason::None)
      job.waits_logged = reason;
    else if (reason != job.waits_logged && now - job.waits_since >= options_.log_wait_after) {
      job.waits_logged = reason;
      log(id, EventKind::Waiting, {}, "", "", "waits: " + wait.text);
    }
  }
}

}  // namespace woodcock::coordinator
