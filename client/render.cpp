// `woodcock render`: a frame in this process.
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "client/adaptive_render.h"
#include "client/commands.h"
#include "client/convergence_table.h"
#include "client/frame_options.h"
#include "client/health.h"
#include "client/interrupt.h"
#include "client/local_render.h"
#include "client/output_path.h"
#include "client/print.h"
#include "client/progress_line.h"
#include "renderer/accuracy/error.h"
#include "renderer/film/exr.h"
#include "renderer/film/picture_file.h"
#include "renderer/film/png.h"
#include "renderer/film/tile.h"
#include "renderer/frame/run_units.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;

struct RenderOptions {
  std::string scene;
  std::string output;
  FrameSettings settings;
  TargetOptions target;
  std::string samples;
  int threads = 0;
  int tile = 32;
  bool resume = false;
  bool json = false;
  bool outside_files = false;
};

/// "A:B" as a range; throws CLI::ValidationError.
SampleRange parse_samples(const std::string& text) {
  SampleRange range;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%ld:%ld%c", &range.begin, &range.end, &rest) != 2 || range.begin < 0 || range.empty() ||
      range.end > kMaxSamples) {
    throw CLI::ValidationError("--samples", "found \"" + text + "\", expected A:B with 0 <= A < B, e.g. 0:16");
  }
  return range;
}

int run(const RenderOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); };
  std::atomic<bool>& stop = interrupt_flag();

  ReadOptions read;
  read.allow_outside_files = options.outside_files;
  read.warn = [](const std::string& line) { note("warning: {}\n", line); };
  const FrameRenderer frame(options.scene, options.settings, read);
  const fs::path output = output_path(options.output, frame.description().film.file_name, options.resume);
  const double load_seconds = seconds();
  const int threads = options.threads > 0 ? options.threads : processors();
  const std::string repeat = fmt::format("woodcock render '{}'{} -o sample.exr", options.scene, options_of(options.settings));
  TargetOptions target = options.target;
  const std::optional<fs::path> there = options.resume ? nodes_to_resume(output) : std::nullopt;
  const bool to_a_map = !target.adaptive() && there && ExrReader(*there).info().map;
  if (to_a_map && !options.samples.empty())
    throw FilmError(there->string(), "cannot be resumed by a range: its blocks hold different numbers of samples; leave --samples out");
  if (to_a_map) target.max_samples = frame.samples();
  if (to_a_map || target.adaptive())
    return run_adaptive(
        frame, target, {output, options.tile, threads, there, options.json, load_seconds, format_bias(options.settings.estimator), repeat});

  SampleRange samples{0, frame.samples()};
  if (!options.samples.empty()) samples = parse_samples(options.samples);
  std::vector<Tile> earlier;
  if (there) {
    earlier = earlier_nodes(*there, frame.header());
    if (!earlier.empty()) {
      if (earlier.front().range.begin != samples.begin) {
        throw FilmError(there->string(), fmt::format("cannot be resumed: its samples begin at {}, this render's at {}",
                                                     earlier.front().range.begin, samples.begin));
      }
      samples.begin = std::min(earlier.back().range.end, samples.end);
      if (earlier.back().range.end > samples.end)
        note("{} holds {} samples per pixel already, more than the {} asked for: all of them are kept\n", there->string(),
             earlier.back().range.end, samples.end);
    }
  }

  RenderProgress progress;
  ProgressLine line("rendering", options.json);
  const double total = static_cast<double>(samples.size()) * static_cast<double>(frame.header().bounds.area());
  const auto render_start = seconds();
  const LocalRender result = render_locally(frame, samples, std::move(earlier), options.tile, threads, progress, stop, [&] {
    const double done = static_cast<double>(progress.samples.load());
    line.show(total > 0 ? done / total : 1, format_count(done / std::max(1e-9, seconds() - render_start)) + "samples/s");
  });
  line.finish();
  const double render_seconds = seconds() - render_start;

  if (result.samples.empty()) {
    report_health(progress.counters, repeat);
    note("interrupted before any tile was finished: there is no picture, and {} is not written\n", output.string());
    return 3;
  }
  const ErrorEstimate error = write_picture(output, frame.header(), result);
  const fs::path png = fs::path(output).replace_extension(".png");
  write_png(nodes_path(output), png);

  const FrameHeader& header = frame.header();
  const nlohmann::json convergence = convergence_json(result.convergence, threads);
  write_sidecar(output, {{"picture", output.filename().string()},
                         {"samples", {result.samples.begin, result.samples.end}},
                         {"threads", threads},
                         {"load_seconds", load_seconds},
                         {"render_seconds", render_seconds},
                         {"convergence", convergence}});
  if (options.json) {
    nlohmann::json j{{"output", output.string()},
                     {"nodes", nodes_path(output).string()},
                     {"png", png.string()},
                     {"complete", result.complete},
                     {"samples", {result.samples.begin, result.samples.end}},
                     {"resolution", {header.width, header.height}},
                     {"threads", threads},
                     {"load_seconds", load_seconds},
                     {"render_seconds", render_seconds},
                     {"pixel_digest", digest_of_pixels(header, result.nodes.empty() ? result.first_tiles : result.nodes)},
                     {"error", error_json(error)},
                     {"convergence", convergence},
                     {"sidecar", sidecar_path(output).string()},
                     {"counters", counters_json(progress.counters)}};
    for (const auto& [key, value] : header.settings) j["settings"][key] = value;
    say_json(j);
  } else {
    say("{}: samples {} to {} of {}x{} pixels, {} ({} samples/s), {} threads\n", output.string(), result.samples.begin, result.samples.end,
        header.width, header.height, format_seconds(render_seconds),
        format_count(static_cast<double>(progress.samples) / std::max(1e-9, render_seconds)), threads);
    say("{}: the same picture to look at\n{}: its samples, for --resume and merge\n", png.string(), nodes_path(output).string());
    say("{}{}{}", Lines{format_error(error)}, Lines{format_bias(options.settings.estimator)},
        Lines{format_convergence(result.convergence, threads)});
    say("{}: errors and times\n", sidecar_path(output).string());
  }
  report_health(progress.counters, repeat);
  if (!result.complete) {
    if (error.missing_pixels > 0) {
      note("interrupted in the first pass: {} misses {} pixels (count 0) and cannot be resumed\n", output.string(), error.missing_pixels);
    } else {
      note("interrupted: {} holds the samples up to {}; continue with --resume\n", output.string(), result.samples.end);
    }
    return 3;
  }
  return 0;
}

}  // namespace

