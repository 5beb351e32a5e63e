// Which shapes may touch which: found once, so that rays ask for coincident surfaces only where there can be any.
#pragma once

#include <string>
#include <vector>

#include "renderer/world/world.h"

namespace woodcock {

/// Fills SurfaceInfo::overlaps and ::stacking of every surface. `medium_names` are those of the scene's media.
///
/// Only what coincides with a surface that a ray can pass counts: of two opaque ones either may be met. Such a mesh may touch
/// itself.
void find_overlaps(const Geometry& geometry, const std::vector<std::string>& medium_names, std::vector<SurfaceInfo>& surfaces);

}  // namespace woodcock
