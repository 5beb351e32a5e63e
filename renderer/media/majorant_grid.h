// Upper and lower bounds of σt over bricks of a grid.
//
// Bricks divide the cell coordinates (grid_map.h) at multiples of the brick's edge. The interpolant over a brick
// of edge e starting at cell k involves the voxels k − 1 … k + e, since samples lie at cell centres; the bound is
// taken over all of these. That bounds the interpolant half a voxel beyond the brick's faces as well, so rounding of
// a position that is looked up next to a face cannot exceed the bound. Where all of these voxels are equal the
// interpolant is that value to the bit, and both bounds are equal to it.
#pragma once

#include <vector>

#include "renderer/media/grid_map.h"

namespace woodcock {

/// The bounds of σt in one brick.
struct BrickBounds {
  float upper = 0, lower = 0;
};

/// A dense array of bounds, one a brick.
class MajorantGrid {
 public:
  MajorantGrid() = default;
  /// `voxels`: voxels 0 … voxels − 1 per axis may be non-zero. `box`: where the medium exists, within
  /// [−½, voxels + ½] cells. `edge`: cells a brick, a power of two.
  MajorantGrid(IVec3 voxels, const CellBox& box, const GridMap& map, int edge);

  /// Raises the upper bounds of all bricks whose interpolant involves this voxel. A voxel never added has the value 0; none
  /// is added twice.
  void add_voxel(IVec3 voxel, float value) { add_block(voxel, voxel, value, value); }
  /// The same for a voxel with several channels, by its largest and its smallest.
  void add_voxel(IVec3 voxel, float largest, float smallest) { add_block(voxel, voxel, largest, smallest); }
  /// The same for the constant block of voxels first … last (inclusive).
  void add_block(IVec3 first, IVec3 last, float value) { add_block(first, last, value, value); }
  /// After the last voxel: turns values into σt. Upper bounds are multiplied by `largest`; lower ones, which are 0 until
  /// then, become the smallest value times `smallest`. Bricks that are not constant get an allowance for the rounding of
  /// interpolation.
  void scale(float largest, float smallest);
  /// Makes upper bounds positive exactly where those of a grid of the same bricks are. Bounds must be scaled.
  void follow(const MajorantGrid& other);
  /// The same grid with bricks of twice the edge. Bounds must be scaled.
  MajorantGrid coarser() const;

  /// The median over the bricks that are not empty of (bound × edge in render units); 0 if all are empty.
  double median_optical_depth() const;
  float maximum() const;
  bool empty() const { return maximum() == 0; }
  int edge() const { return edge_; }
  IVec3 size() const { return size_; }
  const CellBox& box() const { return box_; }
  const GridMap& map() const { return map_; }
  float bound(IVec3 brick) const { return bounds_[offset(brick)].upper; }
  float lower(IVec3 brick) const { return bounds_[offset(brick)].lower; }
  const BrickBounds* data() const { return bounds_.data(); }
  size_t offset(IVec3 brick) const { return (static_cast<size_t>(brick.z) * size_.y + brick.y) * size_.x + brick.x; }

 private:
  /// What the lower bound of a brick is made of.
  struct Least {
    float value = kInf;  ///< of the voxels added
    int64_t voxels = 0;  ///< added with a positive value
  };

  IVec3 brick_of_first(IVec3 voxel) const;
  IVec3 brick_of_last(IVec3 voxel) const;
  void add_block(IVec3 first, IVec3 last, float largest, float smallest);
  bool reaches_end(IVec3 brick) const;

  IVec3 size_{0};  ///< bricks per axis
  int edge_ = 1;
  CellBox box_;
  GridMap map_;
  std::vector<BrickBounds> bounds_;
  std::vector<Least> least_;  ///< until the bounds are scaled
};

/// From bricks of `finest.edge()` cells up, the edge whose median non-empty brick has a majorant optical depth
/// nearest to 1: there a step of the walk and a look-up cost about as much as each other. Bounds must be scaled.
MajorantGrid choose_brick_edge(MajorantGrid finest);

}  // namespace woodcock
