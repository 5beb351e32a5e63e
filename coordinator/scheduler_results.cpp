// Results and failures: what an offer is worth, what a failing task becomes, whose fault it was.
#include <algorithm>

#include "coordinator/scheduler.h"
#include "coordinator/task_grid.h"

namespace woodcock::coordinator {

const char* to_string(FailureCause cause) {
  static constexpr const char* kNames[] = {"crash", "out of memory", "hang", "scene error", "scene mismatch", "transfer", "other"};
  return kNames[static_cast<int>(cause)];
}

OfferDecision verdict_of_settled(const std::optional<SettledTask>& row, const Offer& offer) {
  if (!row) return {OfferStatus::Refused, "there is no such task, or its job has ended"};
  if (row->state == TaskState::Split) return {OfferStatus::Refused, "the task was split"};
  if (row->state == TaskState::GivenUp) return {OfferStatus::Refused, "the task was given up"};
  if (row->result.digest == offer.result.digest) return {OfferStatus::AlreadyCommitted, ""};
  if (row->result.key != offer.result.key) return {OfferStatus::Refused, "the result key is not this task's"};
  return {OfferStatus::Refused, "two results of one key differ: committed " + row->result.digest + ", offered " + offer.result.digest,
          true};
}

void Scheduler::alarm(const TaskRef& task, const std::string& worker_id, const std::string& message) {
  if (const Place place = place_of(task))
    log(task.job, EventKind::DeterminismAlarm, place.frame->spec.header.frame, to_string(task), worker_id, message);
}

OfferDecision Scheduler::offer(const Offer& offer, const std::string& worker_id, bool blob_present, Time now) {
  const std::optional<TaskRef> ref = parse_task_id(offer.task_id);
  if (!ref) return {OfferStatus::Refused, "no such task"};
  const Place place = place_of(*ref);
  if (!place) return {OfferStatus::Settled, ""};
  const Job& job = *place.job;
  Frame& frame = *place.frame;
  const TaskState state = frame.state(ref->number);
  if (state == TaskState::Done || state == TaskState::Split || state == TaskState::GivenUp) return {OfferStatus::Settled, ""};
  if (has_ended(job.row.state)) return {OfferStatus::Refused, "the job has ended"};
  if (has_ended(frame.row.state)) return {OfferStatus::Refused, "the frame has ended"};
  // The same result may be found among those of earlier jobs just now: only one of both may settle the task. Nothing is computed for offers
  // that wait: a call that brings many is looked at again at each commit.
  if (state == TaskState::Committing || frame.is_looked_up(ref->number)) return {OfferStatus::Pending, ""};
  const TaskArea area = frame.tasks.area(ref->number);
  if (!frame.row.pinned || offer.result.key != result_key(frame.pinned_header(), area.rect, area.range)) {
    log(ref->job, EventKind::ResultRefused, frame.spec.header.frame, offer.task_id, worker_id, "the result key is not this task's");
    if (leases_.contains(offer.lease_id) && leases_.at(offer.lease_id).worker_id == worker_id) {
      end_lease(offer.lease_id, std::nullopt);
      task_failed(*ref, worker_id, "a result with a wrong key", true, now);
    }
    return {OfferStatus::Refused, "the result key is not this task's"};
  }
  if (!blob_present) return {OfferStatus::UploadNeeded, ""};
  ActiveTask& task = frame.active[ref->number];
  task.committing = true;
  task.retry = false;
  frame.retry.erase(ref->number);
  ResultRecord result = offer.result;
  result.cost.samples = area.samples();
  result.worker_id = worker_id;
  actions_.push_back(action::CommitTask{*ref, frame.tasks.parent(ref->number), result, worker_id});
  return {OfferStatus::Pending, ""};
}

/// Ends the attempts at a task that is settled, and forgets what is known of it unless its results were bad before.
void Scheduler::settle(Frame& frame, int64_t number) {
  ActiveTask* task = frame.find_active(number);
  if (!task) return;
  frame.retry.erase(number);
  task->committing = task->retry = false;
  while (!task->leases.empty()) end_lease(task->leases.back(), CancelReason::TaskSettled);
  if (task->damages == 0 && task->refusals == 0) frame.active.erase(number);
}

void Scheduler::committed(const action::CommitTask& commit, Time now) {
  const Place place = place_of(commit.task);
  if (!place || place.frame->state(commit.task.number) != TaskState::Committing) return;
  Job* job = place.job;
  Frame& frame = *place.frame;
  const ActiveTask task = *frame.find_active(commit.task.number);
  // The winner's own lease ends by the verdict; the others are told.
  for (const std::string& id : task.leases)
    if (leases_.at(id).worker_id == commit.worker_id) end_lease(id, std::nullopt);
  settle(frame, commit.task.number);
  frame.add_result(commit.task.number, commit.result, false);
  frame.durations.push_back(commit.result.cost.wall_ns);
  if (frame.durations.size() > 101) frame.durations.pop_front();
  job->recent.emplace_back(now, frame.tasks.area(commit.task.number).samples());
  if (job->recent.size() > 10'000) job->recent.pop_front();
  log(commit.task.job, EventKind::TaskCommitted, frame.spec.header.frame, to_string(commit.task), commit.worker_id, "");

  Worker& winner = workers_[commit.worker_id];
  winner.consecutive_failures = winner.blame = 0;
  winner.quarantined = false;
  winner.next_grant = winner.probe_interval = 0;
  blame_others(task, commit.worker_id);
  release_if_ended(commit.task.job);
  check_frame(*job, commit.task.frame);
}

/// A failure counts against a worker only now that the task is known to be good.
void Scheduler::blame_others(const ActiveTask& task, const std::string& winner) {
  for (const std::string& id : task.failed_workers) {
    if (id == winner) continue;
    Worker& worker = workers_[id];
    if (++worker.blame >= options_.quarantine_after) worker.quarantined = true;
  }
}

void Scheduler::task_failed(const TaskRef& ref, const std::string& worker_id, const std::string& why, bool counts, Time now) {
  ActiveTask* task = open_task(ref);
  if (!task) return;
  task->error = why;
  // While its result is looked for it cannot be settled otherwise.
  const Place place = place_of(ref);
  if (counts && !place.frame->is_looked_up(ref.number)) {
    if (std::find(task->failed_workers.begin(), task->failed_workers.end(), worker_id) == task->failed_workers.end())
      task->failed_workers.push_back(worker_id);
    const int64_t others = std::max<int64_t>(1, available_workers(*place.job, *place.frame, now));
    if (static_cast<int64_t>(task->failed_workers.size()) >= std::min<int64_t>(options_.poison_workers, others)) {
      split_or_give_up(ref, why);
      return;
    }
  }
  requeue(ref);
}

/// A scene that cannot be read fails its frame when two workers say so. Where there is one worker only it must say so twice.
bool Scheduler::scene_is_bad(const Job& job, const Frame& frame, Time now) const {
  if (frame.scene_failures.size() != 1) return frame.scene_failures.size() > 1;
  const auto& [only, times] = *frame.scene_failures.begin();
  const bool another = std::any_of(workers_.begin(), workers_.end(), [&, me = std::string_view(only)](const auto& w) {
    return w.first != me && available(w.second, now) && fits(w.second, job, frame);
  });
  return !another && times > 1;
}

/// Nobody knows yet whether task or worker are at fault: others first, the same one where there are none.
void Scheduler::ask_another(const TaskRef& ref, const std::string& worker_id, const std::string& why) {
  ActiveTask* task = open_task(ref);
  if (!task) return;
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
  const Place place = place_of(ref);
  Frame& frame = *place.frame;
  settle(frame, ref.number);
  if (frame.splits < options_.max_splits_per_frame && !split_task(frame.tasks.area(ref.number)).empty()) {
    const int64_t first_part = frame.append_parts(ref.number);
    actions_.push_back(action::SplitTask{ref, first_part});
    log(ref.job, EventKind::TaskSplit, frame.spec.header.frame, to_string(ref), "",
        "failed on every worker asked; its parts begin with " + to_string(TaskRef{ref.job, ref.frame, first_part}));
    set_ready(*place.job, frame);
    return;
  }
  frame.give_up(ref.number, why);
  actions_.push_back(action::GiveUpTask{ref, why});
  log(ref.job, EventKind::TaskGivenUp, frame.spec.header.frame, to_string(ref), "", why);
  check_frame(*place.job, ref.frame);
}

void Scheduler::frame_pinned(const action::PinFrame& pin) {
  Job* job = job_of(pin.job);
  if (!job) return;
  Frame& frame = job->frames[static_cast<size_t>(pin.frame)];
  frame.pin_pending = false;
  frame.row.pinned = true;
  frame.row.build = pin.row.build;
  frame.row.arithmetic_class = pin.row.arithmetic_class;
  log(pin.job, EventKind::FramePinned, frame.spec.header.frame, "", "",
      "pinned to build " + pin.row.build + " and class " + pin.row.arithmetic_class);
  look_ahead(*job, frame);
  release_if_ended(pin.job);
}

void Scheduler::results_found(const action::FindResults& asked, const std::vector<SettledTask>& reused) {
  Job* job = job_of(asked.job);
  if (!job) return;
  Frame& frame = job->frames[static_cast<size_t>(asked.frame)];
  frame.looked_up = frame.looking_up;
  for (const SettledTask& row : reused) {
    if (frame.state(row.number) != TaskState::Open) continue;
    settle(frame, row.number);
    frame.add_result(row.number, row.result, true);
  }
  if (!reused.empty())
    log(asked.job, EventKind::TaskReused, frame.spec.header.frame, "", "", std::to_string(reused.size()) + " results were there already");
  if (has_ended(job->row.state)) return release_if_ended(asked.job);
  // Where all was there the next are asked for, whether or not a worker waits for them.
  frame.next_fresh = frame.tasks.next_open(frame.next_fresh, frame.looked_up).value_or(std::max(frame.next_fresh, frame.looked_up));
  look_ahead(*job, frame);
  set_ready(*job, frame);
  check_frame(*job, asked.frame);
}

bool Scheduler::reopen(const TaskRef& ref, const ResultRecord& result, const std::string& reason) {
  const Place place = place_of(ref);
  if (!place || place.frame->state(ref.number) != TaskState::Done) return false;
  Job& job = *place.job;
  Frame& frame = *place.frame;
  frame.remove_result(ref.number, result);
  ++frame.revision;
  ActiveTask& task = frame.active[ref.number];
  task.repair = job.spec.out_of_time();
  const int damages = ++task.damages;
  if (!has_ended(frame.row.state)) frame.row.state = FrameState::Running;
  job.first_unfinished = 0;
  requeue(ref);
  log(ref.job, EventKind::ResultRefused, frame.spec.header.frame, to_string(ref), "", reason);
  if (!has_ended(job.row.state)) update_job(job);
  if (damages >= options_.max_damages)
    fail_frame(
        job, ref.frame,
        "the result of task " + to_string(ref) + " was damaged on the coordinator's disk " + std::to_string(damages) + " times: " + reason);
  return true;
}

void Scheduler::image_lost(const std::string& id, int index) {
  Job* job = job_of(id);
  if (!job) return;
  Frame& frame = job->frames[static_cast<size_t>(index)];
  if (frame.row.state != FrameState::Done && frame.row.state != FrameState::Partial) return;
  ++frame.revision;
  frame.row.state = FrameState::Assembling;
  save_frame(*job, frame);
  actions_.push_back(action::AssembleFrame{id, index});
  log(id, EventKind::ResultRefused, frame.spec.header.frame, "", "", "the image was damaged at rest and is merged again");
  update_job(*job);
}

bool Scheduler::result_refused(const TaskRef& ref, const ResultRecord& result, const std::string& reason) {
  const Place place = place_of(ref);
  if (!place || place.frame->state(ref.number) != TaskState::Done) return false;
  ActiveTask& task = place.frame->active[ref.number];
  if (!result.worker_id.empty() &&
      std::find(task.failed_workers.begin(), task.failed_workers.end(), result.worker_id) == task.failed_workers.end())
    task.failed_workers.push_back(result.worker_id);
  const bool again = ++task.refusals < options_.poison_workers;
  reopen(ref, result, reason);
  if (!again) fail_frame(*place.job, ref.frame, reason);
  return true;
}

}  // namespace woodcock::coordinator
