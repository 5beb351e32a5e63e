#include "client/adaptive_render.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <fstream>
#include <memory>

#include "client/convergence_table.h"
#include "client/health.h"
#include "client/interrupt.h"
#include "client/print.h"
#include "client/progress_line.h"
#include "renderer/accuracy/error.h"
#include "renderer/film/exr.h"
#include "renderer/film/picture_file.h"
#include "renderer/film/png.h"
#include "renderer/frame/adaptive_frame.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;

/// A number and the unit that follows it; nullopt where there is no positive finite number.
std::optional<std::pair<double, std::string>> number_with_unit(const std::string& text) {
  double value = 0;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || !std::isfinite(value) || value <= 0) return std::nullopt;
  return std::pair(value, std::string(rest, text.data() + text.size()));
}

enum class End { kTarget, kSamples, kTime, kInterrupt, kMap };

const char* name_of(End end) {
  static constexpr const char* kNames[] = {"target", "samples", "time", "interrupt", "map"};
  return kNames[static_cast<int>(end)];
}

std::string end_line(End end, const TargetOptions& options, const SampleMap& map, double pixels) {
  const auto [least, most] = std::minmax_element(map.counts.begin(), map.counts.end());
  const std::string held =
      fmt::format("{} to {} samples per pixel, {:.1f} on average", *least, *most, static_cast<double>(map.samples()) / pixels);
  const std::string aim = options.error ? fmt::format(" the target of {:.3g} %", 100 * *options.error) : "";
  switch (end) {
    case End::kTarget:
      return fmt::format("reached{}: {}\n", aim, held);
    case End::kSamples:
      if (map.largest() < options.max_samples.value_or(SamplingTarget{}.max_samples))
        return fmt::format("ended without noise to go by, as in a black picture{}{}: {}\n", aim.empty() ? "" : ", before", aim, held);
      return fmt::format("ended by the limit of {} samples per pixel{}{}: {}\n", map.largest(), aim.empty() ? "" : ", before", aim, held);
    case End::kTime:
      return fmt::format("ended by the limit of {}{}{}: {}\n", format_seconds(*options.max_seconds), aim.empty() ? "" : ", before", aim,
                         held);
    case End::kInterrupt:
      return fmt::format("interrupted{}{}: {}\n", aim.empty() ? "" : " before", aim, held);
    case End::kMap:
      return fmt::format("rendered as asked: {}\n", held);
  }
  return {};
}

}  // namespace

double parse_error_target(const std::string& option, const std::string& text) {
  if (const auto number = number_with_unit(text)) {
    const auto& [value, unit] = *number;
    const double error = unit == "%" ? value / 100 : value;
    if ((unit.empty() || unit == "%") && error <= 1) return error;
  }
  throw CLI::ValidationError(option, "found \"" + text + "\", expected a relative error up to 1, e.g. 0.02 or 2%");
}

double parse_time_limit(const std::string& text) {
  if (const auto number = number_with_unit(text)) {
    const auto& [value, unit] = *number;
    if (unit.empty() || unit == "s") return value;
    if (unit == "min") return 60 * value;
    if (unit == "h") return 3600 * value;
  }
  throw CLI::ValidationError("--max-time", "found \"" + text + "\", expected a time such as 90s, 5min or 2h");
}

void add_target_options(CLI::App& command, TargetOptions& options) {
  command
      .add_option_function<std::string>(
          "--target-error", [&options](const std::string& text) { options.error = parse_error_target("--target-error", text); },
          "Relative error at which to end, e.g. 0.02 or 2%: samples go where the error is, in blocks of 32x32 pixels")
      ->type_name("E");
  command.add_option("--max-spp", options.max_samples, "Most samples of any pixel (with a target the default is 1048576)")
      ->check(CLI::PositiveNumber);
  command
      .add_option_function<std::string>(
          "--max-time", [&options](const std::string& text) { options.max_seconds = parse_time_limit(text); },
          "Time to render, e.g. 90s, 5min or 2h; without a target it goes where the error is")
      ->type_name("T");
}

void add_sample_map_option(CLI::App& command, TargetOptions& options) {
  command.add_option("--sample-map", options.sample_map, "Render exactly the samples of this EXR, or of the JSON of an earlier render")
      ->type_name("FILE")
      ->check(CLI::ExistingFile);
}

