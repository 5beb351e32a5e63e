// Angles without the C library: of + − × ÷ only, so that they have the same bits with every version of it, and in a fraction of the time
// of its calls, which give the last digit where sampling needs ten.
#pragma once

#include <cmath>
#include <numbers>

#include "renderer/core/vec.h"

namespace woodcock {

/// (cos a, sin a) for a in [−π/4, π/4], to the rounding of a float.
inline Vec2 cos_sin_of_octant(float a) {
  const float z = a * a;
  return {1 + z * (-0.5f + z * (1.0f / 24 + z * (-1.0f / 720 + z * (1.0f / 40320)))),
          a * (1 + z * (-1.0f / 6 + z * (1.0f / 120 + z * (-1.0f / 5040 + z * (1.0f / 362880)))))};
}

/// (cos a, sin a) for a in [0, 2π], to within 1e-13: Taylor's series in the octants around the nearest axis.
inline DVec2 cos_sin(double a) {
  const double quarters = std::floor(a * (2 / std::numbers::pi) + 0.5);
  const double r = a - quarters * (std::numbers::pi / 2), z = r * r;
  const double sine =
      r * (1 + z * (-1.0 / 6 + z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880 + z * (-1.0 / 39916800 + z * (1.0 / 6227020800)))))));
  const double cosine =
      1 +
      z * (-1.0 / 2 +
           z * (1.0 / 24 + z * (-1.0 / 720 + z * (1.0 / 40320 + z * (-1.0 / 3628800 + z * (1.0 / 479001600 + z * (-1.0 / 87178291200)))))));
  const int k = static_cast<int>(quarters);
  const double x = (k & 1) != 0 ? sine : cosine, y = (k & 1) != 0 ? cosine : sine;
  return {((k + 1) & 2) != 0 ? -x : x, (k & 2) != 0 ? -y : y};
}

/// The angle of (x, y) in [−π, π], as std::atan2(y, x), with a relative error below 1e-14; 0 for (0, 0).
///
/// The angle to the nearest axis or diagonal has a tangent below √2 − 1. There arctan t = t P(t²), P the polynomial that interpolates at
/// the Chebyshev points.
inline double angle_of(DVec2 v) {
  const double x = std::abs(v.x), y = std::abs(v.y);
  const bool steep = y > x;
  const double less = steep ? x : y, more = steep ? y : x;
  if (!(more > 0)) return 0;
  const bool diagonal = less > (std::numbers::sqrt2 - 1) * more;
  const double t = (diagonal ? less - more : less) / (diagonal ? less + more : more), z = t * t, w = z * z;
  const double even =
      0.999999999999999 + w * (0.1999999997837687 + w * (0.11111048820585145 + w * (0.07673529098467827 + w * 0.05024634245596043)));
  const double odd =
      -0.33333333333221343 + w * (-0.14285712660659053 + w * (-0.09089529357362555 + w * (-0.0650594415550331 + w * -0.02531472973194232)));
  double angle = t * (even + z * odd);
  if (diagonal) angle += std::numbers::pi / 4;
  if (steep) angle = std::numbers::pi / 2 - angle;
  if (v.x < 0) angle = std::numbers::pi - angle;
  return std::copysign(angle, v.y);
}

}  // namespace woodcock
