// The tentative collisions of Woodcock tracking.
#pragma once

#include <algorithm>

#include "renderer/core/random.h"
#include "renderer/media/majorant_iterator.h"
#include "renderer/media/medium.h"

namespace woodcock {

/// Which part of the majorant collides.
enum class Collide {
  kMajorant,         ///< all of it
  kAboveLowerBound,  ///< what lies above the lower bound of σt, whose own optical depth is summed up (residual tracking)
};

/// Collisions on a ray for the sake of emission, spread over bricks in proportion to what each may bring.
inline constexpr double kEmissiveCollisions = 12;

/// Walks the Poisson process of rate σ̄(t) along ray.at(0 … t_max), σ̄ the piecewise constant majorant of the medium
/// (Woodcock et al. 1965; Raab, Seibert & Keller 2006, section 3). The optical depth that is left of a step is carried
/// into the next segment, so each collision costs one random number however many bricks lie between.
class TentativeCollisions {
 public:
  /// `random` must outlive this; the caller may draw from it between two collisions. Where the majorant is positive and
  /// below `least_rate`, that takes its place: any upper bound is a majorant.
  TentativeCollisions(const Medium& medium, const Ray& ray, double t_max, Stream& random, bool bricks = true, float least_rate = 0,
                      Collide collide = Collide::kMajorant)
      : walk_(medium, ray, t_max, bricks), random_(random), least_rate_(least_rate), collide_(collide) {}

  /// More collisions where the medium emits: some kEmissiveCollisions along the ray, at rates in proportion to the largest emission of each
  /// brick. Before the first `next`; for media with bricks.
  void gather_emission(const Medium& medium, const Ray& ray, double t_max) {
    if (medium.largest_emission() == nullptr) return;
    const BrickIterator start(*medium.largest_emission(), ray, t_max);
    double sum = 0;
    for (BrickIterator all = start; const auto segment = all.next();)
      sum += static_cast<double>(segment->sigma) * (segment->t1 - segment->t0);
    if (!(sum > 0)) return;
    emission_ = start;
    rate_per_emission_ = kEmissiveCollisions / sum;
  }

  /// Moves to the next collision; false at the end of the ray.
  bool next() {
    double depth = random_.exponential();
    while (inside_ || enter_next()) {
      // In double, so that a step far smaller than t still moves. A rate of zero may meet an unbounded segment.
      const double to_end = rate_ > 0 ? (segment_.t1 - t_) * static_cast<double>(rate_) : 0;
      if (depth < to_end) {
        t_ += depth / static_cast<double>(rate_);
        return true;
      }
      depth = std::max(0.0, depth - to_end);
      inside_ = false;
    }
    return false;
  }

  double t() const { return t_; }
  float majorant() const { return segment_.sigma; }
  /// The rate of collisions here, and the part of σt that does not collide.
  float rate() const { return rate_; }
  float lower() const { return collide_ == Collide::kAboveLowerBound ? segment_.lower : 0; }
  /// An estimate of what the lower bounds let through of the segments entered so far, all of each; 1 where all of the majorant
  /// collides. Beyond the depth D = kLowerDepth e^(−depth) is no longer a weight but the probability e^(D − depth) that the walk
  /// goes on with the weight e^(−D), so that no bricks are walked through behind which next to nothing arrives.
  float lower_transmittance() const {
    if (ended_below_) return 0;
    return lower_depth_ > 0 ? static_cast<float>(std::exp(-std::min(lower_depth_, kLowerDepth))) : 1;
  }
  /// σt is the majorant all over the segment, to rounding.
  bool in_constant_brick() const { return segment_.lower == segment_.sigma; }

 private:
  static constexpr double kLowerDepth = 2.3;  ///< a tenth is left

  bool enter_next() {
    const std::optional<MajorantSegment> segment = walk_.next();
    if (!segment) return false;
    inside_ = true;
    segment_ = *segment;
    segment_.sigma = std::max(segment_.sigma, least_rate_);
    // The bricks of both are the same.
    if (emission_)
      segment_.sigma = std::max(segment_.sigma, static_cast<float>(rate_per_emission_ * static_cast<double>(emission_->next()->sigma)));
    t_ = segment_.t0;
    rate_ = segment_.sigma;
    if (collide_ == Collide::kAboveLowerBound && segment_.lower > 0) {
      rate_ -= segment_.lower;
      lower_depth_ += static_cast<double>(segment_.lower) * (segment_.t1 - segment_.t0);
      if (lower_depth_ > kLowerDepth) {
        if (last_depth_ == 0) last_depth_ = kLowerDepth + random_.exponential();
        ended_below_ = lower_depth_ > last_depth_;
        if (ended_below_) return false;
      }
    }
    return true;
  }

  MajorantIterator walk_;
  std::optional<BrickIterator> emission_;
  double rate_per_emission_ = 0;
  Stream& random_;
  float least_rate_;
  Collide collide_;
  bool inside_ = false;       ///< `segment_` is not used up
  bool ended_below_ = false;  ///< by the lower bounds
  MajorantSegment segment_{};
  float rate_ = 0;
  double t_ = 0, lower_depth_ = 0;
  double last_depth_ = 0;  ///< of the lower bounds, to which the walk goes; drawn beyond kLowerDepth
};

}  // namespace woodcock
