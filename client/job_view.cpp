#include "client/job_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "client/progress_line.h"

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
           {"samples_per_second", progress.samples_per_second()}};
  if (progress.has_eta_seconds()) out["eta_seconds"] = progress.eta_seconds();
  return out;
}

}  // namespace

std::string state_name(v1::JobState state) { return short_name(v1::JobState_Name(state), "JOB_STATE_"); }
std::string state_name(v1::FrameState state) { return short_name(v1::FrameState_Name(state), "FRAME_STATE_"); }

bool has_ended(v1::JobState state) {
  return state == v1::JOB_STATE_DONE || state == v1::JOB_STATE_PARTIAL || state == v1::JOB_STATE_FAILED || state == v1::JOB_STATE_CANCELLED;
}

int exit_code(v1::JobState state) {
  if (state == v1::JOB_STATE_PARTIAL) return 3;
  return state == v1::JOB_STATE_FAILED || state == v1::JOB_STATE_CANCELLED ? 1 : 0;
}

json statistics_json(const v1::FrameStatistics& statistics) {
  return {{"mean_luminance", statistics.mean_luminance()},
          {"rms_error", statistics.rms_error()},
          {"relative_error", statistics.relative_error()},
          {"rms_error_interval_95", {statistics.error_low(), statistics.error_high()}},
          {"non_finite_samples", statistics.non_finite_samples()},
          {"incomplete_pixels", statistics.incomplete_pixels()},
          {"empty_pixels", statistics.empty_pixels()},
          {"samples", statistics.samples()}};
}

json frame_json(const v1::FrameStatus& frame) {
  json out{{"frame", frame.frame()},
           {"state", state_name(frame.state())},
           {"progress", progress_json(frame.progress())},
           {"waiting_reason", frame.waiting_reason()},
           {"reason", frame.reason()},
           {"image_digest", frame.image_digest()},
           {"image_bytes", frame.image_bytes()},
           {"build", frame.header().build()},
           {"arithmetic_class", frame.header().arithmetic_class()},
           {"failed_tasks", json::array()}};
  if (frame.has_statistics()) out["statistics"] = statistics_json(frame.statistics());
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
  if (job.frames_size() > 0) {
    out["frames"] = json::array();
    for (const v1::FrameStatus& frame : job.frames()) out["frames"].push_back(frame_json(frame));
  }
  return out;
}

std::string error_line(const v1::FrameStatistics& statistics) {
  std::string line;
  if (statistics.mean_luminance() > 0) {
    const double percent = 100 / statistics.mean_luminance();
    line = fmt::format("error {:.3g} % of the mean (95 % interval {:.3g} % to {:.3g} %)", 100 * statistics.relative_error(),
                       percent * statistics.error_low(), percent * statistics.error_high());
  } else {
    line = "the image is black";
  }
  if (statistics.non_finite_samples() > 0)
    line += fmt::format("; {} samples were not finite and count as zero", statistics.non_finite_samples());
  if (statistics.empty_pixels() > 0) line += fmt::format("; {} pixels are empty", statistics.empty_pixels());
  if (statistics.incomplete_pixels() > 0) line += fmt::format("; {} pixels lack samples", statistics.incomplete_pixels());
  return line;
}

std::string price_line(const v1::Job& job) {
  const double spent = job.progress().worker_seconds();
  const int64_t samples = job.settings().samples();
  if (!(spent > 0) || samples <= 0 || job.state() != v1::JOB_STATE_DONE) return "";
  return fmt::format("half the error takes 4 times the samples: woodcock extend {} --spp {} costs about {} of processor time more",
                     job.job_id(), 4 * samples, format_seconds(3 * spent));
}

}  // namespace woodcock
