// Media that overlap by mistake: found at load by a few rays.
#pragma once

#include <string>
#include <vector>

#include "renderer/scene/description.h"
#include "renderer/world/world.h"

namespace woodcock {

/// A boundary of media that a ray crosses.
struct BoundaryCrossing {
  int shape = -1, instance = -1;
  bool exit = false;  ///< out of the side that the scene calls inside
  int near = kNone, far = kNone;
};

/// What a ray crosses, in order, up to the first surface that lets nothing through.
struct Crossings {
  std::vector<BoundaryCrossing> list;
  int left_body = -1;  ///< the shape of that surface, where the ray comes from its inner side
};
Crossings crossings_along(const World& world, Ray ray);

/// A sentence where there are points inside two boundaries of which neither names the medium of the other as the one outside: there the
/// boundary that was crossed last decides, and behind the inner part the other medium is lost. Nested media that are done right, media that
/// touch, and what overlaps only within opaque bodies, say nothing. Empty where nothing was found.
std::string note_on_overlap(const SceneDescription& scene, const World& world);

}  // namespace woodcock
