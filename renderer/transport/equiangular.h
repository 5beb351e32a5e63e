// Distances along a ray in proportion to the light that arrives from a point.
#pragma once

#include <algorithm>
#include <cmath>

#include "renderer/core/vec.h"

namespace woodcock {

/// The density 1/(h² + (t − t_c)²) on [0, t_max], h the distance of a point from the ray and t_c where the ray comes
/// closest: the inverse square of the distance to the point (Kulla & Fajardo 2012, "Importance Sampling Techniques for
/// Path Tracing in Participating Media", section 4.1). The angle under which the point sees the way is uniform.
class EquiangularDistances {
 public:
  /// `ray.d` has unit length; `t_max` may be infinite.
  EquiangularDistances(const Ray& ray, DVec3 point, double t_max) {
    const DVec3 to = point - ray.o, d = ray.d;
    closest_ = glm::dot(to, d);
    // A point on the ray itself has no angle; any positive h gives a density that is positive everywhere.
    height_ = std::max(glm::length(to - closest_ * d), 1e-6 * glm::length(to) + 1e-30);
    first_ = std::atan2(-closest_, height_);
    const double last = std::isfinite(t_max) ? std::atan2(t_max - closest_, height_) : 0.5 * 3.14159265358979323846;
    angle_ = last - first_;
    t_max_ = t_max;
  }

  /// Under which the point sees the way, in radians. Where it is small the inverse square hardly varies.
  double angle() const { return angle_; }

  /// u in [0, 1).
  double sample(double u) const {
    const double t = closest_ + height_ * std::tan(first_ + u * angle_);
    return std::clamp(t, 0.0, t_max_);
  }

  /// Per render unit of distance.
  float pdf(double t) const {
    const double x = t - closest_;
    return angle_ > 0 ? static_cast<float>(height_ / (angle_ * (height_ * height_ + x * x))) : 0.0f;
  }

 private:
  double closest_, height_, first_, angle_, t_max_;
};

}  // namespace woodcock
