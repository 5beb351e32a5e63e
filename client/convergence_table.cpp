#include "client/convergence_table.h"

#include <fmt/format.h>

#include "client/print.h"
#include "client/progress_line.h"
#include "renderer/film/atomic_file.h"

namespace woodcock {

namespace {

/// "2.3 %", with three significant digits.
std::string percent(double part) { return fmt::format("{:.3g} %", 100 * part); }

std::string row_of(const ConvergencePoint& point, int64_t timed_from) {
  const ErrorEstimate& e = point.error;
  const std::string error = e.relative_error ? percent(e.relative_error->value) : "unknown";
  const std::string mean = e.image_mean_half_width ? fmt::format("{:.5g} ± {:.2g}", e.image_mean, *e.image_mean_half_width)
                                                   : fmt::format("{:.5g}", e.image_mean);
  return fmt::format("{:>10}  {:>9}  {:<22}  {:>10}\n", point.samples, error, mean,
                     point.samples > timed_from ? short_time(point.cpu_seconds) : "earlier");
}

}  // namespace

std::string short_time(double seconds) { return seconds < 10 ? fmt::format("{:.3g} s", seconds) : format_seconds(seconds); }

std::string format_convergence(const Convergence& record, int threads) {
  if (record.points.empty()) return {};
  std::string text = fmt::format("{:>10}  {:>9}  {:<22}  {:>10}\n", "samples", "error", "image mean (95 %)", "CPU time");
  for (const ConvergencePoint& point : record.points) text += row_of(point, record.timed_from);
  if (const std::string reason = heavy_tail_reason(record.points); !reason.empty())
    return text + fmt::format("heavy tail: {}. The errors above may be too small, and what less would cost cannot be told.\n", reason);
  const bool timed = seconds_per_sample(record) > 0;
  for (const Prediction& p : predict(record)) {
    text +=
        fmt::format("{:>10}  {:>9}  {:<22}", p.samples, percent(p.error), fmt::format("({} to {} samples)", p.samples_low, p.samples_high));
    // Where nothing was rendered now, nothing was timed.
    if (timed)
      text += fmt::format("  {:>10}  more{}", short_time(p.cpu_seconds),
                          threads > 0 ? fmt::format(", {} on {} threads", short_time(p.cpu_seconds / threads), threads) : "");
    text += '\n';
  }
  return text;
}

nlohmann::json error_json(const ErrorEstimate& error) {
  nlohmann::json j = nlohmann::json::object();
  for (const auto& [key, value] : error_fields(error)) j[key] = value;
  return j;
}

nlohmann::json convergence_json(const Convergence& record, int threads) {
  nlohmann::json j{{"points", nlohmann::json::array()}, {"predictions", nlohmann::json::array()}};
  for (const ConvergencePoint& point : record.points) {
    nlohmann::json row = error_json(point.error);
    if (point.samples > record.timed_from) row["cpu_seconds"] = point.cpu_seconds;
    j["points"].push_back(row);
  }
  if (record.timed_from > 0) j["timed_from"] = record.timed_from;
  if (const auto slope = mse_slope(record.points)) j["mse_slope"] = {{"value", slope->value}, {"half_width", slope->half_width}};
  j["cpu_seconds_per_sample"] = seconds_per_sample(record);
  j["heavy_tail"] = heavy_tail_reason(record.points);
  const bool timed = seconds_per_sample(record) > 0;
  for (const Prediction& p : predict(record)) {
    nlohmann::json& row = j["predictions"].emplace_back(
        nlohmann::json{{"relative_error", p.error}, {"samples", p.samples}, {"samples_interval", {p.samples_low, p.samples_high}}});
    if (!timed) continue;
    row["more_cpu_seconds"] = p.cpu_seconds;
    if (threads > 0) row["more_seconds"] = p.cpu_seconds / threads;
  }
  return j;
}

std::filesystem::path sidecar_path(const std::filesystem::path& picture) {
  return std::filesystem::path(picture).replace_extension(".accuracy.json");
}

void write_sidecar(const std::filesystem::path& picture, const nlohmann::json& content) {
  write_text(sidecar_path(picture), json_text(content) + '\n');
}

}  // namespace woodcock
