// Which shapes may touch which: found once, so that rays ask for coincident surfaces only where there can be any.
#pragma once

#include <string>
#include <vector>

#include "renderer/world/world.h"

namespace woodcock {

/// Fills SurfaceInfo::contacts and ::stacking of every surface. `medium_names` are those of the scene's media.
///
/// Only company of surfaces that a ray can pass counts: of two opaque ones either may be met. A passable mesh may touch
/// itself.
void find_contacts(const Geometry& geometry, const std::vector<std::string>& medium_names, std::vector<SurfaceInfo>& surfaces);

}  // namespace woodcock
