// Trilinear look-up in a sparse grid.
//
// NanoVDB's tree is unpacked once into bricks of 8³ cells that carry their upper neighbours' first layer with them (9³
// values), so a look-up reads two small tables and one brick, never eight leaves. Empty bricks take no memory, and bricks
// and nodes of one constant value (VDB's active tiles) are shared. Measured against NanoVDB's cached accessor in
// bench/.
#pragma once

#include <vector>

#include "renderer/media/grid_map.h"
#include "renderer/media/majorant_grid.h"
#include "renderer/media/trilinear.h"
#include "renderer/scene/volume.h"

namespace woodcock {

/// A sparse grid of floats. Voxel (i, j, k) has its sample at index-space point (i, j, k), as in NanoVDB's
/// SampleFromVoxels of order 1; the medium ends where pbrt-v4 ends it, at the index-space box [min, max + 1] of the active voxels.
class SparseField {
 public:
  SparseField() = default;
  /// Throws `std::length_error` when the box of active voxels is so large that the table of nodes would not fit. Values
  /// that are not finite or negative are stored as 0 and counted.
  SparseField(const SparseGrid& grid, const DMat4& render_from_medium);

  /// The interpolated value at a render-space point.
  float at(Vec3 p) const { return at_cell(map_.point(p)); }

  /// The interpolated value at cell coordinates, which count from a corner below all voxels.
  float at_cell(Vec3 c) const {
    if (!(c.x >= lower_.x && c.y >= lower_.y && c.z >= lower_.z && c.x <= upper_.x && c.y <= upper_.y && c.z <= upper_.z)) return 0;
    const Vec3 s = c - 0.5f;  // positive: truncation is floor
    const int x = static_cast<int>(s.x), y = static_cast<int>(s.y), z = static_cast<int>(s.z);
    const int node = nodes_[(static_cast<size_t>(z >> 7) * node_size_.y + (y >> 7)) * node_size_.x + (x >> 7)];
    if (node < 0) return 0;
    const int brick = bricks_[(static_cast<size_t>(node) << 12) | (z >> 3 & 15) << 8 | (y >> 3 & 15) << 4 | (x >> 3 & 15)];
    if (brick < 0) return 0;
    const float* v = values_.data() + static_cast<size_t>(brick) * kBrickValues + (z & 7) * kSlice + (y & 7) * kRow + (x & 7);
    return trilinear(v, kRow, kSlice, s - Vec3(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)));
  }

  const GridMap& map() const { return map_; }
  /// Where the medium exists, in cell coordinates.
  const CellBox& box() const { return box_; }
  /// Moves the ends of the medium to `box`, as far as the grid has values there.
  void set_box(const CellBox& box);
  /// All voxels that may be non-zero lie in [0, voxels).
  IVec3 voxels() const { return voxels_; }
  /// Raises the bounds of a majorant grid over `voxels()` by every value stored.
  void add_bounds(MajorantGrid& bounds) const;

  size_t bytes() const { return sizeof(float) * values_.size() + sizeof(int) * (bricks_.size() + nodes_.size()); }
  size_t negative_values() const { return negative_; }
  size_t non_finite_values() const { return non_finite_; }

 private:
  class Builder;
  static constexpr int kRow = 9, kSlice = 81, kBrickValues = 729;

  GridMap map_;
  CellBox box_;
  Vec3 lower_{0}, upper_{-1};  ///< box_ as floats; an empty field contains nothing
  IVec3 voxels_{0};
  IVec3 node_size_{0};
  std::vector<int> nodes_;   ///< per node of 128³ cells: its place in `bricks_` / 4096, or −1 for empty
  std::vector<int> bricks_;  ///< per brick of a node: its place in `values_` / 729, or −1 for empty
  std::vector<float> values_;
  size_t negative_ = 0, non_finite_ = 0;
};

}  // namespace woodcock
