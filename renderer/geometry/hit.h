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
  DVec3 p;           ///< on the surface to within `error`
  double error = 0;  ///< how far along ng a ray may start from p and still be taken to start on the other side
  Vec3 ng;           ///< unit geometric normal, on the side that the scene file calls outside
  Vec3 ns;           ///< unit shading normal, in the hemisphere of ng
  Vec3 dpdu{0}, dpdv{0};
  Vec2 uv;  ///< texture coordinates
};

/// The origin of a ray that leaves the surface on the side of ng that `direction` points to: moved along ng by twice the error, so that
/// it surely lies on that side (after Pharr, Jakob & Humphreys 2023, section 6.8.5).
inline DVec3 offset_origin(const SurfacePoint& s, DVec3 direction) {
  const DVec3 n(s.ng);
  return s.p + (glm::dot(direction, n) < 0 ? -2 * s.error : 2 * s.error) * n;
}

/// The ray that leaves the surface for `direction`.
inline Ray ray_from(const SurfacePoint& s, DVec3 direction, float time) { return {offset_origin(s, direction), direction, time}; }

}  // namespace woodcock
