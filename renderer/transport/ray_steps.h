// Fixed steps along a ray: what marching estimators share.
#pragma once

#include "renderer/media/extent.h"
#include "renderer/transport/path_sample.h"

namespace woodcock {

/// Cuts the part of a ray that lies in a medium into cells of length Δ (the last one is shorter) and looks the medium up once a
/// cell, at the same fraction u of each, u uniform and drawn once a ray: yᵢ = (i + u) Δ. Extinction is taken to be the same
/// all over a cell. So for optical depths the rule is Σ σt(yᵢ) Δ, whose mean over u is ∫ σt; what is biased is its exponential.
/// In a homogeneous medium depths are exact.
class RaySteps {
 public:
  /// `step` > 0 in render units; `sample` and `ray` must outlive this.
  RaySteps(PathSample& sample, const Medium& medium, const Ray& ray, double t_max, float step, float u)
      : sample_(sample),
        medium_(medium),
        ray_(ray),
        extent_(extent_of(medium, ray, t_max)),
        step_(static_cast<double>(step)),
        u_(static_cast<double>(u)) {}

  /// Moves to the next cell; false at the end of the segment, or when the sample is to end.
  bool next() {
    depth_ = end_depth();
    begin_ = index_ == 0 ? extent_.begin : end_;
    if (!(begin_ < extent_.end) || sample_.stopped) {
      length_ = 0;
      return false;
    }
    // From the index, not summed up: no error grows with the number of steps.
    end_ = std::min(extent_.end, extent_.begin + static_cast<double>(++index_) * step_);
    length_ = end_ - begin_;
    if (!(length_ > 0)) return false;
    point_ = sample_.look_up(medium_, ray_.at(t()));
    return true;
  }

  /// Where the ray enters the medium.
  double entry() const { return extent_.begin; }
  double begin() const { return begin_; }
  double length() const { return length_; }
  /// Where the cell was looked up, and what lies there.
  double t() const { return begin_ + u_ * length_; }
  const MediumPoint& point() const { return point_; }
  /// Optical depth from the segment's start to the cell's begin, to t() and to the cell's end, per channel.
  DVec3 begin_depth() const { return depth_; }
  DVec3 depth() const { return depth_ + DVec3(point_.sigma_t) * (u_ * length_); }
  DVec3 end_depth() const { return depth_ + DVec3(point_.sigma_t) * length_; }

 private:
  PathSample& sample_;
  const Medium& medium_;
  const Ray& ray_;
  const Extent extent_;
  const double step_, u_;
  int64_t index_ = 0;
  double begin_ = 0, end_ = 0, length_ = 0;
  DVec3 depth_{0};
  MediumPoint point_;
};

/// exp(−τ) per channel.
inline Rgb transmittance_of(DVec3 depth) { return Rgb(std::exp(-depth.x), std::exp(-depth.y), std::exp(-depth.z)); }

}  // namespace woodcock
