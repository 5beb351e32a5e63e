// The majorant iterator of a medium: the parts of a ray, front to back, each with bounds of σt.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "renderer/media/medium.h"

namespace woodcock {

/// A part of a ray on which bounds of σt hold: t0 < t1, in render units of length along a unit direction. Bounds are in
/// 1/render unit. Where they are equal, σt is that constant in all channels, up to the rounding of a look-up.
struct MajorantSegment {
  double t0, t1;
  float sigma;      ///< ≥ the largest channel of σa + σs on the segment; positive
  float lower = 0;  ///< ≤ the smallest channel of σt on the segment; not negative
};

/// Steps through the bricks that a ray meets, front to back. Consecutive bricks share the face's t to the bit, so the
/// segments with the skipped empty bricks tile [max(0, t_enter), min(t_max, t_exit)] without gap or overlap.
class BrickIterator {
 public:
  BrickIterator() = default;
  /// `ray.d` has unit length; t_max may be infinite. The walk begins and ends `margin` cells, at most ½, beyond the box.
  BrickIterator(const MajorantGrid& grid, const Ray& ray, double t_max, double margin = 0);

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
inline std::optional<MajorantSegment> BrickIterator::next() {
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

class SumIterator;

/// The parts of a ray where a medium may interact, front to back, each with bounds of σt. Parts in between are empty.
class MajorantIterator {
 public:
  /// `ray.d` has unit length; the walk covers [0, t_max], and t_max may be infinite. Without `bricks` it is one segment,
  /// with the bound of the whole medium.
  MajorantIterator(const Medium& medium, const Ray& ray, double t_max, bool bricks = true)
      : bricks_(bricks && medium.has_bricks() ? BrickIterator(medium.majorants(), ray, t_max) : BrickIterator()) {
    if (!bricks || !medium.has_bricks()) enter(medium, ray, t_max, bricks);
  }

  /// The next segment, or nothing at the end.
  std::optional<MajorantSegment> next() {
    if (sum_) return next_of(*sum_);
    if (whole_) return std::exchange(whole_, std::nullopt);
    return bricks_.next();
  }

 private:
  struct DeleteSum {
    void operator()(SumIterator* sum) const;
  };

  void enter(const Medium& medium, const Ray& ray, double t_max, bool bricks);
  static std::optional<MajorantSegment> next_of(SumIterator& sum);

  BrickIterator bricks_;
  std::optional<MajorantSegment> whole_;
  std::unique_ptr<SumIterator, DeleteSum> sum_;
};

}  // namespace woodcock