void settle_targets(TargetOptions& options, FrameSettings& settings) {
  const auto refuse = [](const std::string& why) { throw CLI::ValidationError("--max-spp", why); };
  if (!options.sample_map.empty() && (options.error || options.max_seconds || options.max_samples || settings.samples))
    throw CLI::ValidationError("--sample-map", "it says how many samples each pixel gets: leave the targets and --spp out");
  if (options.max_samples && settings.samples && *options.max_samples != *settings.samples)
    refuse("--spp and --max-spp both limit the samples of a pixel: give one of them");
  if (!options.adaptive()) {
    if (options.max_samples) settings.samples = options.max_samples;
    return;
  }
  if (!options.max_samples) options.max_samples = settings.samples;
  if (options.max_samples && (*options.max_samples < kFirstCount || *options.max_samples > kMaxMapSamples))
    refuse(fmt::format("found {}, expected {} to {} with a target: the first pass takes {} samples", *options.max_samples, kFirstCount,
                       kMaxMapSamples, kFirstCount));
}

SamplingTarget sampling_target(const TargetOptions& options) {
  SamplingTarget target;
  target.error = options.error.value_or(0);
  target.max_samples = options.max_samples.value_or(target.max_samples);
  return target;
}

nlohmann::json sample_map_json(const SampleMap& map) {
  return {{"block", kBlockEdge}, {"bounds", {map.rect.x0, map.rect.y0, map.rect.x1, map.rect.y1}}, {"counts", to_text(map.counts)}};
}

SampleMap read_sample_map(const fs::path& file, PixelRect bounds) {
  const auto refuse = [&](const std::string& why) { throw FilmError(file.string(), "is no sample map of this frame: " + why); };
  SampleMap map{bounds, {}};
  if (file.extension() == ".exr") {
    const FrameFile frame = look_at(file);
    if (frame.kind == FrameFile::Kind::kOther) refuse(frame.why);
    const NodeFileInfo& info = frame.info;
    if (!(info.rect == bounds)) refuse("its pixels are others");
    if (info.samples.begin != 0 || info.samples.end > kMaxMapSamples) refuse("its samples do not begin at 0, or are too many");
    for (size_t b = 0; b < map.grid().size(); ++b) map.counts.push_back(info.count_of_block(b));
    return map;
  }
  try {
    std::ifstream in(file);
    const nlohmann::json json = nlohmann::json::parse(in);
    const nlohmann::json& object = json.contains("sample_map") ? json.at("sample_map") : json;
    if (object.at("block").get<int>() != kBlockEdge) refuse(fmt::format("its blocks are not of {} pixels", kBlockEdge));
    if (object.at("bounds") != sample_map_json(map).at("bounds")) refuse("its pixels are others");
    auto counts = parse_counts(object.at("counts").get<std::string>(), map.grid().size());
    if (!counts) refuse("its counts are malformed");
    map.counts = std::move(*counts);
  } catch (const nlohmann::json::exception& error) {
    refuse(error.what());
  }
  return map;
}

