// Where a point of render space lies in a grid.
//
// Cell coordinates: voxel i has its sample at i + ½ and owns the cell [i, i + 1]. All affine maps of the scene are
// folded in double and relative to the grid's own first voxel, so that a grid stored at coordinates of 1e5 is as
// good as one at the origin; only then is the map rounded to float.
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
  explicit GridMap(const DMat4& cell_from_render) : exact_(cell_from_render) {
    for (int column = 0; column < 4; ++column) column_[column] = Vec3(DVec3(cell_from_render[column]));
  }

  /// Cell coordinates of a render-space point.
  Vec3 point(Vec3 p) const {
    Vec3 c;
    for (int i = 0; i < 3; ++i)
      c[i] = std::fma(column_[0][i], p.x, std::fma(column_[1][i], p.y, std::fma(column_[2][i], p.z, column_[3][i])));
    return c;
  }
  /// The same in double.
  DVec3 point_exact(DVec3 p) const {
    return (DVec3(exact_[0]) * p.x + DVec3(exact_[1]) * p.y) + (DVec3(exact_[2]) * p.z + DVec3(exact_[3]));
  }
  /// Cells per render unit along a direction.
  DVec3 vector_exact(DVec3 v) const { return (DVec3(exact_[0]) * v.x + DVec3(exact_[1]) * v.y) + DVec3(exact_[2]) * v.z; }
  DMat4 render_from_cell() const { return glm::inverse(exact_); }
  /// The edge of a cube with the volume of one cell, in render units.
  double cell_edge() const { return 1 / std::cbrt(std::abs(glm::determinant(glm::dmat3(exact_)))); }

 private:
  DMat4 exact_{1};
  Vec3 column_[4] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}};
};

}  // namespace woodcock
