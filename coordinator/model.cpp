#include "coordinator/model.h"

#include <fmt/format.h>
#include <charconv>
#include <stdexcept>

#include <nlohmann/json.hpp>

namespace woodcock::coordinator {

std::string to_string(const TaskRef& task) { return task.job + "." + std::to_string(task.frame) + "." + std::to_string(task.number); }

std::optional<TaskRef> parse_task_id(const std::string& id) {
  const size_t second = id.rfind('.');
  if (second == std::string::npos || second == 0) return std::nullopt;
  const size_t first = id.rfind('.', second - 1);
  if (first == std::string::npos || first == 0) return std::nullopt;
  TaskRef task{id.substr(0, first), 0, 0};
  const auto number = [&](size_t begin, size_t end, auto& value) {
    const auto [p, error] = std::from_chars(id.data() + begin, id.data() + end, value);
    return error == std::errc() && p == id.data() + end && value >= 0;
  };
  if (!number(first + 1, second, task.frame) || !number(second + 1, id.size(), task.number)) return std::nullopt;
  return task;
}

HealthCounts& HealthCounts::operator+=(const HealthCounts& o) {
  nonfinite += o.nonfinite;
  clamped += o.clamped;
  majorant_violations += o.majorant_violations;
  truncated += o.truncated;
  return *this;
}

HealthCounts& HealthCounts::operator-=(const HealthCounts& o) {
  return *this += {-o.nonfinite, -o.clamped, -o.majorant_violations, -o.truncated};
}

FrameCounts& FrameCounts::operator+=(const FrameCounts& o) {
  for (const auto member : {&FrameCounts::unsettled, &FrameCounts::done, &FrameCounts::given_up, &FrameCounts::samples_total,
                            &FrameCounts::samples_done, &FrameCounts::cpu_ns, &FrameCounts::result_cpu_ns, &FrameCounts::closed_blocks})
    this->*member = capped_sum(this->*member, o.*member);
  for (const auto member : {&HealthCounts::nonfinite, &HealthCounts::clamped, &HealthCounts::majorant_violations, &HealthCounts::truncated})
    health.*member = capped_sum(health.*member, o.health.*member);
  return *this;
}

namespace {

nlohmann::json json_of(const FrameCounts& c) {
  return {{"unsettled", c.unsettled},
          {"done", c.done},
          {"given_up", c.given_up},
          {"samples_total", c.samples_total},
          {"samples_done", c.samples_done},
          {"cpu_ns", c.cpu_ns},
          {"result_cpu_ns", c.result_cpu_ns},
          {"closed_blocks", c.closed_blocks},
          {"nonfinite", c.health.nonfinite},
          {"clamped", c.health.clamped},
          {"majorant_violations", c.health.majorant_violations},
          {"truncated", c.health.truncated}};
}

FrameCounts counts_of(const nlohmann::json& json) {
  const auto number = [&](const char* key) { return json.at(key).get<int64_t>(); };
  FrameCounts c;
  c.unsettled = number("unsettled");
  c.done = number("done");
  c.given_up = number("given_up");
  c.samples_total = number("samples_total");
  c.samples_done = number("samples_done");
  c.cpu_ns = number("cpu_ns");
  c.result_cpu_ns = number("result_cpu_ns");
  c.closed_blocks = number("closed_blocks");
  c.health = {number("nonfinite"), number("clamped"), number("majorant_violations"), number("truncated")};
  return c;
}

}  // namespace

std::string to_json(const FrameCounts& counts) { return json_of(counts).dump(); }

FrameCounts counts_from_json(const std::string& text) {
  try {
    return counts_of(nlohmann::json::parse(text));
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(std::string("malformed counts: ") + error.what());
  }
}

std::string to_json(const JobSummary& s) {
  return nlohmann::json{{"frames", s.frames},
                        {"counts", json_of(s.counts)},
                        {"pixels", s.pixels},
                        {"error_square", s.error_square},
                        {"errors_known", s.errors_known}}
      .dump();
}

JobSummary summary_from_json(const std::string& text) {
  try {
    const nlohmann::json json = nlohmann::json::parse(text);
    return {json.at("frames").get<int64_t>(), counts_of(json.at("counts")), json.at("pixels").get<double>(),
            json.at("error_square").get<double>(), json.at("errors_known").get<bool>()};
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(std::string("malformed summary: ") + error.what());
  }
}

const char* to_string(JobState state) {
  static constexpr const char* kNames[] = {"queued", "running", "paused", "assembling", "done", "partial", "failed", "cancelled"};
  return kNames[static_cast<int>(state)];
}

const char* to_string(FrameState state) {
  static constexpr const char* kNames[] = {"queued", "running", "assembling", "done", "partial", "failed", "cancelled"};
  return kNames[static_cast<int>(state)];
}

std::string TimeLimit::reason() const { return fmt::format("ended by its limit of {:.4g} s", seconds); }

std::string to_json(const FrameStatistics& s) {
  nlohmann::json json{{"image_mean", s.image_mean}, {"samples", s.samples}, {"pixels", s.pixels}, {"missing_pixels", s.missing_pixels}};
  if (s.standard_error) json["standard_error"] = *s.standard_error;
  if (s.relative_error) json["relative_error"] = *s.relative_error;
  if (s.relative_error_half_width) json["relative_error_half_width"] = *s.relative_error_half_width;
  if (s.firefly_share) json["firefly_share"] = *s.firefly_share;
  if (!s.convergence.points.empty()) {
    json["timed_from"] = s.convergence.timed_from;
    for (const ConvergencePoint& point : s.convergence.points) {
      nlohmann::json& row = json["convergence"].emplace_back();
      for (const auto& [name, value] : error_fields(point.error)) row["error"][name] = value;
      row["cpu_seconds"] = point.cpu_seconds;
    }
  }
  return json.dump();
}

FrameStatistics statistics_from_json(const std::string& text) {
  try {
    const nlohmann::json json = nlohmann::json::parse(text);
    FrameStatistics s;
    s.image_mean = json.value("image_mean", 0.0);
    s.samples = json.value("samples", int64_t{0});
    s.pixels = json.value("pixels", int64_t{0});
    s.missing_pixels = json.value("missing_pixels", int64_t{0});
    const auto number = [&](const char* key) {
      return json.contains(key) ? std::optional<double>(json.at(key).get<double>()) : std::nullopt;
    };
    s.standard_error = number("standard_error");
    s.relative_error = number("relative_error");
    s.relative_error_half_width = number("relative_error_half_width");
    s.firefly_share = number("firefly_share");
    s.convergence.timed_from = json.value("timed_from", int64_t{0});
    for (const nlohmann::json& row : json.value("convergence", nlohmann::json::array())) {
      const ErrorEstimate error = error_from_fields(row.at("error").get<std::map<std::string, double>>());
      s.convergence.points.push_back({error.samples, error, row.at("cpu_seconds").get<double>()});
    }
    return s;
  } catch (const std::exception& error) {
    throw std::runtime_error(std::string("malformed statistics: ") + error.what());
  }
}

}  // namespace woodcock::coordinator
