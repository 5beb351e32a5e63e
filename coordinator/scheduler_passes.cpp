// Adaptive frames: what a pass is made of, and what follows it.
#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "coordinator/scheduler.h"
#include "coordinator/task_grid.h"

namespace woodcock::coordinator {
namespace {

/// A tick that comes late counts as this at most: nobody knows what happened meanwhile.
constexpr Time kLongestTick = 5 * kSecond;

}  // namespace

SampleMap Frame::planned_map(size_t passes, int64_t base) const {
  SampleMap map{spec.header.bounds, {}};
  if (passes > 0)
    map.counts = row.passes[passes - 1];
  else
    map.counts.assign(map.grid().size(), base);
  return map;
}

SampleMap Frame::settled_map(int64_t base) const {
  SampleMap map = planned_map(base);
  for (const Task& task : tasks) {
    if (task.state == TaskState::Done || task.state == TaskState::Split || task.area.range.begin < base) continue;
    for_each_block(map.grid(), task.area.rect, [&](size_t b) {
      int64_t before = base;
      for (const std::vector<int64_t>& pass : row.passes)
        if (pass[b] <= task.area.range.begin) before = std::max(before, pass[b]);
      map.counts[b] = std::min(map.counts[b], before);
    });
  }
  return map;
}

std::vector<bool> Frame::closed_blocks() const {
  const BlockGrid grid{spec.header.bounds};
  std::vector<bool> closed(grid.size(), false);
  for (const Task& task : tasks)
    if (task.state == TaskState::GivenUp) for_each_block(grid, task.area.rect, [&](size_t b) { closed[b] = true; });
  return closed;
}

/// Asks for results that are there already, as when the frame was pinned.
void Scheduler::look_up(Job& job, Frame& frame) {
  frame.pin_pending = true;
  actions_.push_back(
      action::PinFrame{job.spec.id, static_cast<int>(&frame - job.frames.data()), frame.row.build, frame.row.arithmetic_class});
}

void Scheduler::count_time(Time now) {
  const Time elapsed = std::clamp<Time>(last_tick_ > 0 ? now - last_tick_ : 0, 0, kLongestTick);
  last_tick_ = now;
  std::set<std::string> rendered;
  for (const auto& [id, lease] : leases_) rendered.insert(lease.task.job);
  for (const std::string& id : rendered) {
    Job& job = *job_of(id);
    if (!job.spec.time_limit) continue;
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
    const bool wait = std::any_of(frame.tasks.begin(), frame.tasks.end(), [](const Task& task) {
      return task.state == TaskState::Committing || (task.repair && task.state == TaskState::Open);
    });
    if (wait) continue;
    const auto index = static_cast<int>(i);
    for (size_t number = 0; number < frame.tasks.size(); ++number) {
      Task& task = frame.tasks[number];
      while (!task.leases.empty()) end_lease(task.leases.back(), CancelReason::JobEnded);
      if (task.epoch > 0) requeue({job.spec.id, index, static_cast<int64_t>(number)});
    }
    if (frame.done == 0) {
      fail_frame(job, index, job.spec.time_limit->reason() + " before anything was rendered");
      continue;
    }
    frame.deciding = false;
    frame.row.state = FrameState::Assembling;
    actions_.push_back(action::SaveFrame{job.spec.id, index});
    actions_.push_back(action::AssembleFrame{job.spec.id, index});
  }
  actions_.push_back(action::SaveJob{job.spec.id});
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
  actions_.push_back(action::SaveJob{id});
  for (size_t i = 0; i < job->frames.size(); ++i) {
    Frame& frame = job->frames[i];
    if (frame.unsettled > 0 && frame.being_rendered()) continue;
    wake_frame(*job, static_cast<int>(i));
    check_frame(*job, static_cast<int>(i));
  }
  job->first_unfinished = 0;
  update_job(*job);
  return true;
}

bool Scheduler::pass_decided(const std::string& id, int index, const Decision& decision, const FrameStatistics& statistics,
                             int64_t max_tasks) {
  Job* job = job_of(id);
  if (!job) return true;
  Frame& frame = job->frames[static_cast<size_t>(index)];
  // Reopened, cancelled or given another target meanwhile: it will be decided again.
  if (!frame.to_be_assembled()) return true;
  auto tasks = static_cast<int64_t>(pass_tasks(frame.planned_map(job->spec.samples()), decision.counts, job->spec.tile_size).size());
  for (const Frame& other : job->frames) tasks += static_cast<int64_t>(other.tasks.size());
  if (tasks > max_tasks) return false;
  frame.deciding = false;
  frame.row.state = FrameState::Running;
  frame.row.statistics = statistics;
  frame.row.passes.push_back(decision.counts);
  append_pass(*job, frame, frame.row.passes.size() - 1);
  job->first_unfinished = 0;
  actions_.push_back(action::SaveFrame{id, index});
  if (job->spec.time_limit) actions_.push_back(action::SaveJob{id});
  log(id, EventKind::PassDecided, frame.spec.header.frame, "", "",
      fmt::format("frame {}: error {:.3g} % of {:.3g} % after pass {}; {} of {} blocks go on", frame.spec.header.frame,
                  100 * decision.error, 100 * job->spec.target->error, frame.row.passes.size(), decision.active, decision.counts.size()));
  look_up(*job, frame);
  update_job(*job);
  return true;
}

}  // namespace woodcock::coordinator
