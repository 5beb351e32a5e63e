// Upper and lower bounds of σt over bricks of a grid, and the walk of a ray through them.
//
// Bricks divide the cell coordinates (grid_map.h) at multiples of the brick's edge. The interpolant over a brick
// of edge e starting at cell k involves the voxels k − 1 … k + e, since samples lie at cell centres; the bound is
// taken over all of these. That bounds the interpolant half a voxel beyond the brick's faces as well, so rounding of
// a position that is looked up next to a face cannot exceed the bound. Where all of these voxels are equal the
// interpolant is that value to the bit, and both bounds are equal to it.
#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "renderer/media/grid_map.h"

namespace woodcock {

/// A part of a ray on which bounds of σt hold: t0 < t1, in render units of length along a unit direction. Bounds are in
/// 1/render unit. Where they are equal, σt is that constant in all channels, up to the rounding of a look-up.
struct MajorantSegment {
  double t0, t1;
  float sigma;      ///< ≥ the largest channel of σa + σs on the segment; positive
  float lower = 0;  ///< ≤ the smallest channel of σt on the segment; not negative
};

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

/// Steps through the bricks that a ray meets, front to back. Consecutive bricks share the face's t to the bit, so the
/// segments with the skipped empty bricks tile [max(0, t_enter), min(t_max, t_exit)] without gap or overlap.
class BrickWalk {
 public:
  BrickWalk() = default;
  /// `ray.d` has unit length; t_max may be infinite. The walk begins and ends `margin` cells, at most ½, beyond the box.
  BrickWalk(const MajorantGrid& grid, const Ray& ray, double t_max, double margin = 0);

  /// The next brick with a positive bound, or nothing at the end.
  std::optional<MajorantSegment> next();

 private:
  const BrickBounds* bounds_ = nullptr;  ///< null when the walk is over
  ptrdiff_t brick_ = 0;                  ///< offset of the current brick
  ptrdiff_t stride_[3];                  ///< to the next brick along the ray, per axis
  double next_t_[3];                     ///< where the ray leaves the current brick, per axis
  double face_t_[3], face_dt_[3];        ///< next_t = face_t + steps · face_dt: no accumulated error
  double steps_[3], last_step_[3];       ///< bricks entered along each axis, and that may be
  double t_ = 0, t_end_ = 0;
};

// Here, so that loops over it keep its state where they like: this and the start of a walk are most of a free flight.
inline std::optional<MajorantSegment> BrickWalk::next() {
  while (bounds_ != nullptr) {
    // The nearest face; of equally near ones the first axis steps first, and the others follow over segments of
    // length zero. Each step uses up one of finitely many, so the walk ends. Which axis it is cannot be predicted, so
    // nothing branches on it.
    int axis = next_t_[1] < next_t_[0] ? 1 : 0;
    axis = next_t_[2] < next_t_[axis] ? 2 : axis;
    const BrickBounds bounds = bounds_[brick_];
    const double t0 = t_;
    double t1 = next_t_[axis];
    if (t1 < t_end_) {
      brick_ += stride_[axis];
      steps_[axis] += 1;
      const double face = face_t_[axis] + steps_[axis] * face_dt_[axis];
      next_t_[axis] = steps_[axis] < last_step_[axis] ? face : std::numeric_limits<double>::infinity();
    } else {
      t1 = t_end_;
      bounds_ = nullptr;
    }
    if (!(t1 > t0)) continue;
    t_ = t1;
    if (bounds.upper > 0) return MajorantSegment{t0, t1, bounds.upper, bounds.lower};
  }
  return std::nullopt;
}

}  // namespace woodcock
