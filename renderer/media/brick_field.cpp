#include "renderer/media/brick_field.h"

#include <algorithm>

namespace woodcock {

template <typename T>
BrickField<T>::BrickField(const DenseGrid<T>& grid, const DMat4& render_from_medium, float scale) : voxels_(grid.size) {
  const DVec3 extent = grid.p1 - grid.p0;
  DMat4 medium_from_cell{1};
  for (int i = 0; i < 3; ++i) {
    medium_from_cell[i][i] = extent[i] / grid.size[i];
    medium_from_cell[3][i] = grid.p0[i];
  }
  map_ = GridMap(glm::inverse(render_from_medium * medium_from_cell));
  // One voxel of zeros is stored below the first, since look-ups begin half a cell before its sample: stored voxel = voxel + 1.
  to_storage_ = 0.5f;
  const auto stored = [&](IVec3 v) {
    for (int i = 0; i < 3; ++i)
      if (v[i] < 1 || v[i] > grid.size[i]) return T(0);
    return grid.at(v.x - 1, v.y - 1, v.z - 1) * scale;
  };
  node_size_ = grid.size / kNodeCells + 1;  // look-ups begin at stored voxels 0 … size
  std::vector<int> bricks(4096);
  std::vector<T> values(kBrickValues);
  for (int n = 0; n < node_size_.x * node_size_.y * node_size_.z; ++n) {
    const IVec3 node_corner = kNodeCells * IVec3(n % node_size_.x, n / node_size_.x % node_size_.y, n / node_size_.x / node_size_.y);
    for (int b = 0; b < 4096; ++b) {
      const IVec3 corner = node_corner + 8 * IVec3(b & 15, b >> 4 & 15, b >> 8);
      bricks[static_cast<size_t>(b)] = -1;
      if (corner.x > grid.size.x || corner.y > grid.size.y || corner.z > grid.size.z) continue;
      T* v = values.data();
      for (int z = 0; z < 9; ++z)
        for (int y = 0; y < 9; ++y)
          for (int x = 0; x < 9; ++x) *v++ = stored(corner + IVec3(x, y, z));
      bricks[static_cast<size_t>(b)] = add_brick(values);
    }
    nodes_.push_back(add_node(bricks));
  }
  box_ = {DVec3(0), DVec3(grid.size)};
  lower_ = Vec3(box_.lower);
  upper_ = Vec3(box_.upper);
}

template <typename T>
int BrickField<T>::add_node(const std::vector<int>& bricks) {
  if (std::all_of(bricks.begin(), bricks.end(), [](int b) { return b < 0; })) return -1;
  bricks_.insert(bricks_.end(), bricks.begin(), bricks.end());
  return static_cast<int>(bricks_.size() / 4096) - 1;
}

template <typename T>
int BrickField<T>::add_brick(const std::vector<T>& values) {
  if (std::all_of(values.begin(), values.end(), [](const T& v) { return v == T(0); })) return -1;
  values_.insert(values_.end(), values.begin(), values.end());
  return static_cast<int>(values_.size() / kBrickValues) - 1;
}

template class BrickField<float>;
template class BrickField<Rgb>;

}  // namespace woodcock
