// The estimators: every way in which the radiance along a camera ray can be computed.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "renderer/scene/description.h"
#include "renderer/transport/path.h"

namespace woodcock {

/// One estimator. All texts are single lines.
struct EstimatorInfo {
  const char* name;
  const char* summary;
  const char* formula;
  const char* source;
  const char* bias;             ///< by what its expectation differs from the radiance; empty where it does not
  const char* directions;       ///< what `--directions` means to it; empty where it takes none
  bool step = false;            ///< takes, and needs, `--step`
  bool branching = false;       ///< takes `--branching`
  bool tunable = false;         ///< takes `--without`, `--plan` and `--kernel`
  bool samples_lights = false;  ///< so that lights without extent can be seen
  bool media_scatter = false;   ///< follows scattering in media
  RadianceFunction radiance = nullptr;

  bool biased() const { return bias[0] != '\0'; }
  bool takes_directions() const { return directions[0] != '\0'; }
};

/// All estimators; `auto` comes first.
std::span<const EstimatorInfo> estimators();
/// The estimator of this name, or nothing.
const EstimatorInfo* find_estimator(std::string_view name);
/// The names of the estimators that `accepts`, separated by commas.
std::string estimator_names(bool (*accepts)(const EstimatorInfo&) = [](const EstimatorInfo&) { return true; });

/// Throws SceneError at the first light of the scene that the estimator would miss without a word: one that has no extent,
/// so that no ray meets it, where lights are not sampled: by nature, or since `--without` says so.
void refuse_lights(const EstimatorInfo& estimator, const Features& features, const SceneDescription& scene);
/// Throws SceneError at the first medium that scatters and lies in the scene, where the estimator does not follow that.
void refuse_media(const EstimatorInfo& estimator, const SceneDescription& scene, const World& world);

}  // namespace woodcock
