#include "coordinator/job.h"

#include <algorithm>
#include <utility>

#include "coordinator/task_grid.h"

namespace woodcock::coordinator {

FrameHeader Frame::pinned_header() const {
  FrameHeader header = spec.header;
  header.build = row.build;
  header.arithmetic_class = row.arithmetic_class;
  return header;
}

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
  const auto leave_out = [&](int64_t number) {
    const TaskArea area = tasks.area(number);
    if (area.range.begin < base) return;
    for_each_block(map.grid(), area.rect, [&](size_t b) {
      int64_t before = base;
      for (const std::vector<int64_t>& pass : row.passes)
        if (pass[b] <= area.range.begin) before = std::max(before, pass[b]);
      map.counts[b] = std::min(map.counts[b], before);
    });
  };
  for (auto number = tasks.next_open(0, tasks.size()); number; number = tasks.next_open(*number + 1, tasks.size())) leave_out(*number);
  for (auto number = tasks.next_given_up(0); number; number = tasks.next_given_up(*number + 1)) leave_out(*number);
  return map;
}

std::vector<bool> Frame::closed_blocks() const {
  const BlockGrid grid{spec.header.bounds};
  std::vector<bool> closed(grid.size(), false);
  for (auto number = tasks.next_given_up(0); number; number = tasks.next_given_up(*number + 1))
    for_each_block(grid, tasks.area(*number).rect, [&](size_t b) { closed[b] = true; });
  return closed;
}

TaskState Frame::state(int64_t number) const {
  const ActiveTask* task = find_active(number);
  return task && task->committing ? TaskState::Committing : tasks.state(number);
}

const ActiveTask* Frame::find_active(int64_t number) const {
  const auto it = active.find(number);
  return it == active.end() ? nullptr : &it->second;
}

ActiveTask* Frame::find_active(int64_t number) {
  const auto it = active.find(number);
  return it == active.end() ? nullptr : &it->second;
}

bool Frame::any_committing() const {
  return std::any_of(active.begin(), active.end(), [](const auto& task) { return task.second.committing; });
}

void Frame::append_round(const JobSpec& job, SampleRange round) {
  const int64_t before = tasks.size();
  samples_total = capped_sum(samples_total, tasks.append_round(spec.header.bounds, job.tile_size, round, job.range_length));
  unsettled += tasks.size() - before;
}

void Frame::append_pass(const JobSpec& job, size_t pass) {
  const int64_t before = tasks.size();
  samples_total = capped_sum(samples_total, tasks.append_pass(planned_map(pass, job.samples()), row.passes[pass], job.tile_size));
  unsettled += tasks.size() - before;
}

int64_t Frame::append_parts(int64_t number) {
  const int64_t before = tasks.size(), first = tasks.split(number);
  active.erase(number);
  unsettled += tasks.size() - before - 1;
  ++splits;
  return first;
}

void Frame::add_result(int64_t number, const ResultRecord& result, bool reused) {
  tasks.settle(number, TaskState::Done);
  --unsettled;
  FrameCounts added;
  added.done = 1;
  added.samples_done = tasks.area(number).samples();
  if (!reused) added.cpu_ns = result.cost.cpu_ns;
  added.result_cpu_ns = result.cost.cpu_ns;
  added.health = result.health;
  *this += added;
}

void Frame::give_up(int64_t number, const std::string& error) {
  tasks.settle(number, TaskState::GivenUp);
  active.erase(number);
  --unsettled;
  ++given_up;
  if (failures.size() < kListedFailures) failures.emplace(number, FailedTask{tasks.area(number), error});
}

void Frame::remove_result(int64_t number, const ResultRecord& result) {
  tasks.reopen(number);
  ++unsettled;
  --done;
  samples_done -= tasks.area(number).samples();
  // What it cost was spent all the same, but is no part of the picture.
  result_cpu_ns -= result.cost.cpu_ns;
  health -= result.health;
}

Job make_job(JobSpec spec) {
  Job job;
  const std::vector<FrameSpec> frames = std::exchange(spec.frames, {});
  job.spec = std::move(spec);
  job.frames.reserve(frames.size());
  for (const FrameSpec& frame_spec : frames) {
    Frame& frame = job.frames.emplace_back();
    frame.spec = frame_spec;
    lay_out(job.spec, frame, {});
  }
  return job;
}

void lay_out(const JobSpec& job, Frame& frame, std::vector<SplitRow> splits) {
  // Task numbers were given in order of time: rounds and splits interleave as the numbers of the first parts say.
  std::sort(splits.begin(), splits.end(), [](const SplitRow& a, const SplitRow& b) { return a.first_part < b.first_part; });
  size_t next = 0;
  const auto take_splits = [&] {
    for (; next < splits.size() && splits[next].first_part == frame.tasks.size(); ++next) frame.append_parts(splits[next].number);
  };
  for (const SampleRange round : job.rounds) {
    frame.append_round(job, round);
    take_splits();
  }
  for (size_t pass = 0; pass < frame.row.passes.size(); ++pass) {
    frame.append_pass(job, pass);
    take_splits();
  }
}

void restore(Frame& frame, const SettledTask& row) {
  if (row.number >= frame.tasks.size() || frame.tasks.state(row.number) != TaskState::Open) return;
  if (row.state == TaskState::Done) frame.add_result(row.number, row.result, row.reused);
  if (row.state == TaskState::GivenUp) frame.give_up(row.number, row.error);
}

void restore_done(Frame& frame, int64_t number) {
  if (number >= frame.tasks.size() || frame.tasks.state(number) != TaskState::Open) return;
  frame.tasks.settle(number, TaskState::Done);
  --frame.unsettled;
  ++frame.done;
  frame.samples_done = capped_sum(frame.samples_done, frame.tasks.area(number).samples());
}

FrameCounts counts_of(const Job& job, const Frame& frame) {
  FrameCounts counts = frame;
  if (job.spec.target && frame.tasks.size() > 0) {
    const std::vector<bool> closed = frame.closed_blocks();
    counts.closed_blocks = std::count(closed.begin(), closed.end(), true);
  }
  return counts;
}

JobSummary summary_of(const Job& job) {
  JobSummary summary;
  summary.frames = static_cast<int64_t>(job.frames.size());
  summary.errors_known = true;
  for (const Frame& frame : job.frames) {
    summary.counts += frame;
    summary.pixels += static_cast<double>(frame.spec.header.bounds.area());
    const std::optional<double>& error = frame.row.statistics.relative_error;
    summary.errors_known = summary.errors_known && error.has_value();
    summary.error_square += error.value_or(0) * error.value_or(0);
  }
  return summary;
}

bool can_be_extended(const Job& job) {
  return job.row.state != JobState::Cancelled && (job.row.state != JobState::Failed || job.spec.out_of_time());
}

}  // namespace woodcock::coordinator
