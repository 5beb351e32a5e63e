// What a user asks of the estimator, checked and completed: everything that needs no scene.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "renderer/frame/settings.h"
#include "renderer/scene/description.h"
#include "renderer/transport/estimator.h"

namespace woodcock {

/// The most that `--directions` and `--branching` take.
inline constexpr int kMaxDirections = 1024;
/// With in-scattering but no out-scattering each scattering gains energy; beyond this depth the sum means nothing.
inline constexpr int kMaxDepthWithGain = 100;
/// More steps than this across the scene are refused: a ray would take seconds.
inline constexpr double kMaxSteps = 1 << 20;

struct EstimatorSettings {
  const EstimatorInfo* estimator = nullptr;
  TransferTerms terms;
  Features features;
  double step = 0;  ///< world units; 0 where the estimator takes none
  int directions = 1, branching = 1;
};

/// Checks the settings of the estimator against each other. Throws std::invalid_argument that names the option, what was
/// found, what was expected and which estimators take it.
EstimatorSettings resolve_estimator(const FrameSettings& settings);

/// Any of absorption, emission, out-scattering, in-scattering, separated by commas; all where `list` is empty. Throws
/// std::invalid_argument.
TransferTerms parse_terms(std::string_view list);
std::string to_string(const TransferTerms& terms);

/// All features but those in `list`, separated by commas. Throws std::invalid_argument.
Features parse_without(std::string_view list);
/// The features that are off, in the order of the table, separated by commas.
std::string features_off(const Features& features);

/// The settings that change radiance in words, for the header: estimator, whether it is biased and by what, terms, and
/// what the estimator takes.
std::vector<std::pair<std::string, std::string>> estimator_fields(const FrameSettings& settings);

/// Sentences about what a user should know about these settings.
std::vector<std::string> setting_warnings(const SceneDescription& scene);

}  // namespace woodcock
