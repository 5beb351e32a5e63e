#include "client/job_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "client/policy_options.h"
#include "client/progress_line.h"
#include "client/quote_record.h"

namespace woodcock {
namespace {

using nlohmann::json;

/// "JOB_STATE_DONE" → "done".
std::string short_name(std::string name, const std::string& prefix) {
  name.erase(0, prefix.size());
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return name;
}

json progress_json(const v1::Progress& progress) {
  json out{{"tasks_total", progress.tasks_total()},
           {"tasks_done", progress.tasks_done()},
           {"tasks_leased", progress.tasks_leased()},
           {"tasks_failed", progress.tasks_failed()},
           {"samples_total", progress.samples_total()},
           {"samples_done", progress.samples_done()},
           {"samples_in_flight", progress.samples_in_flight()},
           {"worker_seconds", progress.worker_seconds()},
           {"result_seconds", progress.result_seconds()},
           {"samples_per_second", progress.samples_per_second()}};
  if (progress.has_eta_seconds()) out["eta_seconds"] = progress.eta_seconds();
  return out;
}

}  // namespace

std::string state_name(v1::JobState state) { return short_name(v1::JobState_Name(state), "JOB_STATE_"); }
std::string waiting_name(v1::WaitingReason reason) {
  return reason == v1::WAITING_REASON_UNSPECIFIED ? "" : short_name(v1::WaitingReason_Name(reason), "WAITING_REASON_");
}
std::string state_name(v1::FrameState state) { return short_name(v1::FrameState_Name(state), "FRAME_STATE_"); }

bool has_ended(v1::JobState state) {
  return state == v1::JOB_STATE_DONE || state == v1::JOB_STATE_PARTIAL || state == v1::JOB_STATE_FAILED || state == v1::JOB_STATE_CANCELLED;
}

int exit_code(v1::JobState state) {
  if (state == v1::JOB_STATE_PARTIAL) return 3;
  return state == v1::JOB_STATE_FAILED || state == v1::JOB_STATE_CANCELLED ? 1 : 0;
}

json statistics_json(const v1::FrameStatistics& statistics) {
  json out{{"image_mean", statistics.image_mean()},
           {"samples", statistics.samples()},
           {"pixels", statistics.pixels()},
           {"missing_pixels", statistics.missing_pixels()}};
  if (statistics.has_standard_error()) out["standard_error"] = statistics.standard_error();
  if (statistics.has_relative_error()) out["relative_error"] = statistics.relative_error();
  if (statistics.has_relative_error_half_width()) out["relative_error_half_width"] = statistics.relative_error_half_width();
  if (statistics.has_firefly_share()) out["firefly_share"] = statistics.firefly_share();
  return out;
}

Convergence convergence_of(const v1::GetFrameResponse& response) {
  Convergence record;
  record.timed_from = response.timed_from();
  for (const v1::ConvergencePoint& wire : response.convergence()) {
    try {
      const ErrorEstimate error = error_from_fields({wire.error().begin(), wire.error().end()});
      record.points.push_back({error.samples, error, wire.cpu_seconds()});
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(std::string("the coordinator tells nonsense of the frame's error: ") + error.what());
    }
  }
  return record;
}

json frame_json(const v1::FrameStatus& frame) {
  json out{{"frame", frame.frame()},
           {"state", state_name(frame.state())},
           {"progress", progress_json(frame.progress())},
           {"waiting", waiting_name(frame.waiting())},
           {"waiting_reason", frame.waiting_reason()},
           {"reason", frame.reason()},
           {"image_digest", frame.image_digest()},
           {"image_bytes", frame.image_bytes()},
           {"build", frame.header().build()},
           {"arithmetic_class", frame.header().arithmetic_class()},
           {"health",
            {{"nonfinite_samples", frame.health().nonfinite_samples()},
             {"clamped_samples", frame.health().clamped_samples()},
             {"majorant_violations", frame.health().majorant_violations()},
             {"truncated_paths", frame.health().truncated_paths()}}},
           {"failed_tasks", json::array()}};
  if (frame.has_statistics()) out["statistics"] = statistics_json(frame.statistics());
  if (frame.has_adaptive())
    out["adaptive"] = {{"pass", frame.adaptive().pass()},
                       {"active_blocks", frame.adaptive().active_blocks()},
                       {"closed_blocks", frame.adaptive().closed_blocks()},
                       {"blocks", frame.adaptive().blocks()}};
  for (const v1::FailedTask& task : frame.failed_tasks())
    out["failed_tasks"].push_back({{"task_id", task.task_id()},
                                   {"rect", {task.rect().x0(), task.rect().y0(), task.rect().x1(), task.rect().y1()}},
                                   {"samples", {task.range().begin(), task.range().end()}},
                                   {"last_error", task.last_error()}});
  return out;
}

json job_json(const v1::Job& job) {
  json out{{"job_id", job.job_id()},
           {"name", job.name()},
           {"state", state_name(job.state())},
           {"state_reason", job.state_reason()},
           {"priority", job.priority()},
           {"samples", job.settings().samples()},
           {"progress", progress_json(job.progress())},
           {"submitted_unix_ms", job.submitted_unix_ms()},
           {"ended_unix_ms", job.ended_unix_ms()},
           {"frame_count", job.frame_count()}};
  if (job.has_target()) {
    out["target"] = {{"error", job.target().error()}, {"max_samples", job.target().max_samples()}};
    if (job.target().max_seconds() > 0) out["target"]["max_seconds"] = job.target().max_seconds();
  }
  if (job.has_policy()) out["policy"] = policy_json(job.policy());
  if (job.has_quote()) out["quote"] = quote_json(job.quote());
  if (job.has_quote_outcome()) out["quote_outcome"] = outcome_json(job);
  if (job.frames_size() > 0) {
    out["frames"] = json::array();
    for (const v1::FrameStatus& frame : job.frames()) out["frames"].push_back(frame_json(frame));
  }
  return out;
}

std::string pass_line(const v1::FrameStatus& frame) {
  const v1::AdaptiveStatus& adaptive = frame.adaptive();
  std::string line = fmt::format("pass {}, {} of {} blocks", adaptive.pass(), adaptive.active_blocks(), adaptive.blocks());
  if (adaptive.closed_blocks() > 0) line += fmt::format(", {} closed", adaptive.closed_blocks());
  return line;
}

std::string describe_target(const v1::SamplingTarget& target) {
  std::string text = fmt::format("{} samples per pixel at most", target.max_samples());
  if (target.max_seconds() > 0) text = fmt::format("{} of rendering at most, ", format_seconds(target.max_seconds())) + text;
  return target.error() > 0 ? fmt::format("relative error {:.3g} %, ", 100 * target.error()) + text : text;
}

// The coordinator sums in another order: the last digits may differ.
bool reaches(double relative_error, const v1::SamplingTarget& target) { return relative_error <= target.error() * (1 + 1e-5); }

std::string target_line(const v1::Job& job, const v1::FrameStatus& frame) {
  if (frame.adaptive().closed_blocks() > 0)
    return fmt::format("{} blocks closed: the target is of the others", frame.adaptive().closed_blocks());
  if (!frame.reason().empty()) return frame.reason();
  const bool reached = frame.statistics().has_relative_error() && reaches(frame.statistics().relative_error(), job.target());
  if (!reached && frame.statistics().relative_error() == 0) return "ended without noise to go by, as in a black picture";
  return reached ? "target reached" : fmt::format("ended by the limit of {} samples per pixel", job.target().max_samples());
}

std::string error_line(const v1::FrameStatistics& statistics) {
  std::string line = "error unknown: too few samples for an estimate";
  if (statistics.has_relative_error())
    line = fmt::format("relative error {:.3g} % ± {:.2g} % (95 % interval)", 100 * statistics.relative_error(),
                       100 * statistics.relative_error_half_width());
  if (statistics.missing_pixels() > 0) line += fmt::format("; {} pixels lack samples and are empty", statistics.missing_pixels());
  return line;
}

}  // namespace woodcock
