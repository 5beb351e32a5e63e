// Warnings about what a render counted: the same words for `render`, `submit`, `watch`, `show` and `fetch`.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "renderer/transport/counters.h"
#include "woodcock/v1/job.pb.h"

namespace woodcock {

/// One sentence for each cause that was counted; empty when all went well. `repeat` is a command without pixel and sample,
/// to which those of the first sample that was not finite are added.
std::vector<std::string> health_warnings(const PathCounters& counters, const std::string& repeat = {});

/// These sentences on standard error.
void report_health(const PathCounters& counters, const std::string& repeat = {});

/// All counters by name.
nlohmann::json counters_json(const PathCounters& counters);

/// A line that says by what an estimator is biased, ending in a newline; empty for one that is not, or is not known here.
std::string format_bias(const std::string& estimator);

/// The causes alone; the other counters stay 0.
PathCounters health_of(const v1::FrameStatus& frame);
/// Sum over the frames that `job` lists.
PathCounters health_of(const v1::Job& job);

}  // namespace woodcock
