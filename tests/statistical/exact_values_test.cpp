// Renders every reference case and compares with its exact value.
//
// False alarms: each test asks whether the error exceeds z standard errors, two-sided, Student's t between 256 pixels,
// with z chosen so that a right renderer fails anywhere in the suite once in a thousand seeds (Bonferroni over the
// scenes). Seeds are hashes of the tests' names and never change. Power: the standard error must be below 0.3 % of
// the value, so a bias above 1.6 % is found almost surely, and the same one of 1 % more often than not.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "tests/statistical/reference_cases.h"
#include "tests/statistical/reference_scenes.h"
#include "tests/statistical/rendered_value.h"

namespace woodcock::reference {
namespace {

constexpr double kFalseAlarmRate = 1e-3;
constexpr double kMaxRelativeError = 3e-3;

const std::vector<Scene>& scenes() {
  static const std::vector<Scene> list = [] {
    std::vector<Scene> all;
    for (const Case& c : read_cases(WOODCOCK_SOURCE_DIR "/tests/statistical/cases.json"))
      for (Scene& scene : scenes_of(c)) all.push_back(std::move(scene));
    return all;
  }();
  return list;
}

/// Samples per pixel, as a power of two: what each case needs for its standard error.
int log2_samples(const std::string& name) {
  static const std::map<std::string, int> kByCase = {
      {"P01.R", 12}, {"P01.T", 9},  {"P02.R", 11}, {"P02.T", 8},  {"P03.R", 9},  {"P03.T", 9},  {"P04.R", 9}, {"P04.T", 11}, {"P05.R", 11},
      {"P05.T", 10}, {"P06.g", 12}, {"P06.h", 4},  {"P07.g", 14}, {"P08.g", 11}, {"P09.g", 8},  {"P09.h", 4}, {"P10.g", 8},  {"P10.h", 4},
      {"P11.g", 7},  {"P11.h", 7},  {"P12.g", 9},  {"P12.h", 9},  {"P13.R", 10}, {"P14.g", 10}, {"P14.h", 9}, {"P15.s", 9}};
  return kByCase.at(name.substr(0, 5));
}

class ExactValue : public testing::TestWithParam<size_t> {};

TEST_P(ExactValue, IsMetWithinNoise) {
  const Scene& scene = scenes()[GetParam()];
  const RenderedValue rendered = render_value(scene.text, seed_of(scene.name), log2_samples(scene.name));
  const double z = two_sided_t(kFalseAlarmRate / static_cast<double>(scenes().size()), rendered.degrees_of_freedom);
  const double error = rendered.mean - scene.expected;
  RecordProperty("mean", fmt::format("{:.8g}", rendered.mean));
  RecordProperty("standard_error", fmt::format("{:.3g}", rendered.standard_error));
  const std::string report =
      fmt::format("{}: rendered {:.8g} ± {:.2g} (relative {:.2g}), exact {:.8g}, off by {:+.2f} standard errors; allowed {:.2f}",
                  scene.name, rendered.mean, rendered.standard_error, rendered.standard_error / scene.expected, scene.expected,
                  rendered.standard_error > 0 ? error / rendered.standard_error : 0.0, z);
  std::printf("%s\n", report.c_str());
  EXPECT_EQ(rendered.counters.nonfinite, 0u) << report;
  EXPECT_EQ(rendered.counters.majorant_violations, 0u) << report;
  EXPECT_EQ(rendered.counters.truncated, 0u) << report;
  if (scene.expected < 1e-6) {  // P02: nothing comes through 300 mean free paths
    EXPECT_LT(rendered.mean, 1e-6) << report;
    return;
  }
  EXPECT_LE(rendered.standard_error, kMaxRelativeError * scene.expected) << report;
  EXPECT_LE(std::abs(error), z * rendered.standard_error + 1e-5 * scene.expected + scene.uncertainty + scene.discretisation)
      << report << "\nThe scene:\n"
      << scene.text.substr(0, 3000);
}

INSTANTIATE_TEST_SUITE_P(Reference, ExactValue, testing::Range(size_t{0}, scenes().size()),
                         [](const testing::TestParamInfo<size_t>& parameter) {
                           std::string name = scenes()[parameter.param].name;
                           std::replace(name.begin(), name.end(), '.', '_');
                           return name;
                         });

}  // namespace
}  // namespace woodcock::reference
