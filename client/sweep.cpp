// `woodcock sweep`: what accuracy costs in time, estimator against estimator.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <thread>

#include "client/commands.h"
#include "client/frame_options.h"
#include "client/interrupt.h"
#include "client/print.h"
#include "client/progress_line.h"
#include "client/sweep_plan.h"
#include "client/sweep_results.h"
#include "client/sweep_run.h"
#include "client/sweep_service.h"
#include "client/sweep_store.h"
#include "renderer/core/sha256.h"
#include "renderer/frame/run_units.h"
#include "renderer/scene/scene_error.h"
#include "renderer/world/effect_plan.h"
#include "rpc/address.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;

struct Options : SweepOptions {
  std::string counts_text = "1,2,4,...,256", depths_text;
  std::optional<ServiceOptions> service;
  int threads = 0;
  bool json = false;
};

std::string processor_name() {
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);)
    if (line.rfind("model name", 0) == 0 && line.find(": ") != std::string::npos) return line.substr(line.find(": ") + 2);
  return "unknown";
}

std::string digest_of_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  if (!in) throw std::runtime_error("reference " + path.string() + " cannot be read");
  Sha256 digest;
  digest.field(bytes);
  return digest.hex();
}

/// Everything a second run must agree with.
nlohmann::json identity_of(const SweepOptions& options, const SweepPlan& plan, const FrameHeader& header, bool by_service) {
  nlohmann::json j = describe_plan(plan);
  j["scene digest"] = header.scene_digest;
  j["resolution"] = {header.width, header.height};
  j["pixels"] = {header.bounds.x0, header.bounds.y0, header.bounds.x1, header.bounds.y1};
  // The service pins a build and a class to each job itself.
  j["rendered by"] = by_service ? "the service" : header.build + ", " + header.arithmetic_class;
  j["reference digest"] = options.reference.empty() ? "made here" : digest_of_file(options.reference);
  return j;
}

/// A reference that is given, checked before anything is rendered. Throws FilmError where it is of another size.
SweepReference given_reference(const fs::path& path, PixelRect bounds) {
  SweepReference reference = load_reference(path, "given: " + path.filename().string());
  if (reference.picture.width != bounds.width() || reference.picture.height != bounds.height())
    throw FilmError(path.string(), fmt::format("is {}x{} pixels, the sweep's pictures are {}x{}", reference.picture.width,
                                               reference.picture.height, bounds.width(), bounds.height()));
  return reference;
}

/// The sweep while it goes on.
class Sweep {
 public:
  Sweep(const SweepPlan& plan, const SweepStore& store, SweepEngine& engine, SweepFindings& findings)
      : plan_(plan), store_(store), engine_(engine), findings_(findings) {}

  /// False when interrupted.
  bool run() { return references() && curves() && effects(); }

 private:
  /// A run with its record, unless it is done or cannot be.
  std::optional<RunRecord> open(const SweepRun& run) const {
    RunRecord record = store_.load(run.id);
    return record.at(run.samples) != nullptr || !record.refused.empty() ? std::nullopt : std::optional(std::move(record));
  }
  void begin(const SweepRun& run) {
    if (auto record = open(run)) engine_.begin(run, store_, *record);
  }
  bool finish(const SweepRun& run, const MeasurePicture& measure) {
    auto record = open(run);
    if (!record) return true;
    return !interrupt_flag() && engine_.finish(run, store_, *record, measure);
  }

  bool references() {
    const auto none = [](const fs::path&) { return std::nullopt; };
    for (size_t g = findings_.references.size(); g < plan_.groups.size(); ++g) {
      // In steps that double, so that an interrupted sweep loses little of it.
      const std::string id = reference_id(g);
      SweepRun run{id, id, plan_.groups[g].reference, std::min<int64_t>(64, plan_.reference_samples), false};
      while (true) {
        begin(run);
        if (!finish(run, none)) return false;
        if (run.samples == plan_.reference_samples) break;
        run.samples = run.samples < plan_.reference_samples / 2 ? 2 * run.samples : plan_.reference_samples;
      }
      findings_.references.push_back(load_reference(store_.picture(store_.load(id).nodes), "made for this sweep by the estimator auto"));
    }
    return true;
  }

  SweepRun run_of(const SweepStep& step) const {
    const SweepCurve& curve = plan_.curves[step.curve];
    SweepRun run{run_id(curve, step.seed), curve.id, curve.settings, step.samples, step.seed == 0};
    run.settings.seed = plan_.first_seed + step.seed;
    return run;
  }

