// The tentative collisions of Woodcock tracking.
#pragma once

#include <algorithm>

#include "renderer/core/random.h"
#include "renderer/media/medium.h"

namespace woodcock {

/// Walks the Poisson process of rate σ̄(t) along ray.at(0 … t_max), σ̄ the piecewise constant majorant of the medium
/// (Woodcock et al. 1965; Raab, Seibert & Keller 2006, section 3). The optical depth that is left of a step is carried
/// into the next segment, so each collision costs one random number however many bricks lie between.
class TentativeCollisions {
 public:
  /// `random` must outlive this; the caller may draw from it between two collisions. Where the majorant is positive and
  /// below `least_rate`, that takes its place: any upper bound is a majorant.
  TentativeCollisions(const Medium& medium, const Ray& ray, float t_max, Stream& random, float least_rate = 0)
      : walk_(medium, ray, t_max), random_(random), least_rate_(least_rate) {}

  /// Moves to the next collision; false at the end of the ray.
  bool next() {
    double depth = random_.exponential();
    while (true) {
      if (!segment_) {
        segment_ = walk_.next();
        if (!segment_) return false;
        segment_->sigma = std::max(segment_->sigma, least_rate_);
        t_ = segment_->t0;
      }
      // In double, so that a step far smaller than t still moves.
      const double to_end = (segment_->t1 - t_) * segment_->sigma;
      if (depth < to_end) {
        t_ += depth / segment_->sigma;
        return true;
      }
      depth = std::max(0.0, depth - to_end);
      segment_.reset();
    }
  }

  float t() const { return static_cast<float>(t_); }
  float majorant() const { return segment_->sigma; }

 private:
  MajorantWalk walk_;
  Stream& random_;
  float least_rate_;
  std::optional<MajorantSegment> segment_;
  double t_ = 0;
};

}  // namespace woodcock
