// Workers and leases: what a report means, who gets which task, when a lease ends.
#include <algorithm>

#include "coordinator/scheduler.h"

namespace woodcock::coordinator {

bool Scheduler::fits(const Worker& worker, const Frame& frame) const {
  return !frame.row.pinned || (worker.last.build == frame.row.build && worker.last.arithmetic_class == frame.row.arithmetic_class);
}

bool Scheduler::connected(const Worker& worker, Time now) const {
  return worker.last_seen > 0 && now - worker.last_seen <= options_.worker_timeout;
}

bool Scheduler::available(const Worker& worker, Time now) const {
  return connected(worker, now) && !worker.last.draining && !worker.quarantined;
}

int64_t Scheduler::available_workers(const Frame& frame, Time now) const {
  return std::count_if(workers_.begin(), workers_.end(), [&](const auto& w) { return available(w.second, now) && fits(w.second, frame); });
}

int64_t Scheduler::connected_workers(Time now) const {
  return std::count_if(workers_.begin(), workers_.end(), [&](const auto& w) { return connected(w.second, now); });
}

std::vector<WorkerView> Scheduler::list_workers(const std::string& after, size_t limit, Time now) const {
  std::vector<WorkerView> list;
  for (auto it = workers_.upper_bound(after); it != workers_.end() && list.size() < limit; ++it) {
    const Worker& worker = it->second;
    if (!connected(worker, now)) continue;
    const WorkerCondition condition = worker.last.draining ? WorkerCondition::Draining
                                      : worker.quarantined ? WorkerCondition::Quarantined
                                                           : WorkerCondition::Ready;
    list.push_back({&worker.last, condition, worker.leases.size(), now - worker.last_seen});
  }
  return list;
}

/// Ends a lease without saying what becomes of its task.
void Scheduler::end_lease(const std::string& lease_id, std::optional<CancelReason> tell_worker) {
  const auto it = leases_.find(lease_id);
  if (it == leases_.end()) return;
  const Lease lease = it->second;
  leases_.erase(it);
  if (Task* task = task_of(lease.task)) std::erase(task->leases, lease.id);
  Worker& worker = workers_[lease.worker_id];
  worker.leases.erase(lease.id);
  if (tell_worker) worker.ended[lease.id] = *tell_worker;
  actions_.push_back(action::DropLease{lease.id});
}

/// Puts an open task without attempts back into the queue.
void Scheduler::requeue(const TaskRef& ref) {
  Frame* frame = frame_of(ref);
  Task* task = task_of(ref);
  if (!task || task->state != TaskState::Open || !task->leases.empty() || task->retry) return;
  task->retry = true;
  frame->retry.insert(ref.number);
}

ReportStatus Scheduler::report(const WorkerReport& report, Time now) {
  Worker& worker = workers_[report.worker_id];
  if (worker.last_seen > 0) {
    if (report.incarnation < worker.last.incarnation) return ReportStatus::OlderIncarnation;
    if (report.incarnation == worker.last.incarnation && report.sequence <= worker.last.sequence) return ReportStatus::OlderSequence;
    if (report.incarnation > worker.last.incarnation) {
      // It was started again and knows nothing of its leases; what it had finished it will offer from its spool.
      for (const std::string& id : std::set<std::string>(worker.leases)) {
        const TaskRef task = leases_.at(id).task;
        end_lease(id, std::nullopt);
        log(task.job, EventKind::LeaseReleased, {}, to_string(task), report.worker_id, "the worker was started again");
        requeue(task);
      }
      worker.ended.clear();
    }
  }
  worker.last = report;
  worker.last_seen = now;

  std::set<std::string> known(report.offered_leases.begin(), report.offered_leases.end());
  std::set<std::string> reported;
  for (const LeaseReport& item : report.leases) {
    reported.insert(item.lease_id);
    known.insert(item.lease_id);
    const auto it = leases_.find(item.lease_id);
    if (it == leases_.end() || it->second.worker_id != report.worker_id) {
      if (!worker.ended.contains(item.lease_id) && !adopt(item, report.worker_id, worker, now))
        worker.ended[item.lease_id] = CancelReason::UnknownLease;
      continue;
    }
    Lease& lease = it->second;
    if (item.epoch != lease.epoch) {
      worker.ended[item.lease_id] = CancelReason::StaleEpoch;
      continue;
    }
    if (item.renewal_counter != lease.counter) {
      lease.counter = item.renewal_counter;
      lease.last_change = now;
    }
    lease.phase = item.phase;
    lease.samples_done = item.samples_done;
  }
  std::erase_if(worker.ended, [&](const auto& e) { return !reported.contains(e.first); });

  for (const FailureReport& failure : report.failures) {
    known.insert(failure.lease_id);
    const auto it = leases_.find(failure.lease_id);
    if (it == leases_.end() || it->second.worker_id != report.worker_id || it->second.epoch != failure.epoch) continue;
    const TaskRef ref = it->second.task;
    end_lease(failure.lease_id, std::nullopt);
    const std::string why = std::string(to_string(failure.cause)) + (failure.message.empty() ? "" : ": " + failure.message);
    actions_.push_back(action::RecordAttempt{ref, {report.worker_id, report.host_name, failure.epoch, 0, why, failure.log_excerpt}});
    log(ref.job, EventKind::TaskFailed, {}, to_string(ref), report.worker_id, why);
    ++worker.consecutive_failures;
    // A worker that fails again and again is asked ever less often: a moment first, half a minute at the end.
    if (worker.consecutive_failures >= 3)
      worker.next_grant = now + std::min<Time>(kSecond / 4 << std::min(worker.consecutive_failures - 3, 7), 30 * kSecond);
    if ((failure.cause == FailureCause::SceneError || failure.cause == FailureCause::SceneMismatch) && failure.scene_checked) {
      Frame& frame = *frame_of(ref);
      ++frame.scene_failures[report.worker_id];
      if (scene_is_bad(frame, now))
        fail_frame(*job_of(ref.job), ref.frame, why);
      else
        ask_another(ref, report.worker_id, why);
      continue;
    }
    task_failed(ref, report.worker_id, why, failure.cause != FailureCause::Transfer, now);
  }
  for (const LeaseRelease& release : report.releases) {
    known.insert(release.lease_id);
    const auto it = leases_.find(release.lease_id);
    if (it == leases_.end() || it->second.worker_id != report.worker_id || it->second.epoch != release.epoch) continue;
    const TaskRef task = it->second.task;
    end_lease(release.lease_id, std::nullopt);
    log(task.job, EventKind::LeaseReleased, {}, to_string(task), report.worker_id, "given back");
    requeue(task);
  }
  // A lease the worker does not speak of never reached it: grant it again.
  for (const std::string& id : worker.leases) leases_.at(id).to_send = !known.contains(id);
  return ReportStatus::Accepted;
}

/// A lease of an earlier leader that was lost with it: it lives on if nobody else has the task.
bool Scheduler::adopt(const LeaseReport& report, const std::string& worker_id, Worker& worker, Time now) {
  const std::optional<TaskRef> ref = parse_task_id(report.task_id);
  Task* task = ref ? task_of(*ref) : nullptr;
  if (!task || task->state != TaskState::Open || !task->leases.empty() || leases_.contains(report.lease_id)) return false;
  const Frame& frame = *frame_of(*ref);
  if (!frame.being_rendered() || !frame.row.pinned || !fits(worker, frame)) return false;
  if (report.epoch <= task->epoch || report.epoch >> 32 >= options_.leader_term) return false;
  Lease lease;
  lease.id = report.lease_id;
  lease.task = *ref;
  lease.worker_id = worker_id;
  lease.epoch = report.epoch;
  lease.counter = report.renewal_counter;
  lease.granted = lease.last_change = now;
  lease.phase = report.phase;
  lease.to_send = false;
  task->epoch = report.epoch;
  task->leases.push_back(lease.id);
  if (task->retry) {
    frame_of(*ref)->retry.erase(ref->number);
    task->retry = false;
  }
  worker.leases.insert(lease.id);
  actions_.push_back(action::SaveLease{{lease.id, *ref, worker_id, lease.epoch}});
  leases_.emplace(lease.id, lease);
  return true;
}

void Scheduler::tick(Time now) {
  count_time(now);
  repin_overdue(now);
  std::vector<std::string> expired;
  for (const auto& [id, lease] : leases_)
    if (now - lease.last_change > options_.lease + options_.grace) expired.push_back(id);
  std::sort(expired.begin(), expired.end());
  for (const std::string& id : expired) {
    const auto it = leases_.find(id);
    if (it == leases_.end()) continue;
    const Lease lease = it->second;
    end_lease(id, CancelReason::LeaseExpired);
    log(lease.task.job, EventKind::LeaseExpired, {}, to_string(lease.task), lease.worker_id, "no progress within the lease");
    Task* task = task_of(lease.task);
    if (!task || task->state != TaskState::Open) continue;
    // One expiry says nothing about the task: machines go away. A task whose leases expire again and again does.
    task_failed(lease.task, lease.worker_id, "lease expired", ++task->expirations >= options_.poison_workers, now);
  }
  for (auto& [id, job] : jobs_)
    while (!job.recent.empty() && now - job.recent.front().first > 60 * kSecond && job.recent.size() > 1) job.recent.pop_front();
}

bool Scheduler::may_take(const std::string& worker_id, const Frame& frame, const Task& task, Time now) const {
  if (std::find(task.failed_workers.begin(), task.failed_workers.end(), worker_id) == task.failed_workers.end()) return true;
  // It failed here: again only if nobody else could take it.
  return std::none_of(workers_.begin(), workers_.end(), [&](const auto& w) {
    return available(w.second, now) && fits(w.second, frame) &&
           std::find(task.failed_workers.begin(), task.failed_workers.end(), w.first) == task.failed_workers.end();
  });
}

std::optional<int64_t> Scheduler::next_task(const std::string& worker_id, Frame& frame, Time now) {
  for (const int64_t number : frame.retry)
    if (may_take(worker_id, frame, frame.tasks[static_cast<size_t>(number)], now)) return number;
  for (; frame.next_fresh < frame.tasks.size(); ++frame.next_fresh) {
    const Task& task = frame.tasks[frame.next_fresh];
    if (task.state == TaskState::Open && task.leases.empty() && !task.retry) return static_cast<int64_t>(frame.next_fresh);
  }
  return std::nullopt;
}

std::optional<TaskRef> Scheduler::choose(const std::string& worker_id, const Worker& worker, Time now) {
  std::vector<Job*> order;
  for (auto& [id, job] : jobs_)
    if (!has_ended(job.row.state) && !job.row.paused && job.first_unfinished < job.frames.size()) order.push_back(&job);
  std::stable_sort(order.begin(), order.end(), [](const Job* a, const Job* b) {
    return a->spec.priority != b->spec.priority ? a->spec.priority > b->spec.priority : a->served < b->served;
  });
  for (Job* job : order) {
    std::optional<size_t> to_pin;
    bool pinning = false;
    for (size_t i = job->first_unfinished; i < job->frames.size(); ++i) {
      Frame& frame = job->frames[i];
      if (!frame.being_rendered() || frame.unsettled == 0) continue;
      pinning = pinning || frame.pin_pending;
      if (frame.pin_pending || !fits(worker, frame)) continue;
      if (!frame.row.pinned) {
        if (!to_pin) to_pin = i;
        continue;
      }
      if (const std::optional<int64_t> number = next_task(worker_id, frame, now))
        return TaskRef{job->spec.id, static_cast<int>(i), *number};
    }
    if (to_pin && !pinning) {
      job->frames[*to_pin].pin_pending = true;
      actions_.push_back(action::PinFrame{job->spec.id, static_cast<int>(*to_pin), worker.last.build, worker.last.arithmetic_class});
    }
    // While a frame is being pinned its job waits rather than lose its turn.
    if (to_pin || pinning) return std::nullopt;
  }
  return std::nullopt;
}

std::optional<TaskRef> Scheduler::choose_copy(const std::string& worker_id, const Worker& worker, Time now) const {
  const Lease* best = nullptr;
  for (const auto& [id, lease] : leases_) {
    if (lease.worker_id == worker_id) continue;
    const auto job = jobs_.find(lease.task.job);
    if (job == jobs_.end() || job->second.row.paused) continue;
    const Frame& frame = job->second.frames[static_cast<size_t>(lease.task.frame)];
    const Task& task = frame.tasks[static_cast<size_t>(lease.task.number)];
    if (task.state != TaskState::Open || task.leases.size() != 1 || !fits(worker, frame)) continue;
    if (std::find(task.failed_workers.begin(), task.failed_workers.end(), worker_id) != task.failed_workers.end()) continue;
    Time patience = options_.copy_queued_after;
    if (lease.phase > 1) {
      std::vector<int64_t> durations(frame.durations.begin(), frame.durations.end());
      patience = options_.copy_after;
      if (!durations.empty()) {
        std::nth_element(durations.begin(), durations.begin() + static_cast<std::ptrdiff_t>(durations.size() / 2), durations.end());
        patience = std::max(patience, 2 * durations[durations.size() / 2]);
      }
    }
    if (now - lease.granted < patience) continue;
    if (!best || lease.granted < best->granted || (lease.granted == best->granted && lease.id < best->id)) best = &lease;
  }
  return best ? std::optional<TaskRef>(best->task) : std::nullopt;
}

void Scheduler::lease(const TaskRef& ref, const std::string& worker_id, Worker& worker, Time now) {
  Job& job = *job_of(ref.job);
  Frame& frame = *frame_of(ref);
  Task& task = *task_of(ref);
  Lease lease;
  lease.epoch = options_.leader_term << 32 | ++next_epoch_;
  lease.id = "L" + std::to_string(options_.leader_term) + "-" + std::to_string(next_epoch_);
  if (!options_.leader_id.empty()) lease.id += "-" + options_.leader_id.substr(0, 8);
  lease.task = ref;
  lease.worker_id = worker_id;
  lease.granted = lease.last_change = now;
  const bool copy = !task.leases.empty();
  task.epoch = lease.epoch;
  task.leases.push_back(lease.id);
  if (task.retry) {
    frame.retry.erase(ref.number);
    task.retry = false;
  }
  worker.leases.insert(lease.id);
  job.served += static_cast<double>(task.area.samples());
  actions_.push_back(action::SaveLease{{lease.id, ref, worker_id, lease.epoch}});
  log(ref.job, copy ? EventKind::StragglerCopied : EventKind::LeaseGranted, frame.spec.header.frame, to_string(ref), worker_id, "");
  leases_.emplace(lease.id, std::move(lease));
  if (frame.row.state == FrameState::Queued) frame.row.state = FrameState::Running;
  if (!job.leased_ever) {
    job.leased_ever = true;
    update_job(job);
  }
}

Answer Scheduler::answer(const std::string& worker_id, Time now) {
  Answer answer;
  const auto it = workers_.find(worker_id);
  if (it == workers_.end()) return answer;
  Worker& worker = it->second;
  for (const auto& [id, reason] : worker.ended) answer.cancellations.emplace_back(id, reason);

  // One task more than it renders at once, so that the next one is there when a slot falls free.
  size_t room = static_cast<size_t>(worker.last.slots) + 1;
  if (worker.quarantined) {
    room = now >= worker.next_grant ? 1 : 0;
    answer.notice = "quarantined: tasks failed here and succeeded elsewhere";
  } else if (worker.consecutive_failures >= 3) {
    room = now >= worker.next_grant ? 1 : 0;
  }
  if (!hold_reason_.empty()) {
    answer.notice = hold_reason_;
    room = 0;
  }
  if (worker.last.draining) room = 0;
  while (worker.leases.size() < room) {
    std::optional<TaskRef> task = choose(worker_id, worker, now);
    if (!task && worker.leases.size() < static_cast<size_t>(worker.last.slots)) task = choose_copy(worker_id, worker, now);
    if (!task) break;
    lease(*task, worker_id, worker, now);
    if (worker.quarantined) {
      worker.probe_interval = std::min<Time>(std::max(2 * worker.probe_interval, options_.first_probe), 300 * kSecond);
      worker.next_grant = now + worker.probe_interval;
    }
  }
  for (const std::string& id : worker.leases) {
    Lease& lease = leases_.at(id);
    if (!lease.to_send) continue;
    lease.to_send = false;
    const Frame& frame = *frame_of(lease.task);
    const Task& task = *task_of(lease.task);
    answer.grants.push_back({id, lease.epoch, lease.task, task.area, result_key(frame.pinned_header(), task.area.rect, task.area.range)});
  }
  return answer;
}

}  // namespace woodcock::coordinator
