// Jobs, frames and tasks: how they begin, settle and end.
#include <algorithm>
#include <cmath>

#include "coordinator/scheduler.h"
#include "coordinator/task_grid.h"

namespace woodcock::coordinator {

FrameHeader Frame::pinned_header() const {
  FrameHeader header = spec.header;
  header.build = row.build;
  header.arithmetic_class = row.arithmetic_class;
  return header;
}

void Frame::add_result(int64_t number, const ResultRecord& result, bool reused) {
  Task& task = tasks[static_cast<size_t>(number)];
  task.digest = result.digest;
  task.committed_by = result.worker_id;
  task.reused = reused;
  task.cpu_ns = result.cost.cpu_ns;
  task.wall_ns = result.cost.wall_ns;
  ++done;
  samples_done += task.area.samples();
  if (!reused) cpu_ns += task.cpu_ns;
  result_cpu_ns += task.cpu_ns;
  add_health(number, result.health);
}

void Frame::remove_result(int64_t number) {
  Task& task = tasks[static_cast<size_t>(number)];
  task.digest.clear();
  --done;
  samples_done -= task.area.samples();
  // What it cost was spent all the same, but is no part of the picture.
  result_cpu_ns -= task.cpu_ns;
  task.cpu_ns = task.wall_ns = 0;
  remove_health(number);
}

void Frame::add_health(int64_t number, const HealthCounts& counts) {
  if (!counts.any()) return;
  unhealthy[number] = counts;
  health += counts;
}

void Frame::remove_health(int64_t number) {
  const auto it = unhealthy.find(number);
  if (it == unhealthy.end()) return;
  health -= it->second;
  unhealthy.erase(it);
}

Job* Scheduler::job_of(const std::string& id) {
  const auto it = jobs_.find(id);
  return it == jobs_.end() ? nullptr : &it->second;
}

const Job* Scheduler::find(const std::string& id) const {
  const auto it = jobs_.find(id);
  return it == jobs_.end() ? nullptr : &it->second;
}

Frame* Scheduler::frame_of(const TaskRef& task) {
  Job* job = job_of(task.job);
  return job && static_cast<size_t>(task.frame) < job->frames.size() ? &job->frames[static_cast<size_t>(task.frame)] : nullptr;
}

Task* Scheduler::task_of(const TaskRef& task) {
  Frame* frame = frame_of(task);
  return frame && static_cast<size_t>(task.number) < frame->tasks.size() ? &frame->tasks[static_cast<size_t>(task.number)] : nullptr;
}

void Scheduler::log(const std::string& job, EventKind kind, std::optional<uint64_t> frame, const std::string& task,
                    const std::string& worker, const std::string& message) {
  actions_.push_back(action::LogEvent{job, {0, 0, kind, frame, task, worker, message}});
}

std::vector<Action> Scheduler::take_actions() { return std::exchange(actions_, {}); }

void Scheduler::append_tasks(Frame& frame, const std::vector<TaskArea>& areas) {
  for (const TaskArea& area : areas) {
    Task task;
    task.area = area;
    frame.tasks.push_back(std::move(task));
    ++frame.unsettled;
    frame.samples_total += area.samples();
  }
}

void Scheduler::append_round(Job& job, Frame& frame, SampleRange round) {
  append_tasks(frame, task_list(frame.spec.header.bounds, job.spec.tile_size, round, job.spec.range_length));
}

void Scheduler::append_pass(Job& job, Frame& frame, size_t pass) {
  append_tasks(frame, pass_tasks(frame.planned_map(pass, job.spec.samples()), frame.row.passes[pass], job.spec.tile_size));
}

void Scheduler::add_job(const JobSpec& spec) {
  Job& job = jobs_[spec.id];
  job.spec = spec;
  // A newcomer shares from now on; it does not catch up on what others got before.
  bool any = false;
  for (const auto& [id, other] : jobs_) {
    if (&other == &job || has_ended(other.row.state) || other.spec.priority != spec.priority) continue;
    job.served = any ? std::min(job.served, other.served) : other.served;
    any = true;
  }
  for (const FrameSpec& frame_spec : spec.frames) {
    Frame& frame = job.frames.emplace_back();
    frame.spec = frame_spec;
    for (const SampleRange round : spec.rounds) append_round(job, frame, round);
  }
}

void Scheduler::add_parts(Frame& frame, int64_t number, int64_t first_part) {
  const std::vector<TaskArea> parts = split_task(frame.tasks[static_cast<size_t>(number)].area);
  for (const TaskArea& area : parts) {
    Task part;
    part.area = area;
    part.parent = number;
    frame.tasks.push_back(std::move(part));
  }
  Task& task = frame.tasks[static_cast<size_t>(number)];
  task.state = TaskState::Split;
  task.first_part = first_part;
  frame.unsettled += static_cast<int64_t>(parts.size()) - 1;
  ++frame.splits;
}

void Scheduler::restore_tasks(Job& job, Frame& frame, const std::vector<SettledTask>& settled) {
  // Task numbers were given in order of time: rounds and splits interleave as the numbers of the first parts say.
  std::vector<const SettledTask*> splits;
  for (const SettledTask& row : settled)
    if (row.state == TaskState::Split) splits.push_back(&row);
  std::sort(splits.begin(), splits.end(), [](const SettledTask* a, const SettledTask* b) { return a->first_part < b->first_part; });
  size_t next = 0;
  const auto take_splits = [&] {
    for (; next < splits.size() && splits[next]->first_part == static_cast<int64_t>(frame.tasks.size()); ++next)
      add_parts(frame, splits[next]->number, splits[next]->first_part);
  };
  for (const SampleRange round : job.spec.rounds) {
    append_round(job, frame, round);
    take_splits();
  }
  for (size_t pass = 0; pass < frame.row.passes.size(); ++pass) {
    append_pass(job, frame, pass);
    take_splits();
  }
  for (const SettledTask& row : settled) {
    if (static_cast<size_t>(row.number) >= frame.tasks.size() || row.state == TaskState::Split) continue;
    Task& task = frame.tasks[static_cast<size_t>(row.number)];
    task.state = row.state;
    task.error = row.error;
    --frame.unsettled;
    if (row.state == TaskState::Done)
      frame.add_result(row.number, row.result, row.reused);
    else
      ++frame.given_up;
  }
}

void Scheduler::recover_job(const RecoveredJob& recovered, const std::vector<LeaseRow>& leases, Time now) {
  Job& job = jobs_[recovered.spec.id];
  job.spec = recovered.spec;
  job.row = recovered.row;
  std::vector<std::vector<SettledTask>> settled(recovered.frames.size());
  for (const SettledTask& row : recovered.settled) settled.at(static_cast<size_t>(row.frame)).push_back(row);
  for (size_t i = 0; i < recovered.spec.frames.size(); ++i) {
    Frame& frame = job.frames.emplace_back();
    frame.spec = recovered.spec.frames[i];
    frame.row = recovered.frames[i];
    restore_tasks(job, frame, settled[i]);
    job.leased_ever = job.leased_ever || frame.row.pinned;
  }
  for (const LeaseRow& row : leases) {
    if (row.task.job != job.spec.id || has_ended(job.row.state)) continue;
    Task* task = task_of(row.task);
    if (!task || task->state != TaskState::Open) {
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
    task->leases.push_back(lease.id);
    task->epoch = std::max(task->epoch, lease.epoch);
    workers_[row.worker_id].leases.insert(lease.id);
    leases_.emplace(lease.id, lease);
  }
  for (size_t i = 0; i < job.frames.size(); ++i) {
    check_frame(job, static_cast<int>(i));
    Frame& frame = job.frames[i];
    if (frame.row.state == FrameState::Assembling && frame.unsettled > 0) {
      // Its time was over before the restart.
      actions_.push_back(action::AssembleFrame{job.spec.id, static_cast<int>(i)});
      continue;
    }
    // A crash may have come before the results of the pass were looked up.
    if (!frame.row.passes.empty() && frame.row.pinned && frame.unsettled > 0 && !has_ended(frame.row.state)) look_up(job, frame);
  }
  update_job(job);
}

bool Scheduler::cancel(const std::string& id) {
  Job* job = job_of(id);
  if (!job || has_ended(job->row.state)) return false;
  for (Frame& frame : job->frames) {
    if (has_ended(frame.row.state)) continue;
    frame.deciding = false;
    frame.row.state = FrameState::Cancelled;
    for (Task& task : frame.tasks)
      while (!task.leases.empty()) end_lease(task.leases.back(), CancelReason::JobEnded);
  }
  for (size_t i = 0; i < job->frames.size(); ++i) actions_.push_back(action::SaveFrame{id, static_cast<int>(i)});
  set_state(*job, JobState::Cancelled, "cancelled by a user");
  return true;
}

bool Scheduler::set_paused(const std::string& id, bool paused) {
  Job* job = job_of(id);
  if (!job || has_ended(job->row.state)) return false;
  if (job->row.paused == paused) return true;
  job->row.paused = paused;
  actions_.push_back(action::SaveJob{id});
  update_job(*job);
  return true;
}

bool can_be_extended(const Job& job) {
  return job.row.state != JobState::Cancelled && (job.row.state != JobState::Failed || job.spec.out_of_time());
}

/// Renders on a frame that had ended, or is being merged.
void Scheduler::wake_frame(Job& job, int index) {
  Frame& frame = job.frames[static_cast<size_t>(index)];
  if (frame.row.state == FrameState::Failed) {
    frame.retry.clear();
    for (Task& task : frame.tasks) task.retry = false;
    frame.next_fresh = 0;
    frame.scene_failures.clear();
  }
  ++frame.revision;
  frame.deciding = false;
  frame.row.state = FrameState::Running;
  frame.row.reason.clear();
  actions_.push_back(action::SaveFrame{job.spec.id, index});
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
    append_round(*job, frame, round);
    wake_frame(*job, static_cast<int>(i));
    // What is looked up may not be rendered and committed meanwhile, so a frame that is at work does not ask.
    if (frame.row.pinned && idle) look_up(*job, frame);
  }
  job->first_unfinished = 0;
  log(id, EventKind::Extended, {}, "", "", "extended to " + std::to_string(samples) + " samples per pixel");
  job->row.ended_unix_ms = 0;
  set_state(*job, JobState::Running, "");
  update_job(*job);
  return true;
}

void Scheduler::set_state(Job& job, JobState state, const std::string& reason) {
  if (job.row.state == state && job.row.reason == reason) return;
  const bool changed = job.row.state != state;
  job.row.state = state;
  job.row.reason = reason;
  actions_.push_back(action::SaveJob{job.spec.id});
  if (changed) log(job.spec.id, EventKind::StateChanged, {}, "", "", std::string(to_string(state)) + (reason.empty() ? "" : ": " + reason));
}

/// The job's state follows from its frames'.
void Scheduler::update_job(Job& job) {
  if (job.row.state == JobState::Cancelled) return;
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
}

/// Begins to assemble a frame whose last task is settled.
void Scheduler::check_frame(Job& job, int index) {
  Frame& frame = job.frames[static_cast<size_t>(index)];
  if (has_ended(frame.row.state) || frame.unsettled > 0) return;
  if (frame.done == 0) {
    const auto last = std::find_if(frame.tasks.begin(), frame.tasks.end(), [](const Task& t) { return !t.error.empty(); });
    fail_frame(job, index,
               "no task could be rendered; the first error: " + (last == frame.tasks.end() ? std::string("none") : last->error));
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
  for (Task& task : frame.tasks)
    while (!task.leases.empty()) end_lease(task.leases.back(), CancelReason::TaskSettled);
  frame.retry.clear();
  frame.next_fresh = frame.tasks.size();
  actions_.push_back(action::SaveFrame{job.spec.id, index});
  log(job.spec.id, EventKind::StateChanged, frame.spec.header.frame, "", "", "frame failed: " + reason);
  update_job(job);
}

void Scheduler::frame_failed(const std::string& id, int index, const std::string& reason) {
  if (Job* job = job_of(id); job && !has_ended(job->row.state)) fail_frame(*job, index, reason);
}

namespace {

/// The CPU time that the workers spent on the samples of each point.
void add_times(const Frame& frame, Convergence& record) {
  double earlier = 0;
  for (const Task& task : frame.tasks) {
    if (task.state != TaskState::Done) continue;
    if (task.reused) {
      earlier += static_cast<double>(task.area.samples());
      continue;
    }
    for (ConvergencePoint& point : record.points)
      if (task.area.range.end <= point.samples) point.cpu_seconds += 1e-9 * static_cast<double>(task.cpu_ns);
  }
  record.timed_from = std::llround(earlier / static_cast<double>(frame.spec.header.bounds.area()));
}

}  // namespace

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
  add_times(frame, frame.row.statistics.convergence);
  frame.row.state = frame.given_up > 0 || statistics.missing_pixels > 0 ? FrameState::Partial : FrameState::Done;
  frame.row.reason = reason;
  if (frame.given_up > 0) frame.row.reason = std::to_string(frame.given_up) + " tasks could not be rendered by any worker";
  actions_.push_back(action::SaveFrame{id, index});
  log(id, EventKind::FrameDone, frame.spec.header.frame, "", "", std::string("frame ") + to_string(frame.row.state));
  update_job(*job);
}

Progress Scheduler::progress(const Job&, const Frame& frame) const {
  Progress p;
  p.tasks_done = frame.done;
  p.tasks_failed = frame.given_up;
  p.tasks_total = frame.unsettled + frame.done + frame.given_up;
  p.samples_total = frame.samples_total;
  p.samples_done = frame.samples_done;
  p.worker_seconds = static_cast<double>(frame.cpu_ns) * 1e-9;
  p.result_seconds = static_cast<double>(frame.result_cpu_ns) * 1e-9;
  return p;
}

Progress Scheduler::progress(const Job& job, Time now) const {
  Progress sum;
  for (const Frame& frame : job.frames) {
    const Progress p = progress(job, frame);
    sum.tasks_done += p.tasks_done;
    sum.tasks_failed += p.tasks_failed;
    sum.tasks_total += p.tasks_total;
    sum.samples_total += p.samples_total;
    sum.samples_done += p.samples_done;
    sum.worker_seconds += p.worker_seconds;
    sum.result_seconds += p.result_seconds;
  }
  for (const auto& [id, lease] : leases_) {
    if (lease.task.job != job.spec.id) continue;
    ++sum.tasks_leased;
    sum.samples_in_flight += lease.samples_done;
  }
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
