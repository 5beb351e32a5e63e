#include "coordinator/job_view.h"

#include <algorithm>

#include "rpc/convert.h"

namespace woodcock::coordinator {
namespace {

v1::JobState to_wire(JobState state) { return static_cast<v1::JobState>(static_cast<int>(state) + 1); }
v1::FrameState to_wire(FrameState state) { return static_cast<v1::FrameState>(static_cast<int>(state) + 1); }
static_assert(static_cast<int>(JobState::Cancelled) + 1 == v1::JOB_STATE_CANCELLED);
static_assert(static_cast<int>(FrameState::Cancelled) + 1 == v1::FRAME_STATE_CANCELLED);
static_assert(static_cast<int>(EventKind::Waiting) == v1::JOB_EVENT_KIND_WAITING);
static_assert(static_cast<int>(WaitingReason::WorkersBusy) == v1::WAITING_REASON_WORKERS_BUSY);
static_assert(static_cast<int>(WaitingReason::MaxWorkers) == v1::WAITING_REASON_MAX_WORKERS);
static_assert(static_cast<int>(WorkerCondition::Left) == v1::WORKER_CONDITION_LEFT);

v1::Progress to_wire(const Progress& p) {
  v1::Progress wire;
  wire.set_tasks_total(p.tasks_total);
  wire.set_tasks_done(p.tasks_done);
  wire.set_tasks_leased(p.tasks_leased);
  wire.set_tasks_failed(p.tasks_failed);
  wire.set_samples_total(p.samples_total);
  wire.set_samples_done(p.samples_done);
  wire.set_samples_in_flight(p.samples_in_flight);
  wire.set_worker_seconds(p.worker_seconds);
  wire.set_result_seconds(p.result_seconds);
  wire.set_samples_per_second(p.samples_per_second);
  if (p.eta_seconds) wire.set_eta_seconds(*p.eta_seconds);
  return wire;
}

}  // namespace

v1::FrameStatistics to_wire(const FrameStatistics& s) {
  v1::FrameStatistics wire;
  wire.set_image_mean(s.image_mean);
  if (s.standard_error) wire.set_standard_error(*s.standard_error);
  if (s.relative_error) wire.set_relative_error(*s.relative_error);
  if (s.relative_error_half_width) wire.set_relative_error_half_width(*s.relative_error_half_width);
  if (s.firefly_share) wire.set_firefly_share(*s.firefly_share);
  wire.set_samples(s.samples);
  wire.set_pixels(s.pixels);
  wire.set_missing_pixels(s.missing_pixels);
  return wire;
}

void add_convergence(const Convergence& record, v1::GetFrameResponse& response) {
  response.set_timed_from(record.timed_from);
  for (const ConvergencePoint& point : record.points) {
    v1::ConvergencePoint& wire = *response.add_convergence();
    for (const auto& [name, value] : error_fields(point.error)) (*wire.mutable_error())[name] = value;
    wire.set_cpu_seconds(point.cpu_seconds);
  }
}

namespace {

v1::AdaptiveStatus adaptive_view(const Job& job, const Frame& frame) {
  v1::AdaptiveStatus wire;
  const size_t passes = frame.row.passes.size();
  const SampleMap planned = frame.planned_map(job.spec.samples());
  wire.set_pass(static_cast<int32_t>(passes) + 1);
  wire.set_blocks(static_cast<int64_t>(planned.counts.size()));
  int64_t active = passes == 0 ? wire.blocks() : 0;
  if (passes > 0) {
    const SampleMap before = frame.planned_map(passes - 1, job.spec.samples());
    for (size_t b = 0; b < planned.counts.size(); ++b) active += planned.counts[b] > before.counts[b];
  }
  wire.set_active_blocks(active);
  wire.set_closed_blocks(counts_of(job, frame).closed_blocks);
  return wire;
}

}  // namespace

v1::FrameStatus frame_view(const Job& job, const Frame& frame) {
  v1::FrameStatus wire;
  wire.set_frame(frame.spec.header.frame);
  wire.set_state(to_wire(frame.row.state));
  *wire.mutable_header() = rpc::to_wire(frame.pinned_header());
  *wire.mutable_progress() = to_wire(progress_of(frame));
  wire.set_image_digest(frame.row.image_digest);
  wire.set_image_bytes(frame.row.image_bytes);
  if (!frame.row.image_digest.empty() || !frame.row.passes.empty()) *wire.mutable_statistics() = to_wire(frame.row.statistics);
  if (job.spec.target) *wire.mutable_adaptive() = adaptive_view(job, frame);
  wire.set_reason(frame.row.reason);
  v1::HealthCounts& health = *wire.mutable_health();
  health.set_nonfinite_samples(frame.health.nonfinite);
  health.set_clamped_samples(frame.health.clamped);
  health.set_majorant_violations(frame.health.majorant_violations);
  health.set_truncated_paths(frame.health.truncated);
  const auto index = static_cast<int>(&frame - job.frames.data());
  for (const auto& [number, task] : frame.failures) {
    v1::FailedTask* failed = wire.add_failed_tasks();
    failed->set_task_id(to_string(TaskRef{job.spec.id, index, number}));
    *failed->mutable_rect() = rpc::to_wire(task.area.rect);
    *failed->mutable_range() = rpc::to_wire(task.area.range);
    failed->set_last_error(task.error);
  }
  return wire;
}

v1::Job job_view(const JobSpec& spec, const JobRow& row, const JobSummary& summary) {
  v1::Job wire;
  wire.set_job_id(spec.id);
  wire.set_name(spec.name);
  wire.set_state(to_wire(row.state));
  wire.set_state_reason(row.reason);
  wire.set_priority(spec.priority);
  *wire.mutable_settings() = rpc::to_wire(spec.settings, spec.tile_size);
  *wire.mutable_progress() = to_wire(progress_of(summary.counts));
  wire.set_submitted_unix_ms(spec.submitted_unix_ms);
  wire.set_ended_unix_ms(row.ended_unix_ms);
  wire.set_frame_count(summary.frames);
  wire.set_last_event(row.last_event);
  if (spec.target) {
    wire.mutable_target()->set_error(spec.target->error);
    wire.mutable_target()->set_max_samples(spec.target->max_samples);
    if (spec.time_limit) wire.mutable_target()->set_max_seconds(spec.time_limit->seconds);
  }
  if (spec.policy != JobPolicy{}) *wire.mutable_policy() = to_wire(spec.policy);
  if (spec.quote) *wire.mutable_quote() = to_wire(*spec.quote);
  if (const auto outcome = quote_outcome(spec, row, summary)) *wire.mutable_quote_outcome() = *outcome;
  return wire;
}

v1::Job job_view(const Job& job) {
  v1::Job wire = job_view(job.spec, job.row, summary_of(job));
  for (const Frame& frame : job.frames) *wire.add_frames() = frame_view(job, frame);
  return wire;
}

v1::Job job_view(const Scheduler& scheduler, const Job& job, bool with_frames, Time now) {
  v1::Job wire = with_frames ? job_view(job) : job_view(job.spec, job.row, summary_of(job));
  *wire.mutable_progress() = to_wire(scheduler.progress(job, now));
  const std::vector<Waiting> waits = scheduler.waiting_of_frames(job, now);
  // What passes in a moment is not said of the job.
  constexpr Time kMoment = 2 * kSecond;
  const bool queues = job.waits == WaitingReason::WorkersBusy && now - job.waits_since >= kMoment && job.leases.empty();
  const auto first = std::find_if(waits.begin(), waits.end(), [&](const Waiting& waiting) {
    return blocks(waiting.reason) || (waiting.reason == WaitingReason::WorkersBusy && queues);
  });
  if (wire.state_reason().empty() && first != waits.end()) wire.set_state_reason(first->text);
  for (int i = 0; i < wire.frames_size(); ++i) set_waiting(*wire.mutable_frames(i), waits[static_cast<size_t>(i)]);
  return wire;
}

void set_waiting(v1::FrameStatus& status, const Waiting& waiting) {
  status.set_waiting(static_cast<v1::WaitingReason>(static_cast<int>(waiting.reason)));
  status.set_waiting_reason(waiting.text);
}

v1::TaskResult result_view(const TaskRef& ref, const SettledTask& task) {
  v1::TaskResult wire;
  wire.set_task_id(to_string(ref));
  wire.set_samples(task.result.cost.samples);
  wire.set_cpu_ns(task.result.cost.cpu_ns);
  wire.set_wall_ns(task.result.cost.wall_ns);
  wire.set_worker_id(task.result.worker_id);
  wire.set_reused(task.reused);
  return wire;
}

v1::JobEvent to_wire(const JobEvent& event) {
  v1::JobEvent wire;
  wire.set_number(event.number);
  wire.set_unix_ms(event.unix_ms);
  wire.set_kind(static_cast<v1::JobEventKind>(static_cast<int>(event.kind)));
  if (event.frame) wire.set_frame(*event.frame);
  wire.set_task_id(event.task_id);
  wire.set_worker_id(event.worker_id);
  wire.set_message(event.message.substr(0, 1024));
  return wire;
}

v1::TaskAttempt to_wire(const AttemptRecord& attempt) {
  v1::TaskAttempt wire;
  wire.set_worker_id(attempt.worker_id);
  wire.set_host_name(attempt.host_name);
  wire.set_epoch(attempt.epoch);
  wire.set_unix_ms(attempt.unix_ms);
  wire.set_message(attempt.message);
  wire.set_log_excerpt(attempt.log_excerpt);
  return wire;
}

v1::WorkerStatus to_wire(const WorkerView& worker) {
  v1::WorkerStatus wire;
  wire.set_worker_id(worker.last->worker_id);
  wire.set_host_name(worker.last->host_name);
  wire.set_slots(static_cast<uint32_t>(worker.last->slots));
  wire.set_threads(static_cast<uint32_t>(worker.last->threads));
  wire.set_condition(static_cast<v1::WorkerCondition>(static_cast<int>(worker.condition)));
  wire.set_build(worker.last->build);
  wire.set_arithmetic_class(worker.last->arithmetic_class);
  wire.set_leases(static_cast<int64_t>(worker.leases));
  wire.set_silent_ms(worker.silent / 1'000'000);
  for (const std::string& tag : worker.last->tags) wire.add_tags(tag);
  wire.set_memory_bytes(worker.last->memory);
  return wire;
}

}  // namespace woodcock::coordinator
