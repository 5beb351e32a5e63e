// What a sweep renders: its curves, their references, and the settings of each.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "renderer/frame/settings.h"

namespace woodcock {

/// What the user asks for.
struct SweepOptions {
  std::string scene, folder;
  FrameSettings settings;  ///< what all curves share
  std::vector<int64_t> counts;
  std::vector<std::string> estimators{"auto"};
  std::vector<double> steps;
  std::vector<int> depths;
  std::vector<std::string> sets;  ///< "path=value,value": every value of each with every value of the others
  int seeds = 8;
  std::string reference;          ///< an EXR; empty: one is made
  int64_t reference_samples = 0;  ///< of the one that is made; 0: kReferenceFactor times the largest count
  bool effects = false;
  bool by_workers = false;  ///< of a coordinator
  bool allow_outside_files = false;
};

inline constexpr int64_t kReferenceFactor = 4;
/// Every curve keeps its compiled scene for as long as the sweep runs.
inline constexpr size_t kMaxCurves = 32;
inline constexpr int kMaxSeeds = 1000;
/// Samples of the pictures by which the cost of effects is measured, at most.
inline constexpr int64_t kEffectSamples = 64;

/// One estimator with one set of settings; its seed is set by each run.
struct SweepCurve {
  std::string id;    ///< unique, fit for a file name
  std::string name;  ///< for people
  std::string bias;  ///< by what it differs from its reference; empty where it does not
  FrameSettings settings;
  size_t group = 0;  ///< index of its reference
};

/// What is rendered in one go: more samples of one run.
struct SweepRun {
  std::string id;          ///< of the run's record
  std::string curve;       ///< id of the curve, whose compiled scene serves all its seeds
  FrameSettings settings;  ///< with the seed
  int64_t samples = 0;     ///< that the run then has
  bool keep = false;       ///< pictures of smaller counts stay
};

/// The pictures that share a reference: those of one physical setting of the scene.
struct SweepGroup {
  std::string setting;      ///< for people; empty for the scene as it is
  FrameSettings reference;  ///< of a reference that is made
};

/// A variation of `auto` with something left out.
struct SweepEffect {
  std::string id;
  std::string left_out;  ///< empty: nothing
  bool changes_picture = false;
  FrameSettings settings;
};

struct SweepPlan {
  std::vector<int64_t> counts;
  uint64_t first_seed = 0;  ///< that of seed number s is first_seed + s
  size_t seeds = 0;
  int64_t reference_samples = 0;
  int64_t effect_samples = 0;
  std::vector<SweepCurve> curves;
  std::vector<SweepGroup> groups;
  std::vector<SweepEffect> effects;
};

/// Every estimator with every value of every setting that it takes. `scene_depth` and `scene_seed` are the scene's own, where the
/// options give none. Throws std::invalid_argument that names the option.
SweepPlan plan_sweep(const SweepOptions& options, int scene_depth, uint64_t scene_seed);

/// Everything that must be equal for a second run to go on with the results of a first, as names and values.
nlohmann::json describe_plan(const SweepPlan& plan);

}  // namespace woodcock