int run_adaptive(const FrameRenderer& frame, const TargetOptions& options, const AdaptiveRun& run) {
  const FrameHeader& header = frame.header();
  BlockFrame blocks(header.bounds);
  if (run.earlier) blocks = read_blocks(*run.earlier, header);
  const int64_t before = blocks.map.samples();

  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); };
  std::atomic<bool>& interrupted = interrupt_flag();
  const auto out_of_time = [&] { return options.max_seconds && seconds() >= *options.max_seconds; };
  RenderProgress progress;
  std::unique_ptr<ProgressLine> line;
  uint64_t pass_begin = 0;
  double pass_total = 0, cpu_seconds = 0;
  PassSetting setting{run.tile, run.threads, [&] { return interrupted.load() || out_of_time(); },
                      [&] {
                        const double done = static_cast<double>(progress.samples.load() - pass_begin);
                        line->show(done / std::max(1.0, pass_total),
                                   format_count(static_cast<double>(progress.samples.load()) / std::max(1e-9, seconds())) + "samples/s");
                      }};
  const auto begin_line = [&](const std::string& what, int64_t samples) {
    if (line) line->finish();
    line = std::make_unique<ProgressLine>(what, run.json);
    pass_begin = progress.samples;
    pass_total = static_cast<double>(samples);
  };

  End end = End::kMap;
  AdaptiveProgress state;
  nlohmann::json passes = nlohmann::json::array();
  const double pixels = static_cast<double>(header.bounds.area());
  if (!options.sample_map.empty() || !options.adaptive()) {
    SampleMap map = blocks.map;
    if (!options.sample_map.empty()) {
      map = read_sample_map(options.sample_map, header.bounds);
    } else {
      if (*options.max_samples > kMaxMapSamples)
        throw FilmError(run.output.string(), fmt::format("cannot be resumed to more than {} samples per pixel", kMaxMapSamples));
      for (int64_t& count : map.counts) count = std::max(count, *options.max_samples);
    }
    for (size_t b = 0; b < map.counts.size(); ++b)
      if (blocks.map.counts[b] > map.counts[b])
        throw FilmError(run.output.string(), "cannot be resumed: it holds more samples than the sample map asks for");
    begin_line("rendering", map.samples() - before);
    state.pass = 1;
    if (!render_pass(frame, map.counts, setting, progress, blocks, cpu_seconds)) end = End::kInterrupt;
  } else {
    state = render_adaptively(frame, sampling_target(options), setting, progress, blocks, cpu_seconds, [&](const AdaptiveProgress& p) {
      if (p.error > 0)
        passes.push_back({{"mean_samples", static_cast<double>(blocks.map.samples()) / pixels},
                          {"relative_error", p.error},
                          {"cpu_seconds", cpu_seconds},
                          {"active_blocks", p.active}});
      const std::string aim = options.error ? fmt::format(" of {:.3g} %", 100 * *options.error) : "";
      const std::string error = p.error > 0 ? fmt::format("error {:.3g} %{}, ", 100 * p.error, aim) : "";
      begin_line(fmt::format("pass {}: {}{} of {} blocks", p.pass, error, p.active, blocks.map.counts.size()), p.samples);
    });
    end = state.end == EndOfSampling::kTargetReached ? End::kTarget
          : state.end == EndOfSampling::kSampleLimit ? End::kSamples
          : interrupted                              ? End::kInterrupt
                                                     : End::kTime;
  }
  if (line) line->finish();
  const double render_seconds = seconds();

  if (blocks.map.samples() == 0) {
    report_health(progress.counters, run.repeat);
    note("ended before any block was finished: there is no picture, and {} is not written\n", run.output.string());
    return 3;
  }
  const ErrorEstimate error = write_blocks(run.output, header, blocks);
  const fs::path png = fs::path(run.output).replace_extension(".png");
  write_png(nodes_path(run.output), png);

  const double mean_before = static_cast<double>(before) / pixels;
  const Convergence record{{{error.samples, error, cpu_seconds}}, std::llround(mean_before)};
  const nlohmann::json convergence = convergence_json(record, run.threads);
  write_sidecar(run.output, {{"picture", run.output.filename().string()},
                             {"ended_by", name_of(end)},
                             {"sample_map", sample_map_json(blocks.map)},
                             {"after_passes", passes},
                             {"threads", run.threads},
                             {"load_seconds", run.load_seconds},
                             {"render_seconds", render_seconds},
                             {"convergence", convergence}});
  if (run.json) {
    std::vector<Tile> nodes;
    for (const auto& block : blocks.nodes) nodes.insert(nodes.end(), block.begin(), block.end());
    nlohmann::json j{{"output", run.output.string()},
                     {"nodes", nodes_path(run.output).string()},
                     {"png", png.string()},
                     {"complete", end != End::kInterrupt},
                     {"ended_by", name_of(end)},
                     {"passes", state.pass},
                     {"samples", {0, blocks.map.largest()}},
                     {"mean_samples", static_cast<double>(blocks.map.samples()) / pixels},
                     {"new_samples", blocks.map.samples() - before},
                     {"sample_map", sample_map_json(blocks.map)},
                     {"resolution", {header.width, header.height}},
                     {"threads", run.threads},
                     {"load_seconds", run.load_seconds},
                     {"render_seconds", render_seconds},
                     {"cpu_seconds", cpu_seconds},
                     {"pixel_digest", digest_of_pixels(header, nodes)},
                     {"error", error_json(error)},
                     {"after_passes", passes},
                     {"convergence", convergence},
                     {"sidecar", sidecar_path(run.output).string()},
                     {"counters", counters_json(progress.counters)}};
    if (options.error) j["target_error"] = *options.error;
    for (const auto& [key, value] : header.settings) j["settings"][key] = value;
    say_json(j);
  } else {
    say("{}: {}x{} pixels in {} passes, {} ({:.3g} s of processor time, {} samples/s), {} threads\n", run.output.string(), header.width,
        header.height, state.pass, format_seconds(render_seconds), cpu_seconds,
        format_count(static_cast<double>(progress.samples) / std::max(1e-9, render_seconds)), run.threads);
    say("{}: the same picture to look at\n{}: its samples, for --resume and merge\n", png.string(), nodes_path(run.output).string());
    say("{}{}{}", Lines{format_error(error)}, Lines{run.bias}, Lines{format_convergence(record, run.threads)});
    say("{}: errors and times\n{}", sidecar_path(run.output).string(), Lines{end_line(end, options, blocks.map, pixels)});
  }
  report_health(progress.counters, run.repeat);
  if (error.missing_pixels > 0)
    note("{} of {} pixels have no samples yet and are black; continue with --resume\n", error.missing_pixels, header.bounds.area());
  if (end == End::kInterrupt) note("interrupted: continue with --resume\n");
  return end == End::kInterrupt || error.missing_pixels > 0 ? 3 : 0;
}

}  // namespace woodcock
