// Orthonormal frames.
#pragma once

#include "renderer/core/vec.h"

namespace woodcock {

/// A right-handed orthonormal frame; local z is `n`.
struct Frame {
  Vec3 s, t, n;

  /// Builds a frame around the unit vector `n` (Duff et al. 2017, "Building an Orthonormal Basis,
  /// Revisited", listing 3): defined for every direction, signed zeros included.
  static Frame from_normal(Vec3 n) {
    const float sign = std::copysign(1.0f, n.z);
    const float a = -1.0f / (sign + n.z);
    const float b = n.x * n.y * a;
    return {{1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n};
  }

  /// World to local.
  Vec3 to_local(Vec3 v) const { return {glm::dot(v, s), glm::dot(v, t), glm::dot(v, n)}; }
  /// Local to world.
  Vec3 to_world(Vec3 v) const { return s * v.x + t * v.y + n * v.z; }
};

}  // namespace woodcock