void add_render_command(CLI::App& app, int& code) {
  auto* command = app.add_subcommand("render", "Render a scene in this process");
  auto options = std::make_shared<RenderOptions>();
  command->add_option("scene", options->scene, "Scene file in pbrt-v4 format")->required();
  command->add_option(
      "-o,--output", options->output,
      "EXR to write, its samples beside it as NAME.nodes.exr; without it the scene's own file name, which must not exist yet");
  add_frame_options(*command, options->settings);
  add_target_options(*command, options->target);
  add_sample_map_option(*command, options->target);
  command->add_option("--samples", options->samples, "Render only the sample indices A:B, to be put together with `woodcock merge`");
  command->add_option("--threads", options->threads, "Threads (default: one for each processor)")->check(CLI::Range(1, 1024));
  command->add_option("--tile", options->tile, "Edge of the tiles in pixels; never changes a bit of the picture")
      ->check(CLI::Range(1, 4096))
      ->capture_default_str();
  command->add_flag("--resume", options->resume, "Go on with the samples of an existing output");
  command->add_flag("--allow-outside-files", options->outside_files, "Let the scene read files outside its own folder");
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer(
      "Examples:\n"
      "  woodcock render scenes/cloud.pbrt -o cloud.exr --spp 64\n"
      "  woodcock render scenes/cloud.pbrt -o cloud.exr --spp 256 --resume     only the other 192\n"
      "  woodcock render scenes/cloud.pbrt -o cloud.exr --target-error 2% --max-time 5min\n"
      "Ctrl-C leaves a valid picture of the samples that are finished (exit code 3).");
  command->callback([options, &code] {
    settle_targets(options->target, options->settings);
    if (options->target.adaptive() && !options->samples.empty())
      throw CLI::ValidationError("--samples", "a target decides which samples are rendered: leave --samples out");
    code = run(*options);
  });
}

}  // namespace woodcock
