// Which medium lies where, as the boundaries say that rays meet.
#pragma once

#include "renderer/world/world.h"

namespace woodcock {

/// The near side of the first boundary that the ray meets, looking through everything else; nothing where there is none.
/// `from_outside`: the ray starts outside of all shapes.
std::optional<int> first_near_side(const Geometry& geometry, const std::vector<SurfaceInfo>& surfaces, Ray ray, bool from_outside = false);

/// The medium at a point (kNone is vacuum): that of the near side of the first boundary met, by the majority of
/// those of several directions that meet one; nothing where none does.
std::optional<int> find_medium(const Geometry& geometry, const std::vector<SurfaceInfo>& surfaces, DVec3 point);

/// The medium around the scene: what rays from far away meet first. Nothing where they do not agree, as with a sheet that has
/// another medium on either side.
std::optional<int> find_medium_around(const Geometry& geometry, const std::vector<SurfaceInfo>& surfaces);

}  // namespace woodcock
