// efficiency [--seconds S] [--step LENGTH] [SCENE...]: what `auto` gains over each estimator of the paper, over plain Woodcock
// tracking, and by each of its own features, as tables in Markdown. Without a scene: cloud, milk, fire and fog.
//
// The plain one is `auto` with one majorant for all of a volume and without what was added to it later. It samples lights just as `auto`
// does, so that the ratio is that of the tracking and no straw man's.
#include <fmt/format.h>

#include <array>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <string>
#include <vector>

#include "bench/contest.h"
#include "renderer/transport/estimator.h"
#include "renderer/transport/features.h"

namespace {

using namespace woodcock;
using namespace woodcock::bench;

constexpr const char* kPlain = "bricks,residual,ray-marched-shadows,equiangular,emission-sampling,sobol";

struct Subject {
  std::string scene;
  std::array<int, 2> resolution{80, 60};
  double step = 0.1;  ///< of the estimators that march, in world units; their time goes as 1/step², for every step starts a march
};

std::vector<Contender> contenders_of(const Subject& subject) {
  FrameSettings common;
  common.resolution = subject.resolution;
  std::vector<Contender> list{{"auto", common}};
  list.push_back({"auto, one global majorant", common});
  list.back().settings.without = kPlain;
  for (const EstimatorInfo& estimator : estimators().subspan(1)) {
    list.push_back({estimator.name, common});
    list.back().settings.estimator = estimator.name;
    if (estimator.step) list.back().settings.step = subject.step;
  }
  for (const FeatureInfo& feature : kFeatures) {
    list.push_back({std::string("auto without ") + feature.name, common});
    list.back().settings.without = feature.name;
  }
  return list;
}

void print_table(const Subject& subject, double seconds) {
  const std::vector<Outcome> outcomes = contest(subject.scene, contenders_of(subject), seconds);
  fmt::print("\n{}, {}x{} pixels, step {}\n\n", std::filesystem::path(subject.scene).stem().string(), subject.resolution[0],
             subject.resolution[1], subject.step);
  fmt::print(
      "| | efficiency of `auto` over it | all rounds together | samples | CPU s a round | bias of the mean | of the pixels "
      "|\n|---|---|---|---|---|---|---|\n");
  for (const Outcome& outcome : outcomes) {
    if (!outcome.refusal.empty()) {
      fmt::print("| {} | cannot: {} | | | | | |\n", outcome.name, outcome.refusal);
      continue;
    }
    const bool reference = &outcome == &outcomes[0];
    fmt::print("| {} | {} | {} | {} | {:.2f} | {} | {} |\n", outcome.name, reference ? "1" : format(efficiency_ratio(outcomes[0], outcome)),
               three_digits(pooled_efficiency_ratio(outcomes[0], outcome)), outcome.samples, median(outcome.seconds),
               reference ? "" : format_mean(outcome.bias), reference ? "" : format_pixels(outcome.bias));
  }
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  double seconds = 1, step = 0.1;
  std::vector<Subject> subjects;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--seconds" && i + 1 < argc) {
      seconds = std::atof(argv[++i]);
    } else if (argument == "--step" && i + 1 < argc) {
      step = std::atof(argv[++i]);
    } else if (!argument.starts_with("-")) {
      subjects.push_back({argument});
    } else {
      fmt::print(stderr, "usage: efficiency [--seconds S] [--step LENGTH] [SCENE...]\n");
      return 2;
    }
  }
  if (!(seconds > 0 && step > 0)) {
    fmt::print(stderr, "efficiency: --seconds and --step take numbers above 0\n");
    return 2;
  }
  for (Subject& subject : subjects) subject.step = step;
  if (subjects.empty()) {
    const std::string folder = WOODCOCK_SOURCE_DIR "/scenes/";
    subjects = {{folder + "cloud.pbrt", {80, 45}, 0.05},
                {folder + "milk.pbrt", {48, 36}, 0.05},
                {folder + "fire.pbrt", {50, 60}, 0.05},
                {folder + "fog.pbrt", {40, 24}, 1.0}};
  }
  try {
    for (const Subject& subject : subjects) print_table(subject, seconds);
  } catch (const std::exception& error) {
    fmt::print(stderr, "efficiency: {}\n", error.what());
    return 1;
  }
  return 0;
}
