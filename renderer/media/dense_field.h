// Trilinear look-up in a dense grid.
#pragma once

#include <vector>

#include "renderer/media/grid_map.h"
#include "renderer/media/trilinear.h"
#include "renderer/scene/volume.h"

namespace woodcock {

/// A dense grid of floats or colours, kept with a border of zeros so that a look-up has no special case at the
/// faces. T is float or Rgb. Values fade over the outer half voxel, as in pbrt-v4, and are zero outside the box.
template <typename T>
class DenseField {
 public:
  DenseField() = default;
  /// `scale` multiplies every value.
  DenseField(const DenseGrid<T>& grid, const DMat4& render_from_medium, float scale = 1) : size_(grid.size), upper_(grid.size) {
    const DVec3 extent = grid.p1 - grid.p0;
    DMat4 medium_from_cell{1};
    for (int i = 0; i < 3; ++i) {
      medium_from_cell[i][i] = extent[i] / grid.size[i];
      medium_from_cell[3][i] = grid.p0[i];
    }
    map_ = GridMap(glm::inverse(render_from_medium * medium_from_cell));
    row_ = static_cast<size_t>(size_.x) + 2;
    slice_ = row_ * (static_cast<size_t>(size_.y) + 2);
    values_.assign(slice_ * (static_cast<size_t>(size_.z) + 2), T(0));
    for (int z = 0; z < size_.z; ++z)
      for (int y = 0; y < size_.y; ++y)
        for (int x = 0; x < size_.x; ++x) values_[(z + 1) * slice_ + (y + 1) * row_ + x + 1] = grid.at(x, y, z) * scale;
  }

  /// The interpolated value at a render-space point.
  T at(Vec3 p) const { return at_cell(map_.point(p)); }

  /// The interpolated value at cell coordinates.
  T at_cell(Vec3 c) const {
    if (!contains_cell(c)) return T(0);
    // Sample position c − ½, plus one for the border: positive, so truncation is floor.
    const Vec3 s = c + 0.5f;
    const int x = static_cast<int>(s.x), y = static_cast<int>(s.y), z = static_cast<int>(s.z);
    const T* v = values_.data() + z * slice_ + y * row_ + x;
    return trilinear(v, row_, slice_, s - Vec3(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)));
  }

  /// Whether a render-space point lies in the grid's box.
  bool contains(Vec3 p) const { return contains_cell(map_.point(p)); }

  IVec3 size() const { return size_; }
  const GridMap& map() const { return map_; }
  CellBox box() const { return {DVec3(0), DVec3(size_)}; }
  /// The stored value of voxel (x, y, z), which lies inside.
  const T& voxel(int x, int y, int z) const { return values_[(z + 1) * slice_ + (y + 1) * row_ + x + 1]; }

 private:
  /// NaN coordinates are outside.
  bool contains_cell(Vec3 c) const { return c.x >= 0 && c.y >= 0 && c.z >= 0 && c.x <= upper_.x && c.y <= upper_.y && c.z <= upper_.z; }

  IVec3 size_{0};
  Vec3 upper_{-1};  ///< an empty field contains nothing
  GridMap map_;
  size_t row_ = 0, slice_ = 0;
  std::vector<T> values_;
};

}  // namespace woodcock
