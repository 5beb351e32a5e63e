// Results and failures: what an offer is worth, what a failing task becomes, whose fault it was.
#include <algorithm>

#include "coordinator/scheduler.h"
#include "coordinator/task_grid.h"

namespace woodcock::coordinator {

const char* to_string(FailureCause cause) {
  static constexpr const char* kNames[] = {"crash", "out of memory", "hang", "scene error", "scene mismatch", "transfer", "other"};
  return kNames[static_cast<int>(cause)];
}

OfferDecision Scheduler::offer(const Offer& offer, const std::string& worker_id, bool blob_present, Time now) {
  const std::optional<TaskRef> ref = parse_task_id(offer.task_id);
  Task* task = ref ? task_of(*ref) : nullptr;
  if (!task) return {OfferStatus::Refused, "no such task"};
  const Job& job = *job_of(ref->job);
  Frame& frame = *frame_of(*ref);
  if (task->state == TaskState::Done) {
    if (task->digest == offer.result.digest) return {OfferStatus::AlreadyCommitted, ""};
    if (!frame.row.pinned || offer.result.key != result_key(frame.pinned_header(), task->area.rect, task->area.range))
      return {OfferStatus::Refused, "the result key is not this task's"};
    log(ref->job, EventKind::DeterminismAlarm, frame.spec.header.frame, offer.task_id, worker_id,
        "two results of one key differ: committed " + task->digest + ", offered " + offer.result.digest);
    return {OfferStatus::Refused, "another result was committed for this key, and this one differs from it"};
  }
  if (task->state == TaskState::Split) return {OfferStatus::Refused, "the task was split"};
  if (task->state == TaskState::GivenUp) return {OfferStatus::Refused, "the task was given up"};
  if (has_ended(job.row.state)) return {OfferStatus::Refused, "the job has ended"};
  if (has_ended(frame.row.state)) return {OfferStatus::Refused, "the frame has ended"};
  if (!frame.row.pinned || offer.result.key != result_key(frame.pinned_header(), task->area.rect, task->area.range)) {
    log(ref->job, EventKind::ResultRefused, frame.spec.header.frame, offer.task_id, worker_id, "the result key is not this task's");
    if (leases_.contains(offer.lease_id) && leases_.at(offer.lease_id).worker_id == worker_id) {
      end_lease(offer.lease_id, std::nullopt);
      task_failed(*ref, worker_id, "a result with a wrong key", true, now);
    }
    return {OfferStatus::Refused, "the result key is not this task's"};
  }
  if (task->state == TaskState::Committing) return {OfferStatus::Pending, ""};
  if (!blob_present) return {OfferStatus::UploadNeeded, ""};
  task->state = TaskState::Committing;
  task->digest = offer.result.digest;
  if (task->retry) {
    frame.retry.erase(ref->number);
    task->retry = false;
  }
  ResultRecord result = offer.result;
  result.cost.samples = task->area.samples();
  result.worker_id = worker_id;
  actions_.push_back(action::CommitTask{*ref, result, worker_id});
  return {OfferStatus::Pending, ""};
}

/// Counts a task out of the open ones and ends its attempts.
void Scheduler::settle(const TaskRef& ref, TaskState state) {
  Frame& frame = *frame_of(ref);
  Task& task = *task_of(ref);
  task.state = state;
  if (task.retry) {
    frame.retry.erase(ref.number);
    task.retry = false;
  }
  while (!task.leases.empty()) end_lease(task.leases.back(), CancelReason::TaskSettled);
}

void Scheduler::committed(const action::CommitTask& commit, Time now) {
  Job* job = job_of(commit.task.job);
  Task* task = task_of(commit.task);
  if (!task || task->state != TaskState::Committing) return;
  Frame& frame = *frame_of(commit.task);
  // The winner's own lease ends by the verdict; the others are told.
  for (const std::string& id : std::vector<std::string>(task->leases))
    if (leases_.at(id).worker_id == commit.worker_id) end_lease(id, std::nullopt);
  settle(commit.task, TaskState::Done);
  --frame.unsettled;
  frame.add_result(commit.task.number, commit.result, false);
  frame.durations.push_back(commit.result.cost.wall_ns);
  if (frame.durations.size() > 101) frame.durations.pop_front();
  job->recent.emplace_back(now, task->area.samples());
  if (job->recent.size() > 10'000) job->recent.pop_front();
  log(commit.task.job, EventKind::TaskCommitted, frame.spec.header.frame, to_string(commit.task), commit.worker_id, "");

  Worker& winner = workers_[commit.worker_id];
  winner.consecutive_failures = winner.blame = 0;
  winner.quarantined = false;
  winner.next_grant = winner.probe_interval = 0;
  blame_others(*task, commit.worker_id);
  check_frame(*job, commit.task.frame);
}

/// A failure counts against a worker only now that the task is known to be good.
void Scheduler::blame_others(const Task& task, const std::string& winner) {
  for (const std::string& id : task.failed_workers) {
    if (id == winner) continue;
    Worker& worker = workers_[id];
    if (++worker.blame >= options_.quarantine_after) worker.quarantined = true;
  }
}

void Scheduler::task_failed(const TaskRef& ref, const std::string& worker_id, const std::string& why, bool counts, Time now) {
  Task* task = task_of(ref);
  if (!task || task->state != TaskState::Open) return;
  task->error = why;
  if (counts) {
    if (std::find(task->failed_workers.begin(), task->failed_workers.end(), worker_id) == task->failed_workers.end())
      task->failed_workers.push_back(worker_id);
    const int64_t others = std::max<int64_t>(1, available_workers(*frame_of(ref), now));
    if (static_cast<int64_t>(task->failed_workers.size()) >= std::min<int64_t>(options_.poison_workers, others)) {
      split_or_give_up(ref, why);
      return;
    }
  }
  requeue(ref);
}

/// A scene that cannot be read fails its frame when two workers say so. Where there is one worker only it must say so twice.
bool Scheduler::scene_is_bad(const Frame& frame, Time now) const {
  if (frame.scene_failures.size() != 1) return frame.scene_failures.size() > 1;
  const auto& [only, times] = *frame.scene_failures.begin();
  const bool another = std::any_of(workers_.begin(), workers_.end(),
                                   [&](const auto& w) { return w.first != only && available(w.second, now) && fits(w.second, frame); });
  return !another && times > 1;
}

/// Nobody knows yet whether task or worker are at fault: others first, the same one where there are none.
void Scheduler::ask_another(const TaskRef& ref, const std::string& worker_id, const std::string& why) {
  Task* task = task_of(ref);
  if (!task || task->state != TaskState::Open) return;
  task->error = why;
  if (std::find(task->failed_workers.begin(), task->failed_workers.end(), worker_id) == task->failed_workers.end())
    task->failed_workers.push_back(worker_id);
  requeue(ref);
}

void Scheduler::scene_found(const std::string& manifest_digest) {
  lost_scenes_.erase(manifest_digest);
  // Who failed for want of it need not wait any longer.
  for (auto& [id, worker] : workers_) {
    if (worker.quarantined) continue;
    worker.consecutive_failures = 0;
    worker.next_grant = 0;
  }
}

void Scheduler::split_or_give_up(const TaskRef& ref, const std::string& why) {
  Job& job = *job_of(ref.job);
  Frame& frame = *frame_of(ref);
  settle(ref, TaskState::Open);
  const TaskArea area = task_of(ref)->area;
  if (frame.splits < options_.max_splits_per_frame && !split_task(area).empty()) {
    const auto first_part = static_cast<int64_t>(frame.tasks.size());
    add_parts(frame, ref.number, first_part);
    actions_.push_back(action::SplitTask{ref, first_part});
    log(ref.job, EventKind::TaskSplit, frame.spec.header.frame, to_string(ref), "",
        "failed on every worker asked; its parts begin with " + to_string(TaskRef{ref.job, ref.frame, first_part}));
    return;
  }
  task_of(ref)->state = TaskState::GivenUp;
  --frame.unsettled;
  ++frame.given_up;
  actions_.push_back(action::GiveUpTask{ref, why});
  log(ref.job, EventKind::TaskGivenUp, frame.spec.header.frame, to_string(ref), "", why);
  check_frame(job, ref.frame);
}

std::vector<std::pair<int64_t, std::string>> Scheduler::keys_of_open_tasks(const action::PinFrame& pin) const {
  const Frame& frame = jobs_.at(pin.job).frames[static_cast<size_t>(pin.frame)];
  FrameHeader header = frame.spec.header;
  header.build = pin.build;
  header.arithmetic_class = pin.arithmetic_class;
  std::vector<std::pair<int64_t, std::string>> keys;
  for (size_t i = 0; i < frame.tasks.size(); ++i)
    if (frame.tasks[i].state == TaskState::Open)
      keys.emplace_back(static_cast<int64_t>(i), result_key(header, frame.tasks[i].area.rect, frame.tasks[i].area.range));
  return keys;
}

void Scheduler::frame_pinned(const action::PinFrame& pin, const std::vector<SettledTask>& reused) {
  const std::string& id = pin.job;
  const int index = pin.frame;
  Job* job = job_of(id);
  if (!job) return;
  Frame& frame = job->frames[static_cast<size_t>(index)];
  const bool first = !frame.row.pinned;
  frame.pin_pending = false;
  frame.row.pinned = true;
  frame.row.build = pin.build;
  frame.row.arithmetic_class = pin.arithmetic_class;
  if (first)
    log(id, EventKind::FramePinned, frame.spec.header.frame, "", "", "pinned to build " + pin.build + " and class " + pin.arithmetic_class);
  for (const SettledTask& row : reused) {
    Task& task = frame.tasks[static_cast<size_t>(row.number)];
    if (task.state != TaskState::Open) continue;
    settle({id, index, row.number}, TaskState::Done);
    --frame.unsettled;
    frame.add_result(row.number, row.result, true);
  }
  if (!reused.empty())
    log(id, EventKind::TaskReused, frame.spec.header.frame, "", "", std::to_string(reused.size()) + " results were there already");
  if (!has_ended(job->row.state)) check_frame(*job, index);
}

void Scheduler::reopen(const TaskRef& ref, const std::string& reason) {
  Job* job = job_of(ref.job);
  Task* task = task_of(ref);
  if (!task || task->state != TaskState::Done) return;
  Frame& frame = *frame_of(ref);
  task->state = TaskState::Open;
  ++frame.unsettled;
  frame.remove_result(ref.number);
  ++frame.revision;
  task->repair = job->spec.out_of_time();
  if (!has_ended(frame.row.state)) frame.row.state = FrameState::Running;
  job->first_unfinished = 0;
  requeue(ref);
  log(ref.job, EventKind::ResultRefused, frame.spec.header.frame, to_string(ref), "", reason);
  if (!has_ended(job->row.state)) update_job(*job);
  if (++task->damages >= options_.max_damages)
    fail_frame(*job, ref.frame,
               "the result of task " + to_string(ref) + " was damaged on the coordinator's disk " + std::to_string(task->damages) +
                   " times: " + reason);
}

void Scheduler::image_lost(const std::string& id, int index) {
  Job* job = job_of(id);
  if (!job) return;
  Frame& frame = job->frames[static_cast<size_t>(index)];
  if (frame.row.state != FrameState::Done && frame.row.state != FrameState::Partial) return;
  ++frame.revision;
  frame.row.state = FrameState::Assembling;
  actions_.push_back(action::SaveFrame{id, index});
  actions_.push_back(action::AssembleFrame{id, index});
  log(id, EventKind::ResultRefused, frame.spec.header.frame, "", "", "the image was damaged at rest and is merged again");
  update_job(*job);
}

void Scheduler::result_refused(const TaskRef& ref, const std::string& reason) {
  Task* task = task_of(ref);
  if (!task || task->state != TaskState::Done) return;
  if (!task->committed_by.empty() &&
      std::find(task->failed_workers.begin(), task->failed_workers.end(), task->committed_by) == task->failed_workers.end())
    task->failed_workers.push_back(task->committed_by);
  const bool again = ++task->refusals < options_.poison_workers;
  reopen(ref, reason);
  if (!again) fail_frame(*job_of(ref.job), ref.frame, reason);
}

std::string Scheduler::waiting_reason(const Job& job, const Frame& frame, Time now) const {
  if (has_ended(job.row.state) || has_ended(frame.row.state) || frame.unsettled == 0) return {};
  if (job.row.paused) return "the job is paused";
  if (!hold_reason_.empty()) return hold_reason_;
  if (const auto lost = lost_scenes_.find(frame.spec.manifest_digest); lost != lost_scenes_.end()) return lost->second;
  if (connected_workers(now) == 0) return "no worker is connected";
  if (available_workers(frame, now) == 0) {
    if (!frame.row.pinned) return "every connected worker is draining or quarantined";
    return "no connected worker has build " + frame.row.build + " and arithmetic class " + frame.row.arithmetic_class +
           "; `woodcock repin` starts it again for those there are";
  }
  return {};
}

}  // namespace woodcock::coordinator
