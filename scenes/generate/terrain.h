// The height field of the island: its mesh and its colours are made from the same function.
#pragma once

#include "renderer/core/vec.h"

namespace woodcock::generate {

inline constexpr double kIslandExtent = 8.0;  ///< units per side

/// Height over the sea. Ridged mountains under a dome that sinks below the sea before the border.
double island_height(double x, double y);

/// The upward unit normal by central differences over `step`.
DVec3 island_normal(double x, double y, double step);

}  // namespace woodcock::generate
