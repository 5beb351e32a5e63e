// `woodcock quote`: what an error will cost.
#include "client/quote.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <memory>

#include "client/adaptive_render.h"
#include "client/commands.h"
#include "client/convergence_table.h"
#include "client/frame_options.h"
#include "client/interrupt.h"
#include "client/pilot.h"
#include "client/print.h"
#include "renderer/frame/run_units.h"
#include "rpc/address.h"

namespace woodcock {
namespace {

/// A job's first pass and its longest task: what the workers render for a quote serves the job that follows.
constexpr int64_t kPassSamples = kFirstCount, kTaskSamples = 64;
constexpr int kJobTile = 64;

std::string plural(int64_t count, const std::string& word) { return fmt::format("{} {}{}", count, word, count == 1 ? "" : "s"); }

std::string machines(const MadeQuote& made) {
  if (!made.workers) return plural(made.threads, "thread") + " of this machine";
  std::string text = plural(made.workers->threads, "thread") + " of " + plural(made.workers->workers, "worker");
  if (made.workers->others > 0) text += fmt::format(" ({} of another build not counted)", made.workers->others);
  return text;
}

/// Wall time: all threads at work, from the lower end on; at worst as stretched as the workers' pilot was.
struct WallTime {
  double value = 0, low = 0, high = 0;
};

WallTime wall_time(const MadeQuote& made) {
  const auto frames = static_cast<double>(made.frames), n = static_cast<double>(made.workers ? made.workers->threads : made.threads);
  const double stretch = made.workers ? made.workers->stretch : 1;
  return {made.quote.cpu_seconds * frames / n, made.quote.cpu_low * frames / n, made.quote.cpu_high * frames / n * stretch};
}

/// Of an error, or of the error that `samples` reach.
Quote quote_of(const QuoteRun& run, const Pilot& pilot, int64_t samples) {
  const auto quote = pilot.record.points.empty() ? std::nullopt
                     : run.error                 ? quote_error(pilot, *run.error)
                                                 : quote_samples(pilot, samples);
  if (!quote) throw NoQuote("no quote: the pilot saw no error to go by (a black picture, or too little --pilot-time)");
  return *quote;
}

void add_doubt(std::string& uncertain, const std::string& doubt) {
  if (!doubt.empty()) uncertain += (uncertain.empty() ? "" : "; ") + doubt;
}

/// The local pilot; `warn` says on standard error what is odd about the scene.
MadeQuote local_quote(const QuoteRun& run, bool warn, int64_t& pixels, int64_t& samples) {
  const auto start = std::chrono::steady_clock::now();
  ReadOptions read;
  read.allow_outside_files = run.outside_files;
  if (warn) read.warn = [](const std::string& line) { note("warning: {}\n", line); };
  const FrameRenderer frame(run.scene, run.settings, read);
  MadeQuote made;
  made.load_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  made.threads = processors();
  made.pilot = run_pilot(frame, {run.pilot_seconds, run.error, made.threads}, interrupt_flag());
  made.quote = quote_of(run, made.pilot, frame.samples());
  pixels = frame.header().bounds.area();
  samples = frame.samples();
  return made;
}

nlohmann::json quote_json(const MadeQuote& made) {
  const Quote& quote = made.quote;
  const auto frames = static_cast<double>(made.frames);
  const WallTime wall = wall_time(made);
  nlohmann::json json{{"relative_error", quote.error},
                      {"samples", quote.samples},
                      {"samples_interval", {quote.samples_low, quote.samples_high}},
                      {"frames", made.frames},
                      {"cpu_seconds", quote.cpu_seconds * frames},
                      {"cpu_seconds_interval", {quote.cpu_low * frames, quote.cpu_high * frames}},
                      {"machines", made.workers ? "workers" : "this machine"},
                      {"threads", made.workers ? made.workers->threads : made.threads},
                      {"seconds", wall.value},
                      {"seconds_interval", {wall.low, wall.high}},
                      {"load_seconds", made.load_seconds},
                      {"uncertain", quote.uncertain},
                      {"pilot",
                       {{"samples", made.pilot.record.points.back().samples},
                        {"pixel_share", made.pilot.pixel_share},
                        {"cpu_seconds", made.pilot.cpu_seconds},
                        {"relative_error", made.pilot.record.points.back().error.relative_error->value}}}};
  if (const auto& workers = made.workers)
    json["workers"] = {{"connected", workers->workers}, {"of_another_build", workers->others}, {"job_id", workers->job},
                       {"samples", workers->samples},   {"cpu_seconds", workers->cpu_seconds}, {"stretch", workers->stretch}};
  return json;
}

}  // namespace

MadeQuote make_quote(const QuoteRun& run) {
  int64_t pixels = 0, samples = 0;
  return local_quote(run, !run.json, pixels, samples);
}

MadeQuote make_quote(const QuoteRun& run, Service& service, const Submission& submission) {
  int64_t pixels = 0, samples = 0;
  // Before the pilot, which would be in vain without a worker.
  ready_workers(service);
  // The submission has read the scene, and warned.
  MadeQuote made = local_quote(run, false, pixels, samples);
  const v1::SubmitJobRequest& request = submission.request;
  WorkerPilotOptions options;
  options.quiet = run.json;
  options.wait_seconds = run.wait_seconds;
  options.tile = request.settings().tile_size() > 0 ? static_cast<int>(request.settings().tile_size()) : kJobTile;
  if (request.has_target()) options.tile = std::min(options.tile, kBlockEdge);
  const double affordable = run.pilot_seconds / std::max(1e-12, made.pilot.seconds_per_sample);
  const int64_t most = std::min(request.has_target() ? kPassSamples : kTaskSamples, std::max<int64_t>(1, made.quote.samples));
  options.samples = static_cast<int64_t>(std::bit_floor(static_cast<uint64_t>(std::clamp(affordable, 1.0, static_cast<double>(most)))));
  made.workers = measure_workers(service, submission, options);
  made.frames = request.frames_size();
  made.pilot.seconds_per_sample = made.workers->seconds_per_path * static_cast<double>(pixels);
  made.pilot.seconds_deviation = made.workers->deviation;
  made.quote = quote_of(run, made.pilot, samples);
  add_doubt(made.quote.uncertain, made.workers->doubt);
  if (request.has_target())
    add_doubt(made.quote.uncertain, "a target samples where the error is, and may take fewer samples than even ones, as are quoted");
  if (made.frames > 1) add_doubt(made.quote.uncertain, fmt::format("it is that of the first of {} frames", made.frames));
  return made;
}

void print_quote(const QuoteRun& run, const MadeQuote& made) {
  if (run.json) {
    say_json(quote_json(made));
    return;
  }
  const Quote& quote = made.quote;
  const auto frames = static_cast<double>(made.frames);
  const WallTime wall = wall_time(made);
  const ErrorEstimate& seen = made.pilot.record.points.back().error;
  say("{}: an error of {:.3g} %\n", run.scene, 100 * quote.error);
  say("samples    {} per pixel ({} to {})\n", quote.samples, quote.samples_low, quote.samples_high);
  say("CPU time   {} ({} to {}){}\n", short_time(quote.cpu_seconds * frames), short_time(quote.cpu_low * frames),
      short_time(quote.cpu_high * frames), made.frames > 1 ? fmt::format(" for {} frames", made.frames) : "");
  say("time       {} ({} to {}) on {}; loading {}{}\n", short_time(wall.value), short_time(wall.low), short_time(wall.high), machines(made),
      short_time(made.load_seconds), made.workers ? " here" : "");
  say("pilot      {} samples of {:.3g} % of the pixels in {} of CPU time; their error was {:.3g} %\n", seen.samples,
      100 * made.pilot.pixel_share, short_time(made.pilot.cpu_seconds), 100 * seen.relative_error->value);
  if (const auto& workers = made.workers)
    say("workers    {} of every pixel in {} of CPU time, as job {}\n", plural(workers->samples, "sample"), short_time(workers->cpu_seconds),
        workers->job);
  if (!quote.uncertain.empty()) say("uncertain: {}\n", quote.uncertain);
}

v1::Quote to_wire(const MadeQuote& made) {
  const auto frames = static_cast<double>(made.frames);
  const WallTime wall = wall_time(made);
  v1::Quote wire;
  wire.set_relative_error(made.quote.error);
  wire.set_samples(made.quote.samples);
  wire.set_samples_low(std::min(made.quote.samples_low, made.quote.samples));
  wire.set_samples_high(std::max(made.quote.samples_high, made.quote.samples));
  wire.set_cpu_seconds(made.quote.cpu_seconds * frames);
  wire.set_cpu_seconds_low(std::min(made.quote.cpu_low, made.quote.cpu_seconds) * frames);
  wire.set_cpu_seconds_high(std::max(made.quote.cpu_high, made.quote.cpu_seconds) * frames);
  wire.set_seconds(wall.value);
  wire.set_seconds_low(std::min(wall.low, wall.value));
  wire.set_seconds_high(std::max(wall.high, wall.value));
  wire.set_machines(machines(made));
  wire.set_uncertain(made.quote.uncertain);
  return wire;
}

void add_quote_options(CLI::App& command, QuoteRun& run) {
  command
      .add_option("--pilot-time", run.pilot_seconds,
                  "CPU seconds the pilot may take, here and about as many again on workers; it ends sooner where it knows enough")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command.add_option("--quote-wait", run.wait_seconds, "Seconds that a quote waits for the workers' part of the pilot at most")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
}

void add_quote_command(CLI::App& app, int& code) {
  struct Options {
    QuoteRun run;
    std::optional<ServiceOptions> service;
  };
  auto* command = app.add_subcommand("quote", "Samples and time that an error will cost, from a short pilot");
  auto options = std::make_shared<Options>();
  command->add_option("scene", options->run.scene, "Scene file in pbrt-v4 format")->required();
  command
      ->add_option_function<std::string>(
          "--error", [options](const std::string& text) { options->run.error = parse_error_target("--error", text); },
          "Relative error to quote for, e.g. 0.02 or 2%; without it the error that --spp samples will reach")
      ->type_name("E");
  command
      ->add_option_function<std::string>(
          "--server", [options](const std::string& address) { options->service = ServiceOptions{address}; },
          "HOST:PORT of a coordinator: times on its present workers, measured by them, instead of this machine's")
      ->type_name("HOST:PORT")
      ->check(rpc::problem_of_address);
  add_frame_options(*command, options->run.settings);
  add_quote_options(*command, options->run);
  command->add_flag("--allow-outside-files", options->run.outside_files,
                    "Let the scene read files outside its own folder (not with --server)");
  command->add_flag("--json", options->run.json, "One JSON object on standard output, nothing else there");
  command->footer(
      "Examples:\n"
      "  woodcock quote scenes/cloud.pbrt --error 2%       what 2 % costs\n"
      "  woodcock quote scenes/cloud.pbrt --spp 256        what 256 samples reach\n"
      "  woodcock quote scenes/cloud.pbrt --error 2% --server 10.0.0.5:7420\n"
      "The samples are those of every pixel (`render --spp`); `render --target-error` takes fewer where noise is uneven.\n"
      "With --server the samples still come from a pilot here, and the workers render a small job for their times.");
  command->callback([options, &code] {
    if (options->service) {
      if (options->run.outside_files)
        throw CLI::ValidationError("--allow-outside-files", "the service takes no files from outside of a scene's folder");
      Service service(*options->service);
      Submission submission;
      submission.request.set_name(options->run.scene.substr(options->run.scene.find_last_of('/') + 1));
      add_frame(options->run.scene, options->run.settings, 0, submission);
      print_quote(options->run, make_quote(options->run, service, submission));
    } else {
      print_quote(options->run, make_quote(options->run));
    }
    code = 0;
  });
}

}  // namespace woodcock
