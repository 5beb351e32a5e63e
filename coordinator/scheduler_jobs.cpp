// Jobs, frames and tasks: how they begin, settle and end.
#include <algorithm>
#include <utility>

#include "coordinator/scheduler.h"

namespace woodcock::coordinator {

Job* Scheduler::job_of(const std::string& id) {
  const auto it = jobs_.find(id);
  return it == jobs_.end() ? nullptr : &it->second;
}

const Job* Scheduler::find(const std::string& id) const {
  const auto it = jobs_.find(id);
  return it == jobs_.end() ? nullptr : &it->second;
}

Scheduler::Place Scheduler::place_of(const TaskRef& task) {
  Job* job = job_of(task.job);
  if (!job || static_cast<size_t>(task.frame) >= job->frames.size()) return {};
  Frame& frame = job->frames[static_cast<size_t>(task.frame)];
  return task.number < frame.tasks.size() ? Place{job, &frame} : Place{};
}

ActiveTask* Scheduler::open_task(const TaskRef& task) {
  const Place place = place_of(task);
  return place && place.frame->state(task.number) == TaskState::Open ? &place.frame->active[task.number] : nullptr;
}

void Scheduler::log(const std::string& id, EventKind kind, std::optional<uint64_t> frame, const std::string& task,
                    const std::string& worker, const std::string& message) {
  if (Job* job = job_of(id)) actions_.push_back(action::LogEvent{id, {++job->row.last_event, 0, kind, frame, task, worker, message}});
}

std::vector<Action> Scheduler::take_actions() {
  // Last, so that all that belongs to the end comes before. The end of one job may be that of others.
  for (size_t i = 0; i < ended_.size(); ++i) {
    const std::string id = ended_[i];
    const Job* job = find(id);
    if (!job || !has_ended(job->row.state)) continue;
    tell_dependents(id, job->row.state);
    actions_.push_back(action::ReleaseJob{id});
  }
  ended_.clear();
  return std::exchange(actions_, {});
}

void Scheduler::save_job(const Job& job) { actions_.push_back(action::SaveJob{job.spec.id, job.spec, job.row}); }

void Scheduler::save_frame(const Job& job, const Frame& frame) {
  action::SaveFrame save{job.spec.id, static_cast<int>(&frame - job.frames.data()), frame.row};
  if (frame.pin_pending) {
    // Its row is pinned when this is written, though nobody here may count on it yet.
    save.row.pinned = true;
    save.row.build = frame.pin_build;
    save.row.arithmetic_class = frame.pin_class;
  }
  actions_.push_back(std::move(save));
}

/// Puts the job where its turn is, or takes it out when there is nothing to lease. One that has as many workers as it may is in no
/// queue: those look for it (full_jobs_of).
void Scheduler::take_turn(Job& job) { queue_.set_queued(job.spec.id, job.is_runnable() && !job.is_full()); }

/// The frame may have something to lease.
void Scheduler::set_ready(Job& job, const Frame& frame) {
  job.ready.insert(static_cast<size_t>(&frame - job.frames.data()));
  take_turn(job);
}

Job& Scheduler::insert(Job added) {
  Job& job = jobs_.emplace(added.spec.id, std::move(added)).first->second;
  queue_.add(job.spec.id, job.spec.priority, job.spec.policy.user, job.spec.policy.demands);
  return job;
}

void Scheduler::add_job(Job added) {
  const std::string id = added.spec.id;
  Job& job = insert(std::move(added));
  for (const Frame& frame : job.frames) job.ready.insert(job.ready.end(), static_cast<size_t>(&frame - job.frames.data()));
  wait_for_jobs(job);
  take_turn(job);
  log(id, EventKind::Submitted, {}, "", "", job.spec.name);
}

void Scheduler::recover_job(Job recovered, const std::vector<LeaseRow>& leases, Time now) {
  const std::string id = recovered.spec.id;
  Job& job = insert(std::move(recovered));
  if (job.row.last_event == 0) log(id, EventKind::Submitted, {}, "", "", job.spec.name);
  wait_for_jobs(job);
  for (Frame& frame : job.frames) {
    job.leased_ever = job.leased_ever || frame.row.pinned;
    // That it began is not written: it was leased when it was pinned.
    if (frame.row.pinned && frame.row.state == FrameState::Queued) frame.row.state = FrameState::Running;
    if (frame.unsettled > 0 && !has_ended(frame.row.state)) set_ready(job, frame);
  }
  // A crash may have come between the rows of a cancel: a frame is cancelled with its job alone.
  if (std::any_of(job.frames.begin(), job.frames.end(), [](const Frame& frame) { return frame.row.state == FrameState::Cancelled; }))
    cancel(id);
  for (const LeaseRow& row : leases) {
    ActiveTask* task = has_ended(job.row.state) ? nullptr : open_task(row.task);
    if (!task) {
      actions_.push_back(action::DropLease{row.lease_id});
      continue;
    }
    // Counts start afresh: nobody's lease expires because the coordinator was away.
    Lease lease;
    lease.id = row.lease_id;
    lease.task = row.task;
    lease.worker_id = row.worker_id;
    lease.epoch = row.epoch;
    lease.granted = lease.last_change = now;
    lease.to_send = false;
    hold(std::move(lease), workers_[row.worker_id], 0);
  }
  for (size_t i = 0; i < job.frames.size(); ++i) {
    check_frame(job, static_cast<int>(i));
    Frame& frame = job.frames[i];
    if (frame.row.state == FrameState::Assembling && frame.unsettled > 0) {
      // Its time was over before the restart.
      actions_.push_back(action::AssembleFrame{id, static_cast<int>(i)});
      continue;
    }
    // A crash may have come before the results of the pass were looked up. Other frames ask when it is their turn.
    if (!frame.row.passes.empty()) look_ahead(job, frame);
  }
  update_job(job);
}

std::optional<Job> Scheduler::release(const std::string& id) {
  const auto it = jobs_.find(id);
  if (it == jobs_.end() || !has_ended(it->second.row.state) || !it->second.leases.empty()) return std::nullopt;
  for (const Frame& frame : it->second.frames)
    if (frame.pin_pending || frame.looking_up > frame.looked_up || frame.any_committing()) return std::nullopt;
  queue_.remove(id);
  std::optional<Job> job(std::move(it->second));
  jobs_.erase(it);
  return job;
}

void Scheduler::release_if_ended(const std::string& id) {
  if (const Job* job = find(id); job && has_ended(job->row.state)) ended_.push_back(id);
}

bool Scheduler::cancel(const std::string& id) {
  Job* job = job_of(id);
  if (!job || has_ended(job->row.state)) return false;
  for (Frame& frame : job->frames) {
    if (has_ended(frame.row.state)) continue;
    frame.deciding = false;
    frame.row.state = FrameState::Cancelled;
    end_leases(frame, CancelReason::JobEnded);
    save_frame(*job, frame);
  }
  set_state(*job, JobState::Cancelled, "cancelled by a user");
  take_turn(*job);
  return true;
}

bool Scheduler::set_paused(const std::string& id, bool paused) {
  Job* job = job_of(id);
  if (!job || has_ended(job->row.state)) return false;
  if (job->row.paused == paused) return true;
  job->row.paused = paused;
  save_job(*job);
  update_job(*job);
  return true;
}

/// Renders on a frame that had ended, or is being merged.
void Scheduler::wake_frame(Job& job, int index) {
  Frame& frame = job.frames[static_cast<size_t>(index)];
  if (frame.row.state == FrameState::Failed) {
    frame.retry.clear();
    for (auto& [number, task] : frame.active) task.retry = false;
    frame.next_fresh = 0;
    frame.scene_failures.clear();
  }
  ++frame.revision;
  frame.deciding = false;
  frame.row.state = FrameState::Running;
  frame.row.reason.clear();
  save_frame(job, frame);
  set_ready(job, frame);
}

bool Scheduler::extend(const std::string& id, int64_t samples) {
  Job* job = job_of(id);
  if (!job || !can_be_extended(*job)) return false;
  if (samples <= job->spec.samples()) return true;
  const SampleRange round{job->spec.samples(), samples};
  job->spec.rounds.push_back(round);
  job->spec.settings.samples = samples;
  if (job->spec.quote) job->spec.quote->extended = true;
  for (size_t i = 0; i < job->frames.size(); ++i) {
    Frame& frame = job->frames[i];
    const bool idle = frame.unsettled == 0;
    frame.append_round(job->spec, round);
    wake_frame(*job, static_cast<int>(i));
    // A frame that is at work asks when it comes to these tasks.
    if (idle) look_ahead(*job, frame);
  }
  job->first_unfinished = 0;
  log(id, EventKind::Extended, {}, "", "", "extended to " + std::to_string(samples) + " samples per pixel");
  job->row.ended_unix_ms = 0;
  set_state(*job, JobState::Running, "");
  update_job(*job);
  // Of a job that runs already nothing else changes.
  save_job(*job);
  return true;
}

void Scheduler::set_state(Job& job, JobState state, const std::string& reason) {
  if (job.row.state == state && job.row.reason == reason) return;
  const bool changed = job.row.state != state;
  job.row.state = state;
  job.row.reason = reason;
  save_job(job);
  if (has_ended(state)) {
    ended_.push_back(job.spec.id);
    stop_waiting(job);
  }
  if (changed) log(job.spec.id, EventKind::StateChanged, {}, "", "", std::string(to_string(state)) + (reason.empty() ? "" : ": " + reason));
}

/// The job's state follows from its frames'.
void Scheduler::update_job(Job& job) {
  if (job.row.state == JobState::Cancelled) return take_turn(job);
  size_t ended = 0, assembling = 0, partial = 0, failed = 0;
  std::string reason;
  for (const Frame& frame : job.frames) {
    ended += has_ended(frame.row.state);
    assembling += frame.row.state == FrameState::Assembling;
    partial += frame.row.state == FrameState::Partial;
    failed += frame.row.state == FrameState::Failed;
    if (reason.empty()) reason = frame.row.reason;
  }
  while (job.first_unfinished < job.frames.size() && job.frames[job.first_unfinished].unsettled == 0) ++job.first_unfinished;
  if (ended == job.frames.size()) {
    // What the time did not suffice for is a part that is missing.
    const bool some = failed < job.frames.size() && job.spec.out_of_time();
    set_state(job, failed && !some ? JobState::Failed : partial || failed ? JobState::Partial : JobState::Done, reason);
  } else if (ended + assembling == job.frames.size()) {
    set_state(job, JobState::Assembling, "");
  } else if (job.row.paused) {
    set_state(job, JobState::Paused, "paused by a user");
  } else {
    set_state(job, job.leased_ever ? JobState::Running : JobState::Queued, "");
  }
  take_turn(job);
}

/// Begins to assemble a frame whose last task is settled.
void Scheduler::check_frame(Job& job, int index) {
  Frame& frame = job.frames[static_cast<size_t>(index)];
  if (has_ended(frame.row.state) || frame.unsettled > 0) return;
  if (frame.done == 0) {
    fail_frame(job, index,
               "no task could be rendered; the first error: " + (frame.failures.empty() ? "none" : frame.failures.begin()->second.error));
    return;
  }
  if (job.spec.target)
    frame.deciding = true;
  else
    frame.row.state = FrameState::Assembling;
  actions_.push_back(action::AssembleFrame{job.spec.id, index});
  update_job(job);
}

void Scheduler::fail_frame(Job& job, int index, const std::string& reason) {
  Frame& frame = job.frames[static_cast<size_t>(index)];
  if (has_ended(frame.row.state)) return;
  frame.deciding = false;
  frame.row.state = FrameState::Failed;
  frame.row.reason = reason;
  end_leases(frame, CancelReason::TaskSettled);
  frame.retry.clear();
  frame.next_fresh = frame.tasks.size();
  save_frame(job, frame);
  log(job.spec.id, EventKind::StateChanged, frame.spec.header.frame, "", "", "frame failed: " + reason);
  update_job(job);
}

void Scheduler::frame_failed(const std::string& id, int index, const std::string& reason) {
  if (Job* job = job_of(id); job && !has_ended(job->row.state)) fail_frame(*job, index, reason);
}

void Scheduler::frame_assembled(const std::string& id, int index, const std::string& digest, int64_t bytes,
                                const FrameStatistics& statistics, const std::string& reason) {
  Job* job = job_of(id);
  if (!job) return;
  Frame& frame = job->frames[static_cast<size_t>(index)];
  // Extended, reopened or cancelled meanwhile: the image is not the final one any more.
  if (!frame.to_be_assembled()) return;
  frame.deciding = false;
  frame.row.image_digest = digest;
  frame.row.image_bytes = bytes;
  frame.row.statistics = statistics;
  frame.row.state = frame.given_up > 0 || statistics.missing_pixels > 0 ? FrameState::Partial : FrameState::Done;
  frame.row.reason = reason;
  if (frame.given_up > 0) frame.row.reason = std::to_string(frame.given_up) + " tasks could not be rendered by any worker";
  save_frame(*job, frame);
  log(id, EventKind::FrameDone, frame.spec.header.frame, "", "", std::string("frame ") + to_string(frame.row.state));
  update_job(*job);
}

Progress progress_of(const FrameCounts& counts) {
  Progress p;
  p.tasks_done = counts.done;
  p.tasks_failed = counts.given_up;
  p.tasks_total = counts.unsettled + counts.done + counts.given_up;
  p.samples_total = counts.samples_total;
  p.samples_done = counts.samples_done;
  p.worker_seconds = static_cast<double>(counts.cpu_ns) * 1e-9;
  p.result_seconds = static_cast<double>(counts.result_cpu_ns) * 1e-9;
  return p;
}

Progress Scheduler::progress(const Job& job, Time now) const {
  Progress sum = progress_of(summary_of(job).counts);
  sum.tasks_leased = static_cast<int64_t>(job.leases.size());
  for (const std::string& id : job.leases) sum.samples_in_flight = capped_sum(sum.samples_in_flight, leases_.at(id).samples_done);
  if (!has_ended(job.row.state) && !job.recent.empty()) {
    const Time window = std::max<Time>(now - job.recent.front().first, kSecond);
    int64_t samples = 0;
    for (const auto& [when, count] : job.recent) samples += count;
    if (now - job.recent.back().first < 60 * kSecond)
      sum.samples_per_second = static_cast<double>(samples) / (static_cast<double>(window) * 1e-9);
    // How many passes follow is not known.
    if (sum.samples_per_second > 0 && !job.spec.target)
      sum.eta_seconds = static_cast<double>(std::max<int64_t>(0, sum.samples_total - sum.samples_done)) / sum.samples_per_second;
  }
  return sum;
}

}  // namespace woodcock::coordinator
