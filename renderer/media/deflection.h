// The angle between the direction of flight before a scattering and after it, in a form that keeps its digits.
#pragma once

#include "renderer/core/frame.h"
#include "renderer/core/vec.h"

namespace woodcock {

/// The cosine of a deflection, 1 straight ahead, with its complements, none of which is formed by a cancelling difference:
/// the one that is small carries the precision.
struct Deflection {
  float cos, one_minus_cos, one_plus_cos;

  static Deflection of_complements(float one_minus_cos, float one_plus_cos) {
    return {one_minus_cos < one_plus_cos ? 1 - one_minus_cos : one_plus_cos - 1, one_minus_cos, one_plus_cos};
  }
};

/// The deflection between two unit vectors that both point away from the scattering point: −dot(wo, wi) is its cosine.
inline Deflection deflection(Vec3 wo, Vec3 wi) {
  // For unit vectors |wo ± wi|² = 2 (1 ± dot): the differences are exact where they are small.
  return Deflection::of_complements(0.5f * length_squared(wo + wi), 0.5f * length_squared(wo - wi));
}

/// The direction that is deflected by `c`, at an azimuth of 2π u around the direction of flight.
inline Vec3 deflect(Vec3 wo, const Deflection& c, float u) {
  const float sin_theta = std::sqrt(c.one_minus_cos * c.one_plus_cos);
  const float phi = 2 * kPi * u;
  return Frame::from_normal(-wo).to_world({sin_theta * std::cos(phi), sin_theta * std::sin(phi), c.cos});
}

/// A sampled direction.
struct PhaseSample {
  Vec3 wi;
  float pdf;  ///< per steradian; the value of the phase function, so that the weight of a sample is 1
};

}  // namespace woodcock