  bool curves() {
    const auto steps = sweep_order(plan_.curves.size(), plan_.seeds, plan_.counts);
    const size_t a_count = plan_.curves.size() * plan_.seeds;
    for (size_t i = 0; i < steps.size(); ++i) {
      // All runs of a count go to the engine together.
      if (i % a_count == 0)
        for (size_t k = i; k < i + a_count && !interrupt_flag(); ++k) begin(run_of(steps[k]));
      const SweepReference& reference = findings_.references[plan_.curves[steps[i].curve].group];
      const auto measure = [&](const fs::path& exr) -> std::optional<double> {
        return relative_mse(read_picture(exr).luminances(), reference.luminance);
      };
      if (!finish(run_of(steps[i]), measure)) return false;
    }
    return true;
  }

  bool effects() {
    for (const SweepEffect& effect : plan_.effects) {
      SweepRun run{effect.id, effect.id, effect.settings, plan_.effect_samples, false};
      run.settings.seed = plan_.first_seed;
      try {
        begin(run);
        if (!finish(run, [](const fs::path&) { return std::nullopt; })) return false;
      } catch (const SceneError& error) {
        refuse(effect, error.what());
      } catch (const std::invalid_argument& error) {
        refuse(effect, error.what());
      }
    }
    return true;
  }

  /// What cannot be left out of this scene is a finding too.
  void refuse(const SweepEffect& effect, const std::string& why) {
    RunRecord record = store_.load(effect.id);
    record.refused = why;
    store_.save(effect.id, record);
  }

  const SweepPlan& plan_;
  const SweepStore& store_;
  SweepEngine& engine_;
  SweepFindings& findings_;
};

/// The scene is looked at with the first value of each set.
std::vector<std::string> first_values(const std::vector<std::string>& sets) {
  std::vector<std::string> values;
  for (const std::string& set : sets) values.push_back(set.substr(0, std::min(set.find(','), set.size())));
  return values;
}

/// The plan; what makes no sense is wrong usage.
SweepPlan plan_or_usage(const SweepOptions& options, int scene_depth, uint64_t scene_seed) {
  try {
    return plan_sweep(options, scene_depth, scene_seed);
  } catch (const std::invalid_argument& error) {
    throw CLI::ValidationError(std::string("--") + error.what());
  }
}

std::vector<int64_t> parse_list(const std::string& option, const std::string& text) {
  try {
    return parse_sample_counts(text);
  } catch (const std::invalid_argument& error) {
    throw CLI::ValidationError(option, error.what());
  }
}

int checked_depth(int64_t depth) {
  constexpr int64_t kDeepest = 1000000;
  if (depth > kDeepest)
    throw CLI::ValidationError("--max-depth", fmt::format("found {}, expected at most {} scatterings", depth, kDeepest));
  return static_cast<int>(depth);
}

int run(Options& options) {
  options.counts = parse_list("--spp", options.counts_text);
  if (!options.depths_text.empty())
    for (const int64_t depth : parse_list("--max-depth", options.depths_text)) options.depths.push_back(checked_depth(depth));
  const std::atomic<bool>& stop = interrupt_flag();
  const int threads = options.threads > 0 ? options.threads : processors();
  ProgressLine line("sweeping", options.json);
  uint64_t done = 0;
  double total = 1;
  LocalSweep local(options, threads, stop, [&](uint64_t samples) {
    done += samples;
    line.show(std::min(1.0, static_cast<double>(done) / total), fmt::format("{}samples", format_count(static_cast<double>(done))));
  });

  FrameSettings base = options.settings;
  base.directions.reset();
  base.branching.reset();
  base.set = first_values(options.sets);
  const FrameRenderer& scene = local.frame("as it is", base);
  const RenderSettings& own = scene.description().settings;
  const SweepPlan plan = plan_or_usage(options, own.max_depth, own.seed);
  // What cannot be rendered is said before hours are spent on the rest.
  std::unique_ptr<ServiceSweep> service;
  if (options.service) {
    service = std::make_unique<ServiceSweep>(options, *options.service);
  } else {
    for (const SweepCurve& curve : plan.curves) local.frame(curve.id, curve.settings);
  }
  const FrameHeader& header = scene.header();
  SweepFindings findings;
  if (!options.reference.empty()) findings.references.push_back(given_reference(options.reference, header.bounds));
  const SweepStore store(options.folder, identity_of(options, plan, header, service != nullptr));
  total = static_cast<double>(header.bounds.area()) *
          (static_cast<double>(plan.reference_samples * static_cast<int64_t>(plan.groups.size())) +
           static_cast<double>(plan.counts.back()) * static_cast<double>(plan.seeds * plan.curves.size()) +
           static_cast<double>(plan.effect_samples * static_cast<int64_t>(plan.effects.size())));

  findings.plan = &plan;
  findings.store = &store;
  findings.title = "Sweep of " + fs::path(options.scene).filename().string();
  for (const EffectEntry& e : plan_effects(scene.description(), scene.world()))
    findings.effect_plan.push_back({e.effect, e.needed, e.reason});
  findings.facts = {
      {"scene", fs::path(options.scene).filename().string()},
      {"scene digest", header.scene_digest},
      {"resolution", fmt::format("{}x{} pixels", header.width, header.height)},
      {"depth limit", std::to_string(scene.description().settings.max_depth)},
      {"seeds", fmt::format("{}, the first is {}", plan.seeds, plan.first_seed)},
      {"rendered by", service ? "the workers of the service at " + options.service->coordinator : "this machine"},
      {"processor", service ? "that of the workers, whose CPU time is shown"
                            : fmt::format("{}, {} threads of {}", processor_name(), threads, std::thread::hardware_concurrency())},
      {"render build", header.build},
      {"arithmetic class", header.arithmetic_class}};

  Sweep sweep(plan, store, service ? static_cast<SweepEngine&>(*service) : local, findings);
  const bool complete = sweep.run();
  line.finish();
  if (findings.references.size() < plan.groups.size()) {
    note("interrupted before the reference was finished: run the same command again to go on\n");
    return 3;
  }
  const std::string state = write_results(findings);
  if (options.json) {
    say_json({{"folder", options.folder},
              {"complete", complete},
              {"state", state},
              {"report", (fs::path(options.folder) / "report.html").string()}});
  } else {
    say("{}\n{}: the report\n", state, (fs::path(options.folder) / "report.html").string());
  }
  return complete ? 0 : 3;
}

}  // namespace

