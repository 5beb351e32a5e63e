// The Henyey-Greenstein phase function, in forms that lose no digits for any |g| < 1.
//
// p(cos θ) = (1 − g²) / (4π (1 + g² − 2g cos θ)^{3/2}), per steradian, θ the angle of deflection and g its
// mean cosine (Henyey & Greenstein 1941). Written with c = cos θ the textbook forms cancel: 1 + g² − 2gc near
// |g| = 1, the sampling formula's division by 2g near g = 0, sin θ = √(1 − c²) near c = ±1. Here 1 − c and
// 1 + c are computed directly, as quotients of sums of positive terms, so there is no threshold on g.
#pragma once

#include "renderer/media/deflection.h"

namespace woodcock {

/// Henyey-Greenstein density per steradian for the deflection cosine c, given as both 1 − c and 1 + c: the
/// one that is small carries the precision. |g| < 1.
inline float hg_eval(float one_minus_cos, float one_plus_cos, float g) {
  const float a = 1 - g, b = 1 + g;
  // 1 + g² − 2gc, written so that both terms are positive.
  const float d = g >= 0 ? a * a + 2 * g * one_minus_cos : b * b - 2 * g * one_plus_cos;
  return (0.25f * kInvPi) * (a * b) / (d * std::sqrt(d));
}

/// Inverts the distribution of the deflection cosine at u in [0, 1): u = 0 is backward (c = −1), u → 1 forward.
/// With D = (1−g)(1−u) + (1+g)u: 1 − c = 2(1−g)²(1−u)((1−u) + (1+g)u)/D², 1 + c = 2(1+g)²u((1−g)(1−u) + u)/D².
inline Deflection hg_sample_cosine(float u, float g) {
  const float a = 1 - g, b = 1 + g, v = 1 - u;
  const float inv_d = 1 / (a * v + b * u);
  const float av = a * inv_d, bv = b * inv_d;
  const float one_minus_cos = 2 * (av * av) * v * (v + b * u);
  const float one_plus_cos = 2 * (bv * bv) * u * (a * v + u);
  return {one_minus_cos < one_plus_cos ? 1 - one_minus_cos : one_plus_cos - 1, one_minus_cos, one_plus_cos};
}

/// The phase function; isotropic for g = 0, in which case it is 1/4π to the bit.
struct HenyeyGreenstein {
  float g = 0;  ///< mean cosine of the deflection, |g| < 1; forward scattering for g > 0

  float eval(const Deflection& c) const { return hg_eval(c.one_minus_cos, c.one_plus_cos, g); }
  Deflection sample(float u) const { return hg_sample_cosine(u, g); }

  /// Density per steradian; `wo` and `wi` as for `deflection`.
  float eval(Vec3 wo, Vec3 wi) const { return eval(deflection(wo, wi)); }
  /// Samples `wi` given `wo`, proportional to eval; u uniform in [0, 1)².
  PhaseSample sample(Vec3 wo, Vec2 u) const {
    const Deflection c = sample(u.x);
    return {deflect(wo, c, u.y), eval(c)};
  }
};

}  // namespace woodcock
