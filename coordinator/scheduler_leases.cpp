// Workers and leases: what a report means, who gets which task, when a lease ends.
#include <algorithm>

#include "coordinator/scheduler.h"

namespace woodcock::coordinator {
bool Scheduler::fits(const Worker& worker, const Job& job, const Frame& frame) const {
  return (!frame.row.pinned || (worker.last.build == frame.row.build && worker.last.arithmetic_class == frame.row.arithmetic_class)) &&
         meets(worker, job.spec.policy.demands);
}

bool Scheduler::connected(const Worker& worker, Time now) const {
  return !worker.last.left && worker.last_seen > 0 && now - worker.last_seen <= options_.worker_timeout;
}

bool Scheduler::available(const Worker& worker, Time now) const {
  return connected(worker, now) && !worker.last.draining && !worker.quarantined;
}

int64_t Scheduler::available_workers(const Job& job, const Frame& frame, Time now) const {
  return std::count_if(workers_.begin(), workers_.end(),
                       [&](const auto& w) { return available(w.second, now) && fits(w.second, job, frame); });
}

int64_t Scheduler::connected_workers(Time now) const {
  return std::count_if(workers_.begin(), workers_.end(), [&](const auto& w) { return connected(w.second, now); });
}

std::vector<WorkerView> Scheduler::list_workers(const std::string& after, size_t limit, Time now) const {
  std::vector<WorkerView> list;
  for (auto it = workers_.upper_bound(after); it != workers_.end() && list.size() < limit; ++it) {
    const Worker& worker = it->second;
    if (!worker.last.left && !connected(worker, now)) continue;
    if (now - worker.last_seen > options_.worker_timeout) continue;
    const WorkerCondition condition = worker.last.left       ? WorkerCondition::Left
                                      : worker.last.draining ? WorkerCondition::Draining
                                      : worker.quarantined   ? WorkerCondition::Quarantined
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
  if (Job* job = job_of(lease.task.job)) {
    job->leases.erase(lease.id);
    if (const auto held = job->workers.find(lease.worker_id); --held->second == 0) job->workers.erase(held);
    queue_.lease_ends(lease.task.job, lease.threads);
    take_turn(*job);
  }
  if (const Place place = place_of(lease.task))
    if (ActiveTask* task = place.frame->find_active(lease.task.number)) std::erase(task->leases, lease.id);
  Worker& worker = workers_[lease.worker_id];
  worker.leases.erase(lease.id);
  if (tell_worker) worker.ended[lease.id] = *tell_worker;
  actions_.push_back(action::DropLease{lease.id});
}

void Scheduler::end_leases(Frame& frame, CancelReason reason) {
  std::vector<std::string> all;
  for (const auto& [number, task] : frame.active) all.insert(all.end(), task.leases.begin(), task.leases.end());
  for (const std::string& id : all) end_lease(id, reason);
}

/// Puts an open task without attempts back into the queue.
void Scheduler::requeue(const TaskRef& ref) {
  ActiveTask* task = open_task(ref);
  if (!task || !task->leases.empty() || task->retry) return;
  const Place place = place_of(ref);
  task->retry = true;
  place.frame->retry.insert(ref.number);
  set_ready(*place.job, *place.frame);
}

/// The lease is live from now on; its job got `paths` by it.
void Scheduler::hold(Lease lease, Worker& worker, double paths) {
  const Place place = place_of(lease.task);
  ActiveTask& task = place.frame->active[lease.task.number];
  if (place.frame->row.state == FrameState::Queued) place.frame->row.state = FrameState::Running;
  task.epoch = std::max(task.epoch, lease.epoch);
  task.leases.push_back(lease.id);
  lease.threads = worker.last.threads;
  worker.leases.insert(lease.id);
  place.job->leases.insert(lease.id);
  ++place.job->workers[lease.worker_id];
  queue_.lease_begins(lease.task.job, lease.threads, paths);
  take_turn(*place.job);
  const std::string id = lease.id;
  leases_.emplace(id, std::move(lease));
}

/// No failures: the tasks go to others.
void Scheduler::give_back_all(const std::string& worker_id, Worker& worker, const std::string& why) {
  for (const std::string& id : std::set<std::string>(worker.leases)) {
    const TaskRef task = leases_.at(id).task;
    end_lease(id, std::nullopt);
    log(task.job, EventKind::LeaseReleased, {}, to_string(task), worker_id, why);
    requeue(task);
  }
}

ReportStatus Scheduler::report(const WorkerReport& report, Time now) {
  Worker& worker = workers_[report.worker_id];
  if (worker.last_seen > 0) {
    if (report.incarnation < worker.last.incarnation) return ReportStatus::OlderIncarnation;
    if (report.incarnation == worker.last.incarnation && report.sequence <= worker.last.sequence) return ReportStatus::OlderSequence;
    if (report.incarnation > worker.last.incarnation) {
      // It knows nothing of its leases; what it had finished it will offer from its spool.
      give_back_all(report.worker_id, worker, "the worker was started again");
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
      const Place place = place_of(ref);
      if (!place) continue;
      ++place.frame->scene_failures[report.worker_id];
      if (scene_is_bad(*place.job, *place.frame, now))
        fail_frame(*place.job, ref.frame, why);
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
  if (report.left) give_back_all(report.worker_id, worker, "the worker left");
  // A lease the worker does not speak of never reached it: grant it again.
  for (const std::string& id : worker.leases) leases_.at(id).to_send = !known.contains(id);
  return ReportStatus::Accepted;
}

/// A lease of an earlier leader that was lost with it: it lives on if nobody else has the task.
bool Scheduler::adopt(const LeaseReport& report, const std::string& worker_id, Worker& worker, Time now) {
  const std::optional<TaskRef> ref = parse_task_id(report.task_id);
  const Place place = ref ? place_of(*ref) : Place{};
  if (!place || place.frame->state(ref->number) != TaskState::Open || leases_.contains(report.lease_id)) return false;
  Frame& frame = *place.frame;
  if (!frame.being_rendered() || !frame.row.pinned || !fits(worker, *place.job, frame) || !may_join(worker_id, *place.job)) return false;
  const ActiveTask* known = frame.find_active(ref->number);
  if (known && (!known->leases.empty() || report.epoch <= known->epoch)) return false;
  if (report.epoch >> 32 >= options_.leader_term) return false;
  ActiveTask& task = frame.active[ref->number];
  Lease lease;
  lease.id = report.lease_id;
  lease.task = *ref;
  lease.worker_id = worker_id;
  lease.epoch = report.epoch;
  lease.counter = report.renewal_counter;
  lease.granted = lease.last_change = now;
  lease.phase = report.phase;
  lease.to_send = false;
  frame.retry.erase(ref->number);
  task.retry = false;
  actions_.push_back(action::SaveLease{{lease.id, *ref, worker_id, lease.epoch}});
  hold(std::move(lease), worker, 0);
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
    ActiveTask* task = open_task(lease.task);
    if (!task) continue;
    // One expiry says nothing about the task: machines go away. A task whose leases expire again and again does.
    task_failed(lease.task, lease.worker_id, "lease expired", ++task->expirations >= options_.poison_workers, now);
  }
  forget_workers(now);
  log_waits(now);
  for (auto& [id, job] : jobs_)
    while (!job.recent.empty() && now - job.recent.front().first > 60 * kSecond && job.recent.size() > 1) job.recent.pop_front();
}

/// One that has no lease and was not heard of for long, or not at all since the start: a lease of before named it.
void Scheduler::forget_workers(Time now) {
  std::erase_if(workers_, [&](const auto& entry) {
    const Worker& worker = entry.second;
    return worker.leases.empty() && (worker.last_seen == 0 || now - worker.last_seen > options_.forget_worker);
  });
}

bool Scheduler::may_take(const std::string& worker_id, const Job& job, const Frame& frame, const ActiveTask& task, Time now) const {
  if (std::find(task.failed_workers.begin(), task.failed_workers.end(), worker_id) == task.failed_workers.end()) return true;
  // It failed here: again only if nobody else could take it.
  return std::none_of(workers_.begin(), workers_.end(), [&](const auto& w) {
    return available(w.second, now) && fits(w.second, job, frame) &&
           std::find(task.failed_workers.begin(), task.failed_workers.end(), w.first) == task.failed_workers.end();
  });
}

namespace {

/// Tasks whose results are looked for at once, and how many there are when the next are asked for.
constexpr int64_t kLookUp = 2048, kLookUpAhead = 1024;

}  // namespace

/// Asks for results that are there already, for some tasks beyond those that are leased: rendering need not wait for the others. What is
/// looked up may not be rendered and committed meanwhile.
void Scheduler::look_ahead(Job& job, Frame& frame) {
  const int64_t end = frame.tasks.size();
  while (frame.looking_up <= frame.looked_up && frame.row.pinned && frame.being_rendered() && frame.looked_up < end &&
         frame.looked_up - frame.next_fresh <= kLookUpAhead) {
    action::FindResults find{job.spec.id, static_cast<int>(&frame - job.frames.data()), frame.pinned_header(), {}};
    auto number = frame.tasks.next_open(frame.looked_up, end);
    frame.looked_up = number.value_or(end);
    frame.looking_up = std::min(frame.looked_up + kLookUp, end);
    for (; number && *number < frame.looking_up; number = frame.tasks.next_open(*number + 1, frame.looking_up)) {
      const ActiveTask* task = frame.find_active(*number);
      if (!task || (task->leases.empty() && !task->committing)) find.tasks.emplace_back(*number, frame.tasks.area(*number));
    }
    if (find.tasks.empty())
      frame.looked_up = frame.looking_up;
    else
      actions_.push_back(std::move(find));
  }
}

std::optional<int64_t> Scheduler::next_task(const std::string& worker_id, const Job& job, Frame& frame, Time now) {
  for (const int64_t number : frame.retry)
    if (may_take(worker_id, job, frame, frame.active.at(number), now)) return number;
  while (const auto number = frame.tasks.next_open(frame.next_fresh, frame.looked_up)) {
    frame.next_fresh = *number;
    const ActiveTask* task = frame.find_active(*number);
    if (!task || (task->leases.empty() && !task->retry && !task->committing)) return number;
    ++frame.next_fresh;
  }
  frame.next_fresh = std::max(frame.next_fresh, frame.looked_up);
  return std::nullopt;
}

std::optional<TaskRef> Scheduler::choose(const std::string& worker_id, const Worker& worker, Time now) {
  std::vector<Job*> without;
  std::optional<TaskRef> chosen;
  const auto meets_these = [&](const Demands& demands) { return meets(worker, demands); };
  queue_.visit(meets_these, full_jobs_of(worker), [&](const std::string& job_id) {
    Job& job = jobs_.at(job_id);
    std::optional<size_t> to_pin;
    bool waits = false;
    for (auto it = job.ready.begin(); it != job.ready.end() && !chosen;) {
      Frame& frame = job.frames[*it];
      const bool fits_here = !frame.pin_pending && fits(worker, job, frame);
      if (frame.being_rendered() && fits_here && frame.row.pinned) look_ahead(job, frame);
      const bool used_up = frame.row.pinned && frame.retry.empty() && frame.next_fresh >= frame.tasks.size();
      if (!frame.being_rendered() || frame.unsettled == 0 || used_up) {
        it = job.ready.erase(it);
        continue;
      }
      const size_t index = *it++;
      waits = waits || frame.pin_pending;
      if (!fits_here) continue;
      if (!frame.row.pinned) {
        if (!to_pin) to_pin = index;
        continue;
      }
      if (const std::optional<int64_t> number = next_task(worker_id, job, frame, now))
        chosen = TaskRef{job.spec.id, static_cast<int>(index), *number};
      else
        waits = waits || frame.looking_up > frame.looked_up;
    }
    if (chosen) return true;
    if (to_pin && !waits) {
      Frame& frame = job.frames[*to_pin];
      frame.pin_pending = true;
      frame.pin_build = worker.last.build;
      frame.pin_class = worker.last.arithmetic_class;
      action::PinFrame pin{job.spec.id, static_cast<int>(*to_pin), frame.row};
      pin.row.pinned = true;
      pin.row.build = worker.last.build;
      pin.row.arithmetic_class = worker.last.arithmetic_class;
      actions_.push_back(std::move(pin));
    }
    // While a frame is being pinned, or its results looked up, its job waits rather than lose its turn.
    if (to_pin || waits) return true;
    if (job.ready.empty()) without.push_back(&job);
    return false;
  });
  for (Job* job : without) take_turn(*job);
  return chosen;
}

/// Leases that are worth a copy: the only one of their task, and older than twice what its frame's tasks take.
void Scheduler::find_stragglers(Time now) {
  stragglers_found_ = now;
  std::vector<const Lease*> found;
  for (const auto& [id, lease] : leases_) {
    const Place place = place_of(lease.task);
    if (!place) continue;
    const Frame& frame = *place.frame;
    Time patience = options_.copy_queued_after;
    if (lease.phase > 1) {
      std::vector<int64_t> durations(frame.durations.begin(), frame.durations.end());
      patience = options_.copy_after;
      if (!durations.empty()) {
        std::nth_element(durations.begin(), durations.begin() + static_cast<std::ptrdiff_t>(durations.size() / 2), durations.end());
        patience = std::max(patience, 2 * durations[durations.size() / 2]);
      }
    }
    if (now - lease.granted >= patience) found.push_back(&lease);
  }
  std::sort(found.begin(), found.end(),
            [](const Lease* a, const Lease* b) { return a->granted != b->granted ? a->granted < b->granted : a->id < b->id; });
  stragglers_.clear();
  for (const Lease* lease : found) stragglers_.push_back(lease->id);
}

std::optional<TaskRef> Scheduler::choose_copy(const std::string& worker_id, const Worker& worker, Time now) {
  // Idle workers ask with every change of anything: once a second is often enough to look at all leases.
  if (now - stragglers_found_ >= kSecond) find_stragglers(now);
  for (const std::string& id : stragglers_) {
    const auto it = leases_.find(id);
    if (it == leases_.end() || it->second.worker_id == worker_id) continue;
    const Lease& lease = it->second;
    const Place place = place_of(lease.task);
    if (!place || place.job->row.paused || place.frame->state(lease.task.number) != TaskState::Open) continue;
    if (!fits(worker, *place.job, *place.frame) || !may_join(worker_id, *place.job)) continue;
    const ActiveTask* task = place.frame->find_active(lease.task.number);
    if (!task || task->leases.size() != 1) continue;
    if (std::find(task->failed_workers.begin(), task->failed_workers.end(), worker_id) != task->failed_workers.end()) continue;
    return lease.task;
  }
  return std::nullopt;
}

void Scheduler::lease(const TaskRef& ref, const std::string& worker_id, Worker& worker, Time now) {
  const Place place = place_of(ref);
  Job& job = *place.job;
  Frame& frame = *place.frame;
  ActiveTask& task = frame.active[ref.number];
  Lease lease;
  lease.epoch = options_.leader_term << 32 | ++next_epoch_;
  lease.id = "L" + std::to_string(options_.leader_term) + "-" + std::to_string(next_epoch_);
  if (!options_.leader_id.empty()) lease.id += "-" + options_.leader_id.substr(0, 8);
  lease.task = ref;
  lease.worker_id = worker_id;
  lease.granted = lease.last_change = now;
  const bool copy = !task.leases.empty();
  frame.retry.erase(ref.number);
  task.retry = false;
  actions_.push_back(action::SaveLease{{lease.id, ref, worker_id, lease.epoch}});
  log(ref.job, copy ? EventKind::StragglerCopied : EventKind::LeaseGranted, frame.spec.header.frame, to_string(ref), worker_id, "");
  hold(std::move(lease), worker, static_cast<double>(frame.tasks.area(ref.number).samples()));
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
  if (worker.last.draining || worker.last.left) room = 0;
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
    const Frame& frame = *place_of(lease.task).frame;
    const TaskArea area = frame.tasks.area(lease.task.number);
    answer.grants.push_back({id, lease.epoch, lease.task, area, result_key(frame.pinned_header(), area.rect, area.range)});
  }
  return answer;
}

}  // namespace woodcock::coordinator
