// Transforms that flatten space: a scale of zero along one axis or more.
#pragma once

#include "renderer/scene/description.h"

namespace woodcock {

/// What is left of space: 3 where `m` can be inverted, 2 a plane, 1 a line, 0 a point.
int dimensions_of(const DMat4& m);

/// A shape under a transform that flattens space, as the same shape under one that can be inverted: `shape.world_from_object` is replaced,
/// meshes and disks stay what they are. Returns false where nothing of it has an area. Throws SceneError for a sphere or cylinder that is
/// pressed into a plane. `dropped` counts the triangles and patches that lost their area.
bool restore_flat_shape(ShapeDescription& shape, const std::string& directive, size_t& dropped);

}  // namespace woodcock
