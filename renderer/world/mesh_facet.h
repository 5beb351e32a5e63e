// One flat piece of a closed mesh of glass.
#pragma once

#include <array>
#include <cstdint>

#include "renderer/geometry/geometry.h"
#include "renderer/geometry/refraction_triangle.h"

namespace woodcock {

/// A triangle of a shape, or half of a quadrilateral.
struct MeshFacet {
  std::array<DVec3, 3> p;
  DVec3 n;  ///< unit, out of the body
  int shape, instance;
  uint32_t primitive;
  enum class Part : uint8_t { kTriangle, kLowerHalf, kUpperHalf } part;
  /// What the shading normal is interpolated from; of a flat facet the means of the facets around each corner, by which it is found but not
  /// refracted.
  std::array<DVec3, 3> normals;
  bool is_flat;
  std::array<uint32_t, 3> corners;  ///< numbers, equal where positions are; in the end where `around` has the facets that meet there
  std::array<bool, 3> corners_named{};

  /// At these barycentric coordinates of the second and third corner.
  Hit hit(DVec2 b) const {
    if (part == Part::kLowerHalf) b = {b.x + b.y, b.y};
    if (part == Part::kUpperHalf) b = {b.x, b.x + b.y};
    return {0, b, shape, primitive, instance};
  }

  ShadedTriangle shaded() const { return {p[0], p[1] - p[0], p[2] - p[0], n, normals}; }
};

}  // namespace woodcock
