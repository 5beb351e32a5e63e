// Every reference case by every estimator that can express it: rows of one table, a file a case in the folder estimator-table of
// the build folder, which deploy/test.sh --long puts together.
//
// False alarms: an entry fails beyond z standard errors, two-sided, Student's t between 256 pixels, with z chosen so that right
// estimators fail anywhere in the table once in a thousand seeds (Bonferroni over the entries). Seeds are hashes of the
// entries' names and never change. Power: each standard error is at most 0.1 % of the value. What marches is biased where
// extinction varies (P07, P08) and must come closer with each smaller step; elsewhere it is unbiased whatever the step.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
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
constexpr double kMaxRelativeError = 1e-3;
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
double step_of(const Case& c, const EstimatorInfo& e) { return c.get("g", 0) >= 0.9 && e.name != std::string("line") ? 0.2 : 0.8; }

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
        if (!varies(c)) list.push_back({scene, &e, step_of(c, e) * mean_free_path(c), "", false});
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

constexpr int kPilotBatches = 8;

/// Batches for the standard error aimed at, from the spread of a pilot; not fewer than it had, since the error of
/// low-discrepancy points grows faster than 1/√n towards few samples.
int batches_for(const Entry& entry) {
  const RenderedValue pilot = render_value(entry.scene.text, settings_of(entry, "pilot"), kLog2Batch, kPilotBatches);
  const double relative = pilot.standard_error / entry.scene.expected / kAimedAt;
  return std::max(kPilotBatches, static_cast<int>(std::ceil(kPilotBatches * relative * relative)));
}

/// The two-sided level of one entry.
double level() {
  const std::vector<Entry> list = entries();
  return kFalseAlarmRate / static_cast<double>(std::count_if(list.begin(), list.end(), [](const Entry& e) { return e.why_not.empty(); }));
}

/// "P01.R", from "P01.R.homogeneous".
std::string case_of(const Entry& entry) { return entry.scene.name.substr(0, entry.scene.name.find_last_of('.')); }

std::vector<std::string> case_names() {
  std::vector<std::string> names;
  for (const Entry& entry : entries())
    if (names.empty() || names.back() != case_of(entry)) names.push_back(case_of(entry));
  return names;
}

std::ofstream part(const std::string& name) {
  std::filesystem::create_directories(WOODCOCK_TABLE);
  return std::ofstream(std::filesystem::path(WOODCOCK_TABLE) / (name + ".md"));
}

struct Row {
  std::string line;
  double error = 0;  ///< absolute
  bool ok = false;
};

/// Renders one entry; `bias_before` is what the same estimator was off by with the step before, if there was one.
Row render(const Entry& entry, std::optional<double> bias_before) {
  const double exact = entry.scene.expected;
  const std::clock_t begin = std::clock();
  const bool nothing = exact < 1e-6;  // P02: nothing comes through 300 mean free paths
  const int batches = nothing ? 4 : batches_for(entry);
  const RenderedValue value = render_value(entry.scene.text, settings_of(entry, "value"), kLog2Batch, batches);
  const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  const double error = value.mean - exact;
  const double allowed = two_sided_t(level(), value.degrees_of_freedom) * value.standard_error + 1e-5 * exact + entry.scene.uncertainty +
                         entry.scene.discretisation;
  bool ok = value.counters.nonfinite == 0 && value.counters.truncated == 0 && value.counters.majorant_violations == 0;
  std::string verdict = "right";
  if (nothing) {
    ok = ok && value.mean < 1e-6;
    verdict = "nothing comes through";
  } else {
    ok = ok && value.standard_error <= kMaxRelativeError * exact;
    if (entry.biased) {
      ok = ok && error > -allowed && (!bias_before || std::abs(error) <= 0.5 * *bias_before + allowed);
      verdict = bias_before ? "biased, closer" : "biased";
    } else {
      ok = ok && std::abs(error) <= allowed;
    }
  }
  return {fmt::format("| {} | {:.7g} | {} | {} | {:.7g} | {:+.3f} % | {:.3f} % | {} | {} | {:.1f} | {} |", case_of(entry), exact,
                      entry.estimator->name, entry.step ? fmt::format("{:.4g}", *entry.step) : "", value.mean,
                      nothing ? 0 : 100 * error / exact, nothing ? 0 : 100 * value.standard_error / exact,
                      value.standard_error > 0 ? fmt::format("{:+.2f}", error / value.standard_error) : "exact",
                      (int64_t{batches} << kLog2Batch) * kPixels, seconds, ok ? verdict : "**wrong**"),
          std::abs(error), ok};
}

TEST(EstimatorTableHead, SaysWhatIsInIt) {
  std::ofstream head = part("P00");  // before P01, whatever the locale
  head << "# Every reference case by every estimator\n\n"
       << fmt::format(
              "Relative standard errors are at most {} %. An unbiased entry passes when it is off by at most {:.2f} of them; the chance\n"
              "that right estimators fail anywhere is {}. `march`, `march-phase` and `line` are biased where extinction varies (P07,\n"
              "P08): there their bias must fall with the step. Elsewhere they are unbiased whatever the step, which is 0.8 mean free\n"
              "paths, of march-phase 0.2 at g = 0.9. Steps are in world units. `line` takes {} distances on the first ray.\n\n",
              100 * kMaxRelativeError, two_sided_t(level(), kPixels - 1), kFalseAlarmRate, kDistances)
       << "| case | exact | estimator | step | value | off by | standard error | in standard errors | samples | CPU s | |\n"
       << "|---|---|---|---|---|---|---|---|---|---|---|\n";
  EXPECT_TRUE(head.flush().good());
}

class EstimatorTable : public testing::TestWithParam<std::string> {};

TEST_P(EstimatorTable, EveryEstimatorThatCanExpressItMeetsTheValue) {
  std::ofstream table = part(GetParam());
  std::map<std::string, double> error_before;  // by estimator
  for (const Entry& entry : entries()) {
    if (case_of(entry) != GetParam()) continue;
    const std::string name = entry.estimator->name;
    Row row{fmt::format("| {} | {:.7g} | {} | | | | | | | | cannot: {} |", case_of(entry), entry.scene.expected, name, entry.why_not), 0,
            true};
    if (entry.why_not.empty()) {
      const auto before = error_before.find(name);
      row = render(entry, before == error_before.end() ? std::nullopt : std::optional(before->second));
      error_before[name] = row.error;
    }
    table << row.line << std::endl;
    std::printf("%s\n", row.line.c_str());
    EXPECT_TRUE(row.ok) << row.line;
  }
  EXPECT_TRUE(table.good());
}

INSTANTIATE_TEST_SUITE_P(Reference, EstimatorTable, testing::ValuesIn(case_names()),
                         [](const testing::TestParamInfo<std::string>& parameter) {
                           std::string name = parameter.param;
                           std::replace(name.begin(), name.end(), '.', '_');
                           return name;
                         });

}  // namespace
}  // namespace woodcock::reference
