// Whether light sampling sees what a ray meets.
#pragma once

#include <cstdint>
#include <string>

#include "renderer/core/vec.h"

namespace woodcock::selftest {

struct VisibilityCount {
  int compared = 0, visible = 0;
  int different = 0;  ///< light samples whose visibility is another than that of the first hit
};

/// Draws points within two root units of `center` (both in world units, `unit` being the root unit), samples a light from each, and
/// asks the shadow ray on one hand, and on the other what a ray in that direction meets first: the point sampled, or anything else. The
/// scene has no media, no partial opacity and no mixes. Throws what reading and compiling the scene throw.
VisibilityCount compare_visibility(const std::string& text, double unit, DVec3 center, uint64_t seed, int points);

}  // namespace woodcock::selftest
