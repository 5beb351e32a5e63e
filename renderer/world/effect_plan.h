// Which physical and optical effects a scene calls for, judged by use and not by declaration.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "renderer/scene/description.h"
#include "renderer/world/effects.h"
#include "renderer/world/world.h"

namespace woodcock {

struct EffectEntry {
  std::string effect;
  bool needed = false;
  std::string reason;    ///< one sentence
  SourceLocation where;  ///< of the first thing that calls for it; line 0 where nothing does
  uint32_t bits = 0;     ///< the Effect it switches on in kernels; 0 where kernels do not tell
};

/// The media that some ray can be in: those that a placed boundary or the camera leads into.
std::set<int> reachable_media(const SceneDescription& scene, const World& world);

/// Whether some shape emits. An area light whose radiance is black is none.
bool has_area_light(const SceneDescription& scene);

/// The effects in a fixed order. A medium counts only where a boundary that is placed in the scene, or the camera,
/// leads into it, a shape of an object only where the object is placed, and only what things really do: an emission
/// of zero or a scattering of zero is none.
std::vector<EffectEntry> plan_effects(const SceneDescription& scene, const World& world);

/// The bits of the effects that are needed.
uint32_t effect_bits(const std::vector<EffectEntry>& plan);

}  // namespace woodcock
