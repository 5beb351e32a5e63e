// Shapes of the description, taken to render space.
#pragma once

#include "renderer/geometry/geometry.h"
#include "renderer/scene/description.h"

namespace woodcock {

/// A shape in the space that `target_from_world` leads to. Triangles and patches without area are dropped (they have
/// no normal and no light); `dropped` counts them.
Shape compile_shape(const ShapeDescription& shape, const DMat4& target_from_world, size_t& dropped);

}  // namespace woodcock
