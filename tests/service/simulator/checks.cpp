#include "tests/service/simulator/checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/service/simulator/inside.h"

namespace woodcock::simulator {

using coordinator::Coordinator;
using coordinator::CoordinatorInside;
using coordinator::Frame;
using coordinator::Job;
using coordinator::LeaseRow;
using coordinator::LoadedJob;
using coordinator::Scheduler;
using coordinator::SettledTask;
using coordinator::Store;
using coordinator::StoreSession;
using coordinator::TaskRef;
using coordinator::TaskState;

namespace {

constexpr Time kLease = 6 * kSecond, kGrace = 2 * kSecond;  // as leader.cpp sets them

const Frame* frame_of(const Scheduler& scheduler, const TaskRef& task) {
  const Job* job = scheduler.find(task.job);
  if (!job || static_cast<size_t>(task.frame) >= job->frames.size()) return nullptr;
  const Frame& frame = job->frames[static_cast<size_t>(task.frame)];
  return task.number < frame.tasks.size() ? &frame : nullptr;
}

}  // namespace

uint64_t epoch_of(const std::string& lease_id) {
  unsigned long long term = 0, number = 0;
  if (std::sscanf(lease_id.c_str(), "L%llu-%llu", &term, &number) != 2) return 0;
  return term << 32 | number;
}

void Checks::started(Coordinator& coordinator) {
  leases_.clear();
  highest_.clear();
  heard_.clear();
  Store& store = CoordinatorInside::store(coordinator);
  store.flush();
  term_ = store.term();
  for (const LeaseRow& row : store.look([](StoreSession& session) { return session.load_leases(); })) {
    Lease lease{row.task, row.worker_id, row.epoch, 0, world_.loop.now()};
    highest_[to_string(row.task)] = std::max(highest_[to_string(row.task)], row.epoch);
    leases_.emplace(row.lease_id, lease);
  }
  const Scheduler& scheduler = CoordinatorInside::scheduler(coordinator);
  size_t live = 0;
  for (const auto& [id, job] : scheduler.jobs()) live += job.leases.size();
  if (live != leases_.size())
    world_.violate(fmt::format("after a restart {} leases live in memory and {} in the database", live, leases_.size()));
  check_acknowledged(coordinator);
  compare_with_database(coordinator);
}

void Checks::after(Coordinator& coordinator, const Step& step) {
  const Scheduler& scheduler = CoordinatorInside::scheduler(coordinator);
  check_leases(scheduler, step);
  ++steps_;
  if (steps_ % 8 == 0) check_counts(scheduler);
  if (steps_ % 32 == 0 && CoordinatorInside::store(coordinator).backlog() == 0) compare_with_database(coordinator);
}

// --- leases ------------------------------------------------------------------------------------------------------

bool Checks::take_in(const v1::SyncRequest& report, bool& restarted) {
  const auto [known, first] = heard_.emplace(report.worker_id(), Heard{report.incarnation(), report.sequence()});
  if (first) return true;
  Heard& heard = known->second;
  restarted = report.incarnation() > heard.incarnation;
  if (!restarted && (report.incarnation() < heard.incarnation || report.sequence() <= heard.sequence)) return false;
  heard = {report.incarnation(), report.sequence()};
  return true;
}

void Checks::check_leases(const Scheduler& scheduler, const Step& given) {
  const Time now = world_.loop.now();
  // A report that came too late counts for nothing.
  Step step = given;
  bool restarted = false;
  if (step.report && !take_in(*step.report, restarted)) step.report = nullptr;
  size_t all = 0;
  bool any_new = false;
  for (const auto& [id, job] : scheduler.jobs()) {
    size_t of_tasks = 0;
    for (size_t f = 0; f < job.frames.size(); ++f)
      for (const auto& [number, task] : job.frames[f].active) {
        of_tasks += task.leases.size();
        if (task.leases.size() > 2) world_.violate(fmt::format("task {}.{}.{} has {} attempts", id, f, number, task.leases.size()));
        for (const std::string& lease : task.leases) any_new = any_new || !leases_.contains(lease);
      }
    all += of_tasks;
    if (of_tasks != job.leases.size()) world_.violate("job " + id + " counts other leases than its tasks have");
  }
  if (all != scheduler.live_leases()) world_.violate("a lease lives that no task knows, or that two have");
  // Most steps end no lease and begin none.
  if (any_new || all != leases_.size()) take_in_leases(scheduler, step, restarted);
  if (step.report) {
    for (const v1::LeaseReport& report : step.report->leases()) {
      const auto known = leases_.find(report.lease_id());
      if (known == leases_.end()) continue;
      Lease& lease = known->second;
      if (lease.worker.empty() || lease.worker != step.report->worker_id() || lease.epoch != report.epoch()) continue;
      if (report.renewal_counter() != lease.counter) lease.renewed = now;
      lease.counter = report.renewal_counter();
    }
  }
  if (std::string_view(step.name) != "tick") return;
  for (const auto& [id, lease] : leases_)
    if (now - lease.renewed > kLease + kGrace)
      world_.violate(fmt::format("lease {} of task {} is {:.1f} s old without a renewal and does not expire", id, to_string(lease.task),
                                 static_cast<double>(now - lease.renewed) / static_cast<double>(kSecond)));
}

/// Those that ended in the step, and those that began.
void Checks::take_in_leases(const Scheduler& scheduler, const Step& step, bool restarted) {
  const Time now = world_.loop.now();
  std::map<std::string, TaskRef> live;
  for (const auto& [id, job] : scheduler.jobs())
    for (size_t f = 0; f < job.frames.size(); ++f)
      for (const auto& [number, task] : job.frames[f].active)
        for (const std::string& lease : task.leases) live.emplace(lease, TaskRef{id, static_cast<int>(f), number});
  for (auto it = leases_.begin(); it != leases_.end();) {
    if (!live.contains(it->first)) {
      check_end(it->first, it->second, scheduler, step, restarted);
      it = leases_.erase(it);
    } else {
      ++it;
    }
  }
  for (const auto& [id, task] : live) {
    if (leases_.contains(id)) continue;
    Lease lease{task, "", epoch_of(id), 0, now};
    if (const auto granted = granted_.find(id); granted != granted_.end()) lease.worker = granted->second;
    uint64_t& highest = highest_[to_string(task)];
    if (lease.epoch <= highest)
      world_.violate(
          fmt::format("lease {} of task {} has epoch {:#x}, and {:#x} was given out before", id, to_string(task), lease.epoch, highest));
    highest = std::max(highest, lease.epoch);
    // Reported in the step in which it came to life: adopted.
    if (step.report)
      for (const v1::LeaseReport& report : step.report->leases())
        if (report.lease_id() == id) {
          if (lease.epoch >> 32 >= term_) world_.violate("lease " + id + " lives, which this leader never granted");
          lease.worker = step.report->worker_id();
          lease.counter = report.renewal_counter();
        }
    leases_.emplace(id, lease);
  }
}

/// A lease ends for a reason, and none but these.
void Checks::check_end(const std::string& id, const Lease& lease, const Scheduler& scheduler, const Step& step, bool restarted) {
  const Frame* frame = frame_of(scheduler, lease.task);
  if (!frame || has_ended(frame->row.state) || !frame->being_rendered() || has_ended(scheduler.find(lease.task.job)->row.state)) return;
  if (const TaskState state = frame->state(lease.task.number); state != TaskState::Open) return;
  if (std::string_view(step.name) == "tick") {
    if (world_.loop.now() - lease.renewed > kLease + kGrace) return;
    return world_.violate(fmt::format("lease {} of task {} expires {:.1f} s after its last renewal", id, to_string(lease.task),
                                      static_cast<double>(world_.loop.now() - lease.renewed) / static_cast<double>(kSecond)));
  }
  if (step.report && step.report->worker_id() == lease.worker) {
    const v1::SyncRequest& report = *step.report;
    if (restarted) return;
    const auto names_it = [&](const auto& item) { return item.lease_id() == id && item.epoch() == lease.epoch; };
    if (std::any_of(report.failures().begin(), report.failures().end(), names_it)) return;
    if (std::any_of(report.releases().begin(), report.releases().end(), names_it)) return;
  }
  world_.violate(fmt::format("lease {} of task {}, held by {}, ends in step \"{}\" without a reason", id, to_string(lease.task),
                             lease.worker, step.name));
}

void Checks::told(const v1::SyncRequest& request, const v1::SyncResponse& response, bool outdated) {
  for (const v1::OfferVerdict& verdict : response.verdicts()) {
    if (verdict.verdict() != v1::VERDICT_COMMITTED && verdict.verdict() != v1::VERDICT_ALREADY_COMMITTED) {
      if (verdict.verdict() != v1::VERDICT_REFUSED) continue;
      // What is committed is answered the same way for ever.
      for (const v1::ResultOffer& offer : request.offers())
        if (const auto known = acknowledged_.find(offer.task_id());
            offer.result_key() == verdict.result_key() && known != acknowledged_.end() && known->second == verdict.result_digest() &&
            !world_.damaged.contains(known->second))
          world_.violate("the result of task " + offer.task_id() + " was acknowledged and is refused: " + verdict.reason());
      continue;
    }
    for (const v1::ResultOffer& offer : request.offers()) {
      if (offer.lease_id() != verdict.lease_id() || offer.result_key() != verdict.result_key()) continue;
      const auto [known, first] = acknowledged_.emplace(offer.task_id(), verdict.result_digest());
      if (!first && known->second != verdict.result_digest()) {
        if (!world_.damaged.contains(known->second)) world_.violate("task " + offer.task_id() + " was acknowledged with two digests");
        known->second = verdict.result_digest();
      }
      if (first) world_.journal.say("coordinator", "acknowledges {} as {:.8}", offer.task_id(), verdict.result_digest());
    }
  }
  if (outdated) return;
  for (const v1::LeaseGrant& grant : response.grants()) granted_[grant.lease_id()] = request.worker_id();
}

// --- jobs --------------------------------------------------------------------------------------------------------

void Checks::check_counts(const Scheduler& scheduler) {
  for (const auto& [id, job] : scheduler.jobs())
    for (const Frame& frame : job.frames) {
      int64_t open = 0, done = 0, given_up = 0, samples = 0;
      for (int64_t n = 0; n < frame.tasks.size(); ++n) {
        const TaskState state = frame.tasks.state(n);
        open += state == TaskState::Open;
        given_up += state == TaskState::GivenUp;
        done += state == TaskState::Done;
        if (state == TaskState::Done) samples += frame.tasks.area(n).samples();
      }
      if (open != frame.unsettled || done != frame.done || given_up != frame.given_up || samples != frame.samples_done)
        world_.violate(fmt::format("a frame of job {} counts {} open, {} done, {} given up and {} samples, and has {}, {}, {} and {}", id,
                                   frame.unsettled, frame.done, frame.given_up, frame.samples_done, open, done, given_up, samples));
    }
}

void Checks::shown(const v1::Job& job, bool extended) {
  Shown& seen = shown_[job.job_id()];
  const bool had_ended = seen.state >= v1::JOB_STATE_DONE;
  if (had_ended && !extended && world_.damaged.empty() && job.state() != seen.state)
    world_.violate(fmt::format("job {} was {} and is {}", job.job_id(), v1::JobState_Name(seen.state), v1::JobState_Name(job.state())));
  if (job.progress().tasks_done() < seen.tasks_done && world_.damaged.empty())
    world_.violate(fmt::format("job {} had {} tasks done and has {}", job.job_id(), seen.tasks_done, job.progress().tasks_done()));
  if (job.last_event() < seen.last_event)
    world_.violate(fmt::format("job {} had event {} and now ends with {}", job.job_id(), seen.last_event, job.last_event()));
  seen = {job.state(), job.progress().tasks_done(), job.last_event()};
}

// --- what is durable ---------------------------------------------------------------------------------------------

void Checks::check_acknowledged(Coordinator& coordinator) {
  // One transaction for all of them.
  const auto rows = CoordinatorInside::store(coordinator).look([this](StoreSession& session) {
    std::vector<std::optional<SettledTask>> found;
    for (const auto& [id, digest] : acknowledged_) found.push_back(session.settled(coordinator::parse_task_id(id).value()));
    return found;
  });
  auto row = rows.begin();
  for (const auto& [id, digest] : acknowledged_) {
    const std::optional<SettledTask>& stored = *row++;
    if (world_.damaged.contains(digest)) continue;
    std::string why;
    if (!stored || stored->state != TaskState::Done)
      world_.violate("the result of task " + id + " was acknowledged and is lost");
    else if (stored->result.digest != digest)
      world_.violate("the result of task " + id + " was acknowledged and is another now");
    else if (!coordinator.blobs().verify(digest, &why))
      world_.violate("the result of task " + id + " was acknowledged: " + why);
  }
}

namespace {

/// What the database has of the jobs in memory.
struct Durable {
  struct Rows {
    std::optional<LoadedJob> loaded;
    std::map<std::pair<int, int64_t>, SettledTask> settled;
  };
  std::map<std::string, Rows> jobs;
  std::set<std::string> leases;
};

Durable read_durable(const Scheduler& scheduler, StoreSession& session) {
  Durable durable;
  for (const auto& [id, job] : scheduler.jobs()) {
    Durable::Rows& rows = durable.jobs[id];
    rows.loaded = session.load_job(id);
    while (rows.loaded && session.load_frames(*rows.loaded, 1000)) {
    }
    for (const SettledTask& row : session.settled_from({id, 0, 0}, {}, false, 10'000))
      rows.settled.emplace(std::pair(row.frame, row.number), row);
  }
  for (const LeaseRow& row : session.load_leases()) durable.leases.insert(row.lease_id);
  return durable;
}

}  // namespace

void Checks::compare_with_database(Coordinator& coordinator) {
  const Scheduler& scheduler = CoordinatorInside::scheduler(coordinator);
  const Durable durable =
      CoordinatorInside::store(coordinator).look([&](StoreSession& session) { return read_durable(scheduler, session); });
  std::set<std::string> in_memory;
  for (const auto& [id, job] : scheduler.jobs()) {
    in_memory.insert(job.leases.begin(), job.leases.end());
    const auto& [loaded, rows] = durable.jobs.at(id);
    if (!loaded) {
      world_.violate("job " + id + " is not in the database");
      continue;
    }
    const Job* const stored = &loaded->job;
    const auto shows = [](const Job& it) {
      return fmt::format("{}{} with event {}, {} samples{}", to_string(it.row.state), it.row.paused ? ", paused," : "", it.row.last_event,
                         it.spec.samples(), it.spec.target ? fmt::format(" and up to {}", it.spec.target->max_samples) : "");
    };
    if (shows(*stored) != shows(job))
      world_.violate(fmt::format("job {} is {} in memory, and {} in the database", id, shows(job), shows(*stored)));
    for (size_t f = 0; f < job.frames.size(); ++f) {
      const Frame& frame = job.frames[f];
      const coordinator::FrameRow& row = stored->frames.at(f).row;
      if (row.pinned != frame.row.pinned || row.build != frame.row.build || row.passes != frame.row.passes ||
          has_ended(row.state) != has_ended(frame.row.state))
        world_.violate(fmt::format("frame {} of job {} is {} in memory and {} in the database", f, id, to_string(frame.row.state),
                                   to_string(row.state)));
      for (int64_t n = 0; n < frame.tasks.size(); ++n) {
        const auto settled = rows.find({static_cast<int>(f), n});
        const TaskState state = settled == rows.end() ? TaskState::Open : settled->second.state;
        if (frame.tasks.state(n) != state)
          world_.violate(fmt::format("task {}.{}.{} has state {} in memory and {} in the database", id, f, n,
                                     static_cast<int>(frame.tasks.state(n)), static_cast<int>(state)));
        if (state != TaskState::Done) continue;
        const std::string task = to_string(TaskRef{id, static_cast<int>(f), n});
        const std::string& digest = settled->second.result.digest;
        const auto [known, first] = settled_.emplace(task, digest);
        if (!first && known->second != digest && !world_.damaged.contains(known->second))
          world_.violate("task " + task + " was settled twice, with two digests");
        known->second = digest;
      }
    }
  }
  if (in_memory != durable.leases)
    world_.violate(fmt::format("{} leases live in memory and {} in the database", in_memory.size(), durable.leases.size()));
}

void Checks::finally(Coordinator& coordinator) {
  if (const size_t live = CoordinatorInside::scheduler(coordinator).live_leases(); live > 0)
    world_.violate(fmt::format("{} leases live when everything has ended", live));
  check_acknowledged(coordinator);
  compare_with_database(coordinator);
}

}  // namespace woodcock::simulator
