// A scheduler under test: a job of 16 tasks, workers that report, time that is told.
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "coordinator/scheduler.h"

namespace woodcock::coordinator {

inline FrameHeader test_header(int width = 128, int height = 128) {
  FrameHeader header;
  header.scene_digest = std::string(64, 'a');
  header.settings_digest = std::string(64, 'b');
  header.width = width;
  header.height = height;
  header.bounds = {0, 0, width, height};
  return header;
}

inline JobSpec test_job(const std::string& id, int priority = 0, int64_t samples = 64) {
  JobSpec job;
  job.id = id;
  job.request_id = "r-" + id;
  job.priority = priority;
  job.tile_size = 32;
  job.range_length = 64;
  job.rounds = {{0, samples}};
  job.settings.samples = samples;
  job.frames = {{test_header(), std::string(64, 'c'), "scene.pbrt"}};
  return job;
}

/// A job as a restart finds it, from its rows.
inline Job restored(const JobSpec& spec, const JobRow& row, const std::vector<FrameRow>& frames, const std::vector<SettledTask>& settled) {
  Job job = make_job(spec);
  job.row = row;
  for (size_t i = 0; i < job.frames.size(); ++i) {
    Frame fresh;
    fresh.spec = job.frames[i].spec;
    fresh.row = frames.at(i);
    std::vector<SplitRow> splits;
    for (const SettledTask& task : settled)
      if (task.state == TaskState::Split && task.frame == static_cast<int>(i)) splits.push_back({task.frame, task.number, task.first_part});
    lay_out(spec, fresh, splits);
    for (const SettledTask& task : settled)
      if (task.frame == static_cast<int>(i)) restore(fresh, task);
    job.frames[i] = std::move(fresh);
  }
  return job;
}

class SchedulerWorld {
 public:
  explicit SchedulerWorld(uint64_t term = 1) : scheduler(make_options(term)) {}

  static SchedulerOptions make_options(uint64_t term) {
    SchedulerOptions options;
    options.leader_term = term;
    return options;
  }

  WorkerReport report(const std::string& worker) {
    WorkerReport r;
    r.worker_id = worker;
    r.host_name = worker;
    r.build = "build";
    r.arithmetic_class = "class";
    r.incarnation = incarnation[worker];
    r.sequence = ++sequence[worker];
    for (const auto& [id, grant] : held[worker]) r.leases.push_back({id, to_string(grant.task), grant.epoch, ++counter, 5, 0});
    return r;
  }

  /// One Sync: report, then what is granted; pins are answered at once. Cancelled leases are dropped.
  std::vector<Grant> sync(const std::string& worker, WorkerReport r) {
    EXPECT_EQ(scheduler.report(r, now), ReportStatus::Accepted);
    std::vector<Grant> all;
    for (bool again = true; again;) {
      const Answer answer = scheduler.answer(worker, now);
      for (const auto& [id, reason] : answer.cancellations) {
        held[worker].erase(id);
        cancelled[id] = reason;
      }
      for (const Grant& grant : answer.grants) {
        held[worker].emplace(grant.lease_id, grant);
        all.push_back(grant);
      }
      again = settle();
    }
    return all;
  }
  std::vector<Grant> sync(const std::string& worker) { return sync(worker, report(worker)); }

  /// Carries actions out as a database that never fails. True when a pin was answered.
  bool settle() {
    bool pinned = false;
    for (const Action& any : scheduler.take_actions()) {
      if (const auto* pin = std::get_if<action::PinFrame>(&any)) {
        scheduler.frame_pinned(*pin);
        pinned = true;
      } else if (const auto* find = std::get_if<action::FindResults>(&any)) {
        scheduler.results_found(*find, earlier_results(*find));
        pinned = true;
      } else if (const auto* commit = std::get_if<action::CommitTask>(&any)) {
        commits.push_back(commit->task);
        SettledTask& row = settled[to_string(commit->task)];
        row.result = commit->result;
        scheduler.committed(*commit, now);
      } else if (const auto* ready = std::get_if<action::AssembleFrame>(&any)) {
        assembled.push_back(ready->job);
      } else if (const auto* log = std::get_if<action::LogEvent>(&any)) {
        ++events[log->event.kind];
      }
    }
    return pinned;
  }

  // Grants are taken by value: what they are called with may lie in `held`.
  OfferStatus finish(const std::string& worker, Grant grant, const std::string& digest = std::string(64, 'd')) {
    Offer offer{grant.lease_id, to_string(grant.task), grant.epoch, {grant.result_key, digest, 100, {1, kSecond, 1}, {}}};
    const OfferStatus status = decide(offer, worker);
    held[worker].erase(grant.lease_id);
    settle();
    return status;
  }

  /// As the coordinator decides, with the rows of what was committed.
  OfferStatus decide(const Offer& offer, const std::string& worker) {
    OfferDecision decision = scheduler.offer(offer, worker, true, now);
    if (decision.status != OfferStatus::Settled) return decision.status;
    const auto row = settled.find(offer.task_id);
    decision = verdict_of_settled(row == settled.end() ? std::nullopt : std::optional(row->second), offer);
    if (decision.alarm) scheduler.alarm(*parse_task_id(offer.task_id), worker, decision.reason);
    return decision.status;
  }

  std::vector<Grant> fail(const std::string& worker, Grant grant, FailureCause cause = FailureCause::Crash) {
    held[worker].erase(grant.lease_id);
    WorkerReport r = report(worker);
    r.failures.push_back({grant.lease_id, to_string(grant.task), grant.epoch, cause, "it crashed", ""});
    return sync(worker, r);
  }

  /// A second a task: `worker` fails, or finishes, one that it holds.
  void fail_tasks(const std::string& worker, int tasks) {
    for (int i = 0; i < tasks; ++i) {
      now += kSecond;
      sync(worker);
      ASSERT_FALSE(held[worker].empty());
      fail(worker, held[worker].begin()->second);
    }
  }
  void finish_tasks(const std::string& worker, int tasks) {
    for (int i = 0; i < tasks; ++i) {
      now += kSecond;
      sync(worker);
      ASSERT_FALSE(held[worker].empty());
      finish(worker, held[worker].begin()->second);
    }
  }

  /// All that `worker` holds and gets until nothing is left, committed.
  void finish_everything(const std::string& worker) {
    for (int i = 0; i < 10'000; ++i) {
      now += 10 * kSecond;
      sync(worker);
      if (held[worker].empty()) return;
      const Grant grant = held[worker].begin()->second;
      finish(worker, grant);
    }
    FAIL() << "the job does not end";
  }

  Time now = 1000 * kSecond;
  Scheduler scheduler;
  std::map<std::string, std::map<std::string, Grant>> held;
  std::map<std::string, uint64_t> sequence, incarnation;
  std::map<std::string, CancelReason> cancelled;
  std::map<EventKind, int> events;
  std::vector<TaskRef> commits;
  std::map<std::string, SettledTask> settled;  ///< by task id
  /// What an earlier job rendered: nothing.
  std::function<std::vector<SettledTask>(const action::FindResults&)> earlier_results = [](const action::FindResults&) {
    return std::vector<SettledTask>();
  };
  std::vector<std::string> assembled;
  uint64_t counter = 0;
};

}  // namespace woodcock::coordinator
