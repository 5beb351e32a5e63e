// `woodcock render` with a target: an error, a time, or the sample map of an earlier render.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "renderer/accuracy/adaptive.h"
#include "renderer/frame/frame_renderer.h"
#include "renderer/frame/settings.h"

namespace woodcock {

/// When a render is to end; what comes first ends it.
struct TargetOptions {
  std::optional<double> error;         ///< E, a fraction
  std::optional<double> max_seconds;   ///< of rendering
  std::optional<int64_t> max_samples;  ///< of any pixel
  std::string sample_map;              ///< EXR or JSON: exactly these samples

  /// Blocks may end with different numbers of samples.
  bool adaptive() const { return error || max_seconds || !sample_map.empty(); }
};

/// "0.02" or "2%" as a fraction; throws CLI::ValidationError naming `option`.
double parse_error_target(const std::string& option, const std::string& text);

/// "90", "90s", "5min", "2h" in seconds; throws CLI::ValidationError.
double parse_time_limit(const std::string& text);

/// Adds --target-error, --max-time and --max-spp.
void add_target_options(CLI::App& command, TargetOptions& options);
/// Adds --sample-map, which `render` alone has.
void add_sample_map_option(CLI::App& command, TargetOptions& options);

/// Makes --spp and --max-spp one, and refuses what makes no sense together: call it once all is parsed. Without a target
/// --max-spp is --spp. Throws CLI::ValidationError.
void settle_targets(TargetOptions& options, FrameSettings& settings);

/// What the passes of a render aim at.
SamplingTarget sampling_target(const TargetOptions& options);

/// The map of an EXR, or of JSON as `render --json` writes it ("sample_map", or that object alone). Throws FilmError.
SampleMap read_sample_map(const std::filesystem::path& file, PixelRect bounds);
nlohmann::json sample_map_json(const SampleMap& map);

struct AdaptiveRun {
  std::filesystem::path output;
  int tile = 32, threads = 1;
  std::optional<std::filesystem::path> earlier;  ///< nodes to go on from
  bool json = false;
  double load_seconds = 0;
  std::string bias;    ///< a line on the estimator's bias, or empty
  std::string repeat;  ///< a command that repeats a sample, for warnings
};

/// Renders, writes EXR and PNG, and reports. Without a target every block gets `max_samples`, which must be there then, if it
/// does not hold more. Returns the exit code.
int run_adaptive(const FrameRenderer& frame, const TargetOptions& options, const AdaptiveRun& run);

}  // namespace woodcock
