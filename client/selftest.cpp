// `woodcock selftest`: this build, on this machine, against random scenes whose radiance is known.
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/interrupt.h"
#include "client/print.h"
#include "client/progress_line.h"
#include "renderer/frame/frame_renderer.h"
#include "renderer/selftest/campaign.h"

namespace woodcock {
namespace {

struct SelftestOptions {
  double seconds = 60;
  uint64_t seed = 1, first = 0;
  std::optional<uint64_t> count, only;
  std::optional<selftest::Relation> relation;
  std::string folder = ".";
  bool furnaces = false, relations = false, coverage = false, json = false;
};

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

selftest::Draw drawn(const SelftestOptions& options) {
  if (options.furnaces == options.relations) return selftest::Draw::kBoth;
  return options.furnaces ? selftest::Draw::kFurnaces : selftest::Draw::kRelations;
}

/// Writes a scene; returns the path. Throws std::runtime_error.
std::string write_scene(const std::string& folder, const std::string& name, const std::string& text) {
  const std::filesystem::path path = std::filesystem::path(folder) / name;
  std::ofstream out(path);
  out << text;
  out.close();
  if (!out) throw std::runtime_error("cannot write " + path.string() + "; choose a folder with -o");
  return path.string();
}

nlohmann::json failure_json(const selftest::Verdict& verdict, const std::string& scene) {
  nlohmann::json j{{"case", verdict.index}, {"relation", selftest::name_of(verdict.examined.relation)}, {"scene", scene}};
  const selftest::Finding& finding = verdict.second;
  if (!finding.fault.empty()) j["fault"] = finding.fault;
  if (!finding.comparisons.empty()) {
    const selftest::Comparison& c = worst(finding.comparisons);
    j["deviation"] = {{"where", c.what}, {"mean", c.mean}, {"error", c.error}, {"z", c.z}};
  }
  return j;
}

nlohmann::json summary_json(const SelftestOptions& options, const selftest::Tally& tally, double seconds) {
  return {{"seed", options.seed},
          {"seconds", seconds},
          {"render_build", render_build()},
          {"arithmetic_class", arithmetic_class()},
          {"scenes", tally.cases},
          {"comparisons", tally.comparisons},
          {"samples", tally.samples},
          {"suspects", tally.suspects},
          {"failed", tally.failures},
          {"largest_z", tally.largest_z},
          {"features", tally.coverage.features().size()},
          {"pairs_of_features", tally.coverage.pairs_covered()}};
}

nlohmann::json coverage_json(const selftest::Coverage& coverage) {
  nlohmann::json pairs = nlohmann::json::array();
  for (const auto& [names, count] : coverage.pairs()) pairs.push_back({names.first, names.second, count});
  return {{"features", coverage.features()}, {"pairs", pairs}};
}

int run(const SelftestOptions& options) {
  const auto start = Clock::now();
  const std::atomic<bool>& interrupted = interrupt_flag();
  selftest::Tally tally;
  nlohmann::json failures = nlohmann::json::array();
  const uint64_t first = options.only.value_or(options.first);
  const uint64_t count = options.only ? 1 : options.count.value_or(UINT64_MAX - first);
  const bool timed = !options.only && !options.count;
  ProgressLine progress("selftest", options.json);
  for (uint64_t i = 0; i < count && !interrupted; ++i) {
    const double elapsed = seconds_since(start);
    if (timed && elapsed >= options.seconds) break;
    const selftest::Verdict verdict = options.relation ? selftest::judge(options.seed, first + i, *options.relation, {})
                                                       : selftest::judge(options.seed, first + i, drawn(options), {});
    tally.add(verdict);
    if (verdict.failed) {
      const auto began = Clock::now();
      const selftest::Case shrunk =
          selftest::shrink(verdict.examined, options.seed, {256, 1e7}, [&] { return !interrupted && seconds_since(began) < 60; });
      const std::string name = fmt::format("selftest-{}-{}", options.seed, verdict.index);
      const std::string scene = write_scene(options.folder, name + ".pbrt", scene_text(shrunk.scene));
      const std::string other = selftest::changed_text(shrunk);
      if (!other.empty()) write_scene(options.folder, name + "-changed.pbrt", other);
      progress.finish();
      note("FAILED {}  written to {}\n", Lines{selftest::report(verdict, shrunk, options.seed)}, scene);
      failures.push_back(failure_json(verdict, scene));
    }
    progress.show(timed ? elapsed / options.seconds : static_cast<double>(i + 1) / static_cast<double>(count),
                  fmt::format("{} scenes, largest z {:.1f}, {} failed", tally.cases, tally.largest_z, tally.failures));
  }
  progress.finish();
  if (options.json) {
    nlohmann::json j = summary_json(options, tally, seconds_since(start));
    j["failures"] = failures;
    if (options.coverage) j["coverage"] = coverage_json(tally.coverage);
    say_json(j);
  } else {
    if (options.coverage) say("{}\n", Lines{tally.coverage.table()});
    say("scenes       {} in {}, seed {}\n", tally.cases, format_seconds(seconds_since(start)), options.seed);
    say("comparisons  {} of {}samples; largest z {:.2f}; {} looked at twice\n", tally.comparisons,
        format_count(static_cast<double>(tally.samples)), tally.largest_z, tally.suspects);
    say("covered      {} features, {} pairs of them\n", tally.coverage.features().size(), tally.coverage.pairs_covered());
    say("render build {}, arithmetic class {}\n", render_build(), arithmetic_class());
    say("{}\n", tally.failures == 0 ? "All came out right." : fmt::format("{} CAME OUT WRONG.", tally.failures));
  }
  return tally.failures == 0 && !interrupted ? 0 : 1;
}

}  // namespace

void add_selftest_command(CLI::App& app, int& code) {
  auto* command = app.add_subcommand("selftest", "Render random scenes of known radiance with this build on this machine, and check them");
  auto options = std::make_shared<SelftestOptions>();
  command->add_option("--seconds", options->seconds, "How long to go on")->check(CLI::PositiveNumber)->capture_default_str();
  command->add_option("--seed", options->seed, "Which random scenes; any number gives others")->capture_default_str();
  command->add_option("--count", options->count, "How many scenes, in place of a time")->check(CLI::PositiveNumber);
  command->add_option("--first", options->first, "The number of the first scene")->capture_default_str();
  command->add_option("--case", options->only, "One scene by its number, as a failure names it");
  std::map<std::string, selftest::Relation> relations;
  for (int i = 0; i < selftest::kRelationCount; ++i) {
    const auto relation = static_cast<selftest::Relation>(i);
    relations.emplace(selftest::name_of(relation), relation);
  }
  auto* one_relation = command->add_option("--relation", options->relation, "Only scenes of one kind, as a failure names it")
                           ->transform(CLI::CheckedTransformer(relations));
  command->add_flag("--furnaces", options->furnaces, "Only scenes in equilibrium, whose radiance is known");
  command->add_flag("--relations", options->relations, "Only scenes that are compared with themselves, changed or rendered otherwise")
      ->excludes(one_relation);
  command->add_flag("--coverage", options->coverage, "Print how often each feature, and each pair of them, was covered");
  command->add_option("-o", options->folder, "Folder for the scenes of failures")->check(CLI::ExistingDirectory)->capture_default_str();
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer(
      "Examples:\n"
      "  woodcock selftest --seconds 60\n"
      "  woodcock selftest --seed 7 --case 1234 --relation \"shrunk light\"     repeats what failed\n"
      "Exit codes: 0 all came out right, 1 a scene did not, or the test was interrupted. docs/selftest.md says what is compared.");
  command->callback([options, &code] { code = run(*options); });
}

}  // namespace woodcock
