// Every reference case by every estimator that can express it, in one table (estimator-table.md in the build folder).
//
// False alarms: an entry fails beyond z standard errors, two-sided, Student's t between 256 pixels, with z chosen so that right
// estimators fail anywhere in the table once in a thousand seeds (Bonferroni over the entries). Seeds are hashes of the
// entries' names and never change. Power: each standard error is at most 0.1 % of the value. What marches is biased where
// extinction varies (P07, P08) and must come closer with each smaller step; elsewhere it is unbiased whatever the step.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <ctime>
#include <fstream>
#include <map>
#include <optional>

#include "renderer/transport/estimator.h"
#include "tests/statistical/reference_cases.h"
#include "tests/statistical/reference_scenes.h"
#include "tests/statistical/rendered_value.h"

namespace woodcock::reference {
namespace {

constexpr double kFalseAlarmRate = 1e-3;
constexpr double kLargestRelativeError = 1e-3;
/// What the sample count aims at, so that the pilot's own error does not make it miss the bound.
constexpr double kAimedAt = 0.85e-3;
/// Samples a batch and pixel, as a power of two; the pilot has one batch.
constexpr int kLog2Batch = 5;
constexpr int kPixels = 256;
/// Distances on the first ray of `line`.
constexpr int kDistances = 8;

struct Entry {
  Scene scene;
  const EstimatorInfo* estimator;
  std::optional<double> step;  ///< world units
  std::string why_not;         ///< why the estimator cannot express the case; empty where it can
  bool biased;                 ///< its bias is to be seen here
};

double mean_free_path(const Case& c) {
  if (c.parameters.contains("tau")) return c.get("d", c.get("tau")) / c.get("tau");
  return 1 / c.get("sigma_t", c.get("sigma_a", 1));
}

/// In mean free paths. At each scattering a march multiplies the variance by (x/2) coth(x/2), x its step (docs/physics.md): where
/// paths scatter some fifty times the step must be small.
double step_of(const Case& c) { return c.get("g", 0) >= 0.9 ? 0.2 : 0.8; }

bool varies(const Case& c) { return c.id == "P07" || c.id == "P08"; }

/// Why an estimator cannot express a case; empty where it can.
std::string why_not(const Case& c, const EstimatorInfo& e) {
  const bool scatters = c.get("albedo", 0) > 0 || c.get("sigma_s", 0) > 0;
  if (c.id == "P14" && !e.samples_lights) return "no ray meets a point light, and it samples none";
  if (scatters && !e.media_scatter) return "scattering at surfaces only";
  const double g = c.get("g", 0);
  const std::string name = e.name;
  if (scatters && g != 0 && (name == "march" || name == "woodcock"))
    return fmt::format("uniform directions at g = {}: each scattering multiplies the variance by {:.1f}", g,
                       (1 + g * g) / ((1 - g * g) * (1 - g * g)));
  return "";
}

/// Homogeneous where the case can be stated so.
std::vector<Entry> entries() {
  std::vector<Entry> list;
  for (const Case& c : read_cases(WOODCOCK_SOURCE_DIR "/tests/statistical/cases.json")) {
    for (const Scene& scene : scenes_of(c)) {
      if (scene.name.ends_with(".grid") && !varies(c)) continue;
      for (const EstimatorInfo& e : estimators()) {
        const std::string reason = why_not(c, e);
        if (!reason.empty() || !e.step) {
          list.push_back({scene, &e, std::nullopt, reason, false});
          continue;
        }
        if (!varies(c)) list.push_back({scene, &e, step_of(c) * mean_free_path(c), "", false});
        for (const double step : {1.6, 0.8, 0.4, 0.2})
          if (varies(c)) list.push_back({scene, &e, step, "", true});
      }
    }
  }
  return list;
}

FrameSettings settings_of(const Entry& entry, const std::string& purpose) {
  FrameSettings settings;
  settings.estimator = entry.estimator->name;
  settings.step = entry.step;
  if (settings.estimator == "line") settings.directions = kDistances;
  settings.seed = seed_of(fmt::format("{}.{}.{}.{}", entry.scene.name, entry.estimator->name, entry.step.value_or(0), purpose));
  return settings;
}

/// Batches for the standard error aimed at, from the spread of a pilot.
int batches_for(const Entry& entry) {
  const RenderedValue pilot = render_value(entry.scene.text, settings_of(entry, "pilot"), kLog2Batch, 8);
  const double relative = pilot.standard_error / entry.scene.expected / kAimedAt;
  return std::max(1, static_cast<int>(std::ceil(8 * relative * relative)));
}

TEST(EstimatorTable, EveryCaseByEveryEstimatorThatCanExpressIt) {
  const std::vector<Entry> list = entries();
  const auto done = static_cast<double>(std::count_if(list.begin(), list.end(), [](const Entry& e) { return e.why_not.empty(); }));
  const double per_entry = kFalseAlarmRate / done;
  std::ofstream table(WOODCOCK_TABLE);
  const auto write = [&](const std::string& line) {
    table << line << std::endl;
    std::printf("%s\n", line.c_str());
    std::fflush(stdout);
  };
  write("# Every reference case by every estimator\n");
  write(fmt::format(
      "Relative standard errors are at most {} %. An unbiased entry passes when it is off by at most {:.2f} of them; the chance\n"
      "that right estimators fail anywhere is {}. `march`, `march-phase` and `line` are biased where extinction varies (P07,\n"
      "P08): there their bias must fall with the step. Elsewhere they are unbiased whatever the step, which is 0.8 mean free\n"
      "paths, and 0.2 at g = 0.9. Steps are in world units. `line` takes {} distances on the first ray.\n",
      100 * kLargestRelativeError, two_sided_t(per_entry, kPixels - 1), kFalseAlarmRate, kDistances));
  write("| case | exact | estimator | step | value | off by | standard error | in standard errors | samples | CPU s | |");
  write("|---|---|---|---|---|---|---|---|---|---|---|");
  std::map<std::string, double> bias_before;
  for (const Entry& entry : list) {
    const std::string exact = fmt::format("{:.7g}", entry.scene.expected), name = entry.estimator->name;
    const std::string case_name = entry.scene.name.substr(0, entry.scene.name.find_last_of('.'));
    if (!entry.why_not.empty()) {
      write(fmt::format("| {} | {} | {} | | | | | | | | cannot: {} |", case_name, exact, name, entry.why_not));
      continue;
    }
    const std::clock_t begin = std::clock();
    const bool nothing = entry.scene.expected < 1e-6;  // P02: nothing comes through 300 mean free paths
    const int batches = nothing ? 4 : batches_for(entry);
    const RenderedValue value = render_value(entry.scene.text, settings_of(entry, "value"), kLog2Batch, batches);
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    const double error = value.mean - entry.scene.expected, relative = error / entry.scene.expected,
                 relative_error = value.standard_error / entry.scene.expected;
    const double allowed = two_sided_t(per_entry, value.degrees_of_freedom) * value.standard_error + 1e-5 * entry.scene.expected +
                           entry.scene.uncertainty + entry.scene.discretisation;
    bool ok = false;
    std::string verdict;
    if (nothing) {
      ok = value.mean < 1e-6;
      verdict = "nothing comes through";
    } else if (entry.biased) {
      const std::string key = entry.scene.name + name;
      const bool first = !bias_before.contains(key);
      ok = error > -allowed && (first || std::abs(error) <= 0.5 * bias_before[key] + allowed);
      verdict = first ? "biased" : "biased, closer";
      bias_before[key] = std::abs(error);
    } else {
      ok = std::abs(error) <= allowed;
      verdict = "right";
    }
    ok = ok && (nothing || relative_error <= kLargestRelativeError) && value.counters.nonfinite == 0 && value.counters.truncated == 0 &&
         value.counters.majorant_violations == 0;
    const std::string line = fmt::format("| {} | {} | {} | {} | {:.7g} | {:+.3f} % | {:.3f} % | {} | {} | {:.1f} | {} |", case_name, exact,
                                         name, entry.step ? fmt::format("{:.4g}", *entry.step) : "", value.mean,
                                         nothing ? 0 : 100 * relative, nothing ? 0 : 100 * relative_error,
                                         value.standard_error > 0 ? fmt::format("{:+.2f}", error / value.standard_error) : "exact",
                                         (int64_t{batches} << kLog2Batch) * kPixels, seconds, ok ? verdict : "**wrong**");
    write(line);
    EXPECT_TRUE(ok) << line;
  }
}

}  // namespace
}  // namespace woodcock::reference
