// Where a ray meets a surface.
#pragma once

#include <cstdint>

#include "renderer/core/vec.h"

namespace woodcock {

/// Which primitive a ray hit. `t` is computed in double from the primitive's own vertices, so its error does
/// not grow with the primitive.
struct Hit {
  double t = 0;
  DVec2 uv{0};             ///< barycentric (triangles) or parametric (patches) coordinates
  int shape = -1;          ///< index into Geometry's shapes
  uint32_t primitive = 0;  ///< triangle or patch of the shape, 0 for quadrics
  int instance = -1;       ///< index of the instance, -1 at top level
};

/// How well the place of a surface is known where a ray meets it.
struct ErrorBound {
  double distance = 0;   ///< along the normal: how far the rounding of vertices to float may have moved the surface
  double cosine = 1;     ///< |cos| of the angle between ray and normal
  bool at_edge = false;  ///< so near to an edge of the primitive that the neighbour may be met as well, or instead
};

/// A hit among others at the same place.
struct CoincidentHit {
  Hit hit;
  ErrorBound error;
};

/// The local geometry of a surface at a hit, in render space.
struct SurfacePoint {
  Vec3 p;        ///< on the surface to half a unit in the last place of each coordinate
  Vec3 p_error;  ///< bound of that rounding, and of the ray's on its way to an instance
  Vec3 ng;       ///< unit geometric normal, on the side that the scene file calls outside
  Vec3 ns;       ///< unit shading normal, in the hemisphere of ng
  Vec3 dpdu{0}, dpdv{0};
  Vec2 uv;  ///< texture coordinates
};

/// The origin of a ray that leaves `p` on the side of `n` given by `direction`: moved along n by the rounding
/// error of p and then away by one unit in the last place, so that it lies on the wanted side (Pharr, Jakob,
/// Humphreys 2023, section 6.8.5).
inline Vec3 offset_origin(const SurfacePoint& s, Vec3 direction) {
  const float d = glm::dot(glm::abs(s.ng), s.p_error);
  Vec3 offset = s.ng * d;
  if (glm::dot(direction, s.ng) < 0) offset = -offset;
  Vec3 o = s.p + offset;
  for (int i = 0; i < 3; ++i) {
    if (offset[i] > 0) o[i] = std::nextafter(o[i], kInf);
    if (offset[i] < 0) o[i] = std::nextafter(o[i], -kInf);
  }
  return o;
}

}  // namespace woodcock
