// Where a point of render space lies in a grid.
//
// Cell coordinates: voxel i has its sample at i + ½ and owns the cell [i, i + 1]. All affine maps of the scene are
// folded in double and relative to the grid's own first voxel, so that a grid stored at coordinates of 1e5 is as
// good as one at the origin.
#pragma once

#include "renderer/core/vec.h"

namespace woodcock {

/// A box in cell coordinates. The medium is zero outside.
struct CellBox {
  DVec3 lower{0}, upper{0};
};

/// The affine map from render space to a grid's cell coordinates.
class GridMap {
 public:
  GridMap() = default;
  explicit GridMap(const DMat4& cell_from_render) : exact_(cell_from_render) {}

  /// Cell coordinates of a render-space point.
  DVec3 point(DVec3 p) const { return (DVec3(exact_[0]) * p.x + DVec3(exact_[1]) * p.y) + (DVec3(exact_[2]) * p.z + DVec3(exact_[3])); }
  /// Cells per render unit along a direction.
  DVec3 vector(DVec3 v) const { return (DVec3(exact_[0]) * v.x + DVec3(exact_[1]) * v.y) + DVec3(exact_[2]) * v.z; }
  DMat4 render_from_cell() const { return glm::inverse(exact_); }
  /// The edge of a cube with the volume of one cell, in render units.
  double cell_edge() const { return 1 / std::cbrt(std::abs(glm::determinant(glm::dmat3(exact_)))); }

 private:
  DMat4 exact_{1};
};

}  // namespace woodcock
