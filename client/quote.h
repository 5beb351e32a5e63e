// A quote in words and as JSON: for `quote` and for `submit --dry-run`.
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "renderer/accuracy/cost_model.h"
#include "renderer/frame/settings.h"

namespace woodcock {

struct QuoteRun {
  std::string scene;
  FrameSettings settings;
  std::optional<double> error;  ///< absent: the error that the settings' samples will reach
  double pilot_seconds = 20;    ///< CPU time that the pilot may take
  bool outside_files = false;
  bool json = false;  ///< no progress, no warnings
};

/// Loads the scene, renders the pilot on all processors, and prints the quote for this machine. Returns the exit code: 1 where nothing can
/// be told.
int run_quote(const QuoteRun& run);

/// Adds --pilot-time.
void add_pilot_option(CLI::App& command, double& pilot_seconds);

}  // namespace woodcock
