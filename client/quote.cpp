// `woodcock quote`: what an error will cost.
#include "client/quote.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "client/adaptive_render.h"
#include "client/commands.h"
#include "client/convergence_table.h"
#include "client/frame_options.h"
#include "client/interrupt.h"
#include "client/pilot.h"
#include "client/progress_line.h"
#include "renderer/frame/run_units.h"

namespace woodcock {
namespace {

nlohmann::json quote_json(const Quote& quote, const Pilot& pilot, int threads, double load_seconds) {
  const double n = threads;
  return {{"relative_error", quote.error},
          {"samples", quote.samples},
          {"samples_interval", {quote.samples_low, quote.samples_high}},
          {"cpu_seconds", quote.cpu_seconds},
          {"cpu_seconds_interval", {quote.cpu_low, quote.cpu_high}},
          {"machines", "this machine"},
          {"threads", threads},
          {"seconds", quote.cpu_seconds / n},
          {"seconds_interval", {quote.cpu_low / n, quote.cpu_high / n}},
          {"load_seconds", load_seconds},
          {"uncertain", quote.uncertain},
          {"pilot",
           {{"samples", pilot.record.points.back().samples},
            {"pixel_share", pilot.pixel_share},
            {"cpu_seconds", pilot.cpu_seconds},
            {"relative_error", pilot.record.points.back().error.relative_error->value}}}};
}

void print_quote(const QuoteRun& run, const Quote& quote, const Pilot& pilot, int threads, double load_seconds) {
  const double n = threads;
  const ErrorEstimate& seen = pilot.record.points.back().error;
  fmt::print("{}: an error of {:.3g} %\n", run.scene, 100 * quote.error);
  fmt::print("samples    {} per pixel ({} to {})\n", quote.samples, quote.samples_low, quote.samples_high);
  fmt::print("CPU time   {} ({} to {})\n", short_time(quote.cpu_seconds), short_time(quote.cpu_low), short_time(quote.cpu_high));
  fmt::print("time       {} ({} to {}) on {} threads of this machine; loading {}\n", short_time(quote.cpu_seconds / n),
             short_time(quote.cpu_low / n), short_time(quote.cpu_high / n), threads, short_time(load_seconds));
  fmt::print("pilot      {} samples of {:.3g} % of the pixels in {} of CPU time; their error was {:.3g} %\n", seen.samples,
             100 * pilot.pixel_share, short_time(pilot.cpu_seconds), 100 * seen.relative_error->value);
  if (!quote.uncertain.empty()) fmt::print("uncertain: {}\n", quote.uncertain);
}

}  // namespace

int run_quote(const QuoteRun& run) {
  const auto start = std::chrono::steady_clock::now();
  ReadOptions read;
  read.allow_outside_files = run.outside_files;
  if (!run.json) read.warn = [](const std::string& line) { fmt::print(stderr, "warning: {}\n", line); };
  const FrameRenderer frame(run.scene, run.settings, read);
  const double load_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const int threads = processors();
  const Pilot pilot = run_pilot(frame, {run.pilot_seconds, run.error, threads}, interrupt_flag());
  const auto quote = pilot.record.points.empty() ? std::nullopt
                     : run.error                 ? quote_error(pilot, *run.error)
                                                 : quote_samples(pilot, frame.samples());
  if (!quote) {
    fmt::print(stderr, "woodcock: no quote: the pilot saw no error to go by (a black picture, or too little --pilot-time)\n");
    return 1;
  }
  if (run.json)
    fmt::print("{}\n", quote_json(*quote, pilot, threads, load_seconds).dump(2));
  else
    print_quote(run, *quote, pilot, threads, load_seconds);
  return 0;
}

void add_pilot_option(CLI::App& command, double& pilot_seconds) {
  command.add_option("--pilot-time", pilot_seconds, "CPU seconds the pilot may take; it ends sooner where it knows enough")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
}

void add_quote_command(CLI::App& app, int& code) {
  auto* command = app.add_subcommand("quote", "Samples and time that an error will cost, from a short pilot");
  auto options = std::make_shared<QuoteRun>();
  command->add_option("scene", options->scene, "Scene file in pbrt-v4 format")->required();
  command
      ->add_option_function<std::string>(
          "--error", [options](const std::string& text) { options->error = parse_error_target("--error", text); },
          "Relative error to quote for, e.g. 0.02 or 2%; without it the error that --spp samples will reach")
      ->type_name("E");
  add_frame_options(*command, options->settings);
  add_pilot_option(*command, options->pilot_seconds);
  command->add_flag("--allow-outside-files", options->outside_files, "Let the scene read files outside its own folder");
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer(
      "Examples:\n"
      "  woodcock quote scenes/cloud.pbrt --error 2%       what 2 % costs\n"
      "  woodcock quote scenes/cloud.pbrt --spp 256        what 256 samples reach\n"
      "The samples are those of every pixel (`render --spp`); `render --target-error` takes fewer where noise is uneven.");
  command->callback([options, &code] { code = run_quote(*options); });
}

}  // namespace woodcock
