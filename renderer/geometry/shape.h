// Shapes in render space, as the intersector and the area lights see them.
//
// Render space is world space moved by a translation and scaled by a power of two (see renderer/world); its
// lengths are `scale` times world lengths.
#pragma once

#include <array>
#include <cstdint>
#include <variant>
#include <vector>

#include "renderer/core/vec.h"

namespace woodcock {

/// Triangles in render space. Positions are in double, so that a thin slab far from the origin keeps its thickness. The geometric normal is
/// cross(p1 − p0, p2 − p0), flipped where `Shape::flip`, then turned to agree with the vertex normals where there are any.
struct Mesh {
  std::vector<DVec3> positions;
  std::vector<Vec3> normals;  ///< empty or one per vertex, unit length
  std::vector<Vec2> uv;       ///< empty or one per vertex
  std::vector<std::array<uint32_t, 3>> triangles;
};

/// Bilinear patches; vertices in the order (u,v) = 00, 10, 01, 11. Normal dpdu × dpdv, then as for Mesh.
struct PatchMesh {
  std::vector<DVec3> positions;
  std::vector<Vec3> normals;
  std::vector<Vec2> uv;
  std::vector<std::array<uint32_t, 4>> patches;
};

/// A quadric in its own object space, placed by an affine map. Its normal is that of dpdu × dpdv in object
/// space (outwards for the sphere), taken to render space by the inverse transpose, flipped where `Shape::flip`.
struct Quadric {
  enum class Kind { kSphere, kDisk, kCylinder };
  Kind kind = Kind::kSphere;
  double radius = 1, z_min = -1, z_max = 1;     ///< disk: z_min is its height
  double inner_radius = 0;                      ///< disk
  double phi_max = 2 * 3.14159265358979323846;  ///< radians
  DMat4 render_from_object{1}, object_from_render{1};
};

struct Shape {
  std::variant<Mesh, PatchMesh, Quadric> geometry;
  /// ReverseOrientation xor a transform that swaps handedness, as in pbrt-v4.
  bool flip = false;
  /// An area light. One that is small in its scene is met in double, so that its own near walls hide what lies behind them.
  bool emits = false;
};

}  // namespace woodcock
