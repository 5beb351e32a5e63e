// A scene of parts as pbrt-v4 text.
#pragma once

#include <string>

#include "renderer/selftest/scene_parts.h"

namespace woodcock::selftest {

/// Pixels along each edge of the pictures.
inline constexpr int kEdge = 8;

/// How parts are written where the scene file can say the same in several ways.
struct Writing {
  bool backwards = false;            ///< bodies and lights in reverse order
  bool split_lights = false;         ///< every light as two of half of it, a sheet as two triangles that emit
  bool homogeneous_as_grid = false;  ///< homogeneous media as constant grids
  bool homogeneous_as_sum = false;   ///< homogeneous media as sums of two halves
};

/// The scene file. Numbers are written so that they are read back to the bit.
std::string scene_text(const Scene& scene, const Writing& writing = {});

}  // namespace woodcock::selftest
