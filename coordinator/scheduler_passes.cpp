// Adaptive frames: what a pass is made of, and what follows it.
#include <fmt/format.h>

#include <algorithm>

#include "coordinator/scheduler.h"
#include "coordinator/task_grid.h"

namespace woodcock::coordinator {
namespace {

/// A tick that comes late counts as this at most: nobody knows what happened meanwhile.
constexpr Time kLongestTick = 5 * kSecond;

}  // namespace

void Scheduler::count_time(Time now) {
  const Time elapsed = std::clamp<Time>(last_tick_ > 0 ? now - last_tick_ : 0, 0, kLongestTick);
  last_tick_ = now;
  for (auto& [id, job] : jobs_) {
    if (job.leases.empty() || !job.spec.time_limit) continue;
    job.spec.time_limit->spent += static_cast<double>(elapsed) / static_cast<double>(kSecond);
    if (job.spec.out_of_time()) end_by_time(job);
  }
}

/// Blocks of the pass that runs keep what they had before, where a task of theirs is not done.
void Scheduler::end_by_time(Job& job) {
  for (size_t i = 0; i < job.frames.size(); ++i) {
    Frame& frame = job.frames[i];
    if (has_ended(frame.row.state) || frame.to_be_assembled()) continue;
    // A result that is on its way to the disk may be the only one; a damaged one is replaced first.
    const bool wait = std::any_of(frame.active.begin(), frame.active.end(), [&](const auto& entry) {
      return entry.second.committing || (entry.second.repair && frame.state(entry.first) == TaskState::Open);
    });
    if (wait) continue;
    const auto index = static_cast<int>(i);
    end_leases(frame, CancelReason::JobEnded);
    for (auto& [number, task] : frame.active)
      if (task.epoch > 0) requeue({job.spec.id, index, number});
    if (frame.done == 0) {
      fail_frame(job, index, job.spec.time_limit->reason() + " before anything was rendered");
      continue;
    }
    frame.deciding = false;
    frame.row.state = FrameState::Assembling;
    save_frame(job, frame);
    actions_.push_back(action::AssembleFrame{job.spec.id, index});
  }
  save_job(job);
  update_job(job);
}

bool Scheduler::set_target(const std::string& id, const SamplingTarget& target, std::optional<double> seconds) {
  Job* job = job_of(id);
  if (!job || !can_be_extended(*job)) return false;
  if (job->spec.target == target && !seconds && !job->spec.time_limit) return true;
  job->spec.target = target;
  job->spec.time_limit.reset();
  if (seconds) job->spec.time_limit = TimeLimit{*seconds};
  job->spec.settings.samples = target.max_samples;
  if (job->spec.quote) job->spec.quote->extended = true;
  job->row.ended_unix_ms = 0;
  log(id, EventKind::Extended, {}, "", "",
      fmt::format("extended to a relative error of {}, {} samples per pixel at most", target.error, target.max_samples));
  for (size_t i = 0; i < job->frames.size(); ++i) {
    Frame& frame = job->frames[i];
    if (frame.unsettled > 0 && frame.being_rendered()) continue;
    wake_frame(*job, static_cast<int>(i));
    check_frame(*job, static_cast<int>(i));
  }
  job->first_unfinished = 0;
  update_job(*job);
  save_job(*job);
  return true;
}

bool Scheduler::pass_decided(const std::string& id, int index, const Decision& decision, const FrameStatistics& statistics,
                             int64_t max_tasks) {
  Job* job = job_of(id);
  if (!job) return true;
  Frame& frame = job->frames[static_cast<size_t>(index)];
  // Reopened, cancelled or given another target meanwhile: it will be decided again.
  if (!frame.to_be_assembled()) return true;
  int64_t tasks = pass_task_count(frame.planned_map(job->spec.samples()), decision.counts, job->spec.tile_size);
  for (const Frame& other : job->frames) tasks += other.tasks.size();
  if (tasks > max_tasks) return false;
  frame.deciding = false;
  frame.row.state = FrameState::Running;
  frame.row.statistics = statistics;
  frame.row.passes.push_back(decision.counts);
  frame.append_pass(job->spec, frame.row.passes.size() - 1);
  job->first_unfinished = 0;
  save_frame(*job, frame);
  if (job->spec.time_limit) save_job(*job);
  log(id, EventKind::PassDecided, frame.spec.header.frame, "", "",
      fmt::format("frame {}: error {:.3g} % of {:.3g} % after pass {}; {} of {} blocks go on", frame.spec.header.frame,
                  100 * decision.error, 100 * job->spec.target->error, frame.row.passes.size(), decision.active, decision.counts.size()));
  look_ahead(*job, frame);
  set_ready(*job, frame);
  update_job(*job);
  return true;
}

}  // namespace woodcock::coordinator
