#include "client/health.h"

#include <fmt/format.h>

#include "client/print.h"

#include "renderer/transport/estimator.h"

namespace woodcock {

std::vector<std::string> health_warnings(const PathCounters& c, const std::string& repeat) {
  std::vector<std::string> lines;
  if (c.nonfinite > 0) {
    std::string line = fmt::format("{} samples were not finite and count as zero", c.nonfinite);
    if (const auto& first = c.first_nonfinite) {
      line +=
          fmt::format(": {} no number, {} infinite, {} in an optional channel; the first is sample {} of pixel ({}, {})", c.nan_radiance,
                      c.infinite_radiance, c.nonfinite - c.nan_radiance - c.infinite_radiance, first->sample, first->x, first->y);
      if (!repeat.empty())
        line += fmt::format("; again: {} --crop {},{},{},{} --samples {}:{}", repeat, first->x, first->x + 1, first->y, first->y + 1,
                            first->sample, first->sample + 1);
    }
    lines.push_back(std::move(line));
  }
  if (c.clamped > 0)
    lines.push_back(fmt::format("{} samples were clamped by the film's maxcomponentvalue: the picture is biased", c.clamped));
  if (c.majorant_violations > 0)
    lines.push_back(fmt::format("{} density look-ups exceeded their bound: the picture is biased", c.majorant_violations));
  if (c.truncated > 0) lines.push_back(fmt::format("{} paths crossed too many boundaries and were cut off", c.truncated));
  return lines;
}

void report_health(const PathCounters& counters, const std::string& repeat) {
  for (const std::string& line : health_warnings(counters, repeat)) note("warning: {}\n", line);
}

nlohmann::json counters_json(const PathCounters& c) {
  return {{"paths", c.paths},
          {"vertices", c.vertices},
          {"rays", c.rays},
          {"shadow_rays", c.shadow_rays},
          {"medium_lookups", c.medium_lookups},
          {"emission_lookups", c.emission_lookups},
          {"channel_draws", c.channel_draws},
          {"nonfinite_samples", c.nonfinite},
          {"nan_radiance", c.nan_radiance},
          {"infinite_radiance", c.infinite_radiance},
          {"clamped_samples", c.clamped},
          {"majorant_violations", c.majorant_violations},
          {"truncated_paths", c.truncated}};
}

std::string format_bias(const std::string& estimator) {
  const EstimatorInfo* info = find_estimator(estimator);
  if (info == nullptr || !info->biased()) return {};
  return fmt::format("biased: {}; the errors above are of noise alone\n", info->bias);
}

PathCounters health_of(const v1::FrameStatus& frame) {
  const auto count = [](int64_t value) { return value > 0 ? static_cast<uint64_t>(value) : 0; };
  PathCounters counters;
  counters.nonfinite = count(frame.health().nonfinite_samples());
  counters.clamped = count(frame.health().clamped_samples());
  counters.majorant_violations = count(frame.health().majorant_violations());
  counters.truncated = count(frame.health().truncated_paths());
  return counters;
}

PathCounters health_of(const v1::Job& job) {
  PathCounters sum;
  for (const v1::FrameStatus& frame : job.frames()) sum.add(health_of(frame));
  return sum;
}

}  // namespace woodcock