void add_sweep_command(CLI::App& app, int& code) {
  auto* command = app.add_subcommand("sweep", "Measure the error of estimators over samples and CPU time, and write a report");
  auto options = std::make_shared<Options>();
  command->add_option("scene", options->scene, "Scene file in pbrt-v4 format")->required();
  command->add_option("-o,--output", options->folder, "Folder for results and report; a sweep that is there goes on")->required();
  command->add_option("--spp", options->counts_text, "Samples per pixel; \"...\" goes on by the same factor")
      ->type_name("LIST")
      ->capture_default_str();
  command->add_option("--estimators", options->estimators, "Estimators: see `woodcock estimators`")
      ->delimiter(',')
      ->type_name("LIST")
      ->capture_default_str();
  command->add_option("--step", options->steps, "Lengths of a step in world units: each estimator that marches, with each")
      ->delimiter(',')
      ->type_name("LIST");
  command->add_option("--max-depth", options->depths_text, "Scatterings a path may have: each estimator with each, against the deepest")
      ->type_name("LIST");
  command->add_option("--seeds", options->seeds, "Independent pictures of each; intervals are those between them")
      ->check(CLI::Range(1, kMaxSeeds))
      ->capture_default_str();
  command->add_option("--reference", options->reference, "EXR to measure against (default: one is made by auto)")->check(CLI::ExistingFile);
  command
      ->add_option("--reference-spp", options->reference_samples,
                   "Samples of the reference that is made (default: 4 times the largest count)")
      ->check(CLI::PositiveNumber)
      ->excludes("--reference");
  command->add_flag("--effects", options->effects, "Also measure what each feature and effect costs, by leaving it out of auto");
  command
      ->add_option("--set", options->sets,
                   "Values of a parameter of the scene, e.g. medium.smoke.g=0,0.5,0.8: each with each, each its own reference")
      ->allow_extra_args(false)
      ->type_name("PATH=LIST");
  add_picture_options(*command, options->settings);
  add_shared_estimator_options(*command, options->settings);
  auto* server = command
                     ->add_option_function<std::string>(
                         "--server",
                         [options](const std::string& address) {
                           options->service = ServiceOptions{address};
                           options->by_workers = true;
                         },
                         "Let the workers of this coordinator render, each picture as a job (default: this process)")
                     ->type_name("HOST:PORT")
                     ->check(rpc::problem_of_address);
  command->add_option("--threads", options->threads, "Threads (default: one for each processor)")
      ->check(CLI::Range(1, 1024))
      ->excludes(server);
  command->add_flag("--allow-outside-files", options->allow_outside_files, "Let the scene read files outside its own folder");
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer(
      "Examples:\n"
      "  woodcock sweep scenes/paper/fig08.pbrt --estimators march,woodcock,auto --step 0.4,0.1 --spp 1,2,4,...,256 -o sweep\n"
      "  woodcock sweep scenes/cloud.pbrt --max-depth 1,2,4,8,16,32 --resolution 160x90 -o depth     how deep must paths go?\n"
      "Ctrl-C leaves a report of what is there (exit code 3); the same command goes on.");
  command->callback([options, &code] { code = run(*options); });
}

}  // namespace woodcock
