// What a linear map does to directions and to densities over them.
#pragma once

#include "renderer/core/vec.h"

namespace woodcock {

/// Takes unit directions of one space ("a") to another ("b") by a linear map of any kind, mirroring and
/// non-uniform scales included.
class DirectionMap {
 public:
  DirectionMap() = default;
  explicit DirectionMap(const glm::dmat3& b_from_a) : b_from_a_(b_from_a), a_from_b_(glm::inverse(b_from_a)) {
    determinant_ = std::abs(glm::determinant(b_from_a));
  }

  DVec3 to_b(DVec3 a) const { return glm::normalize(b_from_a_ * a); }
  DVec3 to_a(DVec3 b) const { return glm::normalize(a_from_b_ * b); }

  /// dω_b / dω_a at the unit direction `a`: |det M| / |M a|³. A pdf per solid angle of b times this is one of a.
  double solid_angle_ratio(DVec3 a) const {
    const double length = glm::length(b_from_a_ * a);
    return determinant_ / (length * length * length);
  }

 private:
  glm::dmat3 b_from_a_{1}, a_from_b_{1};
  double determinant_ = 1;
};

}  // namespace woodcock
