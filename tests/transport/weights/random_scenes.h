// Random scenes of what the checker of weights has formulas for, as scene texts.
#pragma once

#include <cstdint>
#include <string>

#include "renderer/transport/features.h"

namespace woodcock::testing {

/// A camera in fog or in vacuum; bodies of homogeneous and gridded media behind boundaries and in glass, emitting or not;
/// floors, walls and balls of every material; one to four lights of every kind, some of them inside bodies. All apart from
/// each other. The same seed gives the same text.
std::string random_scene(uint64_t seed);

/// All features, or one of them or several taken out; the rest of the settings likewise.
struct RandomSettings {
  Features features;
  bool plan = true;
  /// Equiangular and emission sampling run wherever they can, whether the plan finds them worth while or not.
  bool force_effects = false;
  std::string name;
};
RandomSettings random_settings(uint64_t seed);

}  // namespace woodcock::testing
