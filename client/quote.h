// A quote in words and as JSON: for `quote` and for `submit`.
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "client/service.h"
#include "client/submission.h"
#include "client/worker_pilot.h"
#include "renderer/accuracy/cost_model.h"
#include "renderer/frame/settings.h"
#include "woodcock/v1/quote.pb.h"

namespace woodcock {

struct QuoteRun {
  std::string scene;
  FrameSettings settings;
  std::optional<double> error;  ///< absent: the error that the settings' samples will reach
  double pilot_seconds = 20;    ///< CPU time that the pilot may take, here and again on the workers
  double wait_seconds = 300;    ///< for the workers
  bool outside_files = false;
  bool json = false;  ///< no progress, no warnings
};

struct MadeQuote {
  Quote quote;
  Pilot pilot;                         ///< its samples rendered here; of a quote for workers its time a sample is theirs
  int threads = 1;                     ///< of this machine
  double load_seconds = 0;             ///< on this machine
  std::optional<WorkerTimes> workers;  ///< whom the times are for; absent: this machine
  int64_t frames = 1;                  ///< of the job; the quote's times are of one
};

/// Loads the scene and renders the pilot on all processors of this machine; with a service its workers then measure the times on
/// `submission`, whose first frame the scene is. Throws SceneError, NoQuote, rpc::RpcError.
MadeQuote make_quote(const QuoteRun& run);
MadeQuote make_quote(const QuoteRun& run, Service& service, const Submission& submission);

/// To standard output: text, or JSON where `run` says so.
void print_quote(const QuoteRun& run, const MadeQuote& made);

/// As it is kept with a job: times of all frames.
v1::Quote to_wire(const MadeQuote& made);

/// Adds --pilot-time and --quote-wait.
void add_quote_options(CLI::App& command, QuoteRun& run);

}  // namespace woodcock
