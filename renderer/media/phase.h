// The Henyey-Greenstein phase function, in forms that lose no digits for any |g| < 1.
//
// p(cos θ) = (1 − g²) / (4π (1 + g² − 2g cos θ)^{3/2}), per steradian, θ the angle of deflection and g its
// mean cosine (Henyey & Greenstein 1941). Written with c = cos θ the textbook forms cancel: 1 + g² − 2gc near
// |g| = 1, the sampling formula's division by 2g near g = 0, sin θ = √(1 − c²) near c = ±1. Here 1 − c and
// 1 + c are computed directly, as quotients of sums of positive terms, so there is no threshold on g.
#pragma once

#include "renderer/core/frame.h"
#include "renderer/core/vec.h"

namespace woodcock {

/// Henyey-Greenstein density per steradian for the deflection cosine c, given as both 1 − c and 1 + c: the
/// one that is small carries the precision. |g| < 1.
inline float hg_eval(float one_minus_cos, float one_plus_cos, float g) {
  const float a = 1 - g, b = 1 + g;
  // 1 + g² − 2gc, written so that both terms are positive.
  const float d = g >= 0 ? a * a + 2 * g * one_minus_cos : b * b - 2 * g * one_plus_cos;
  return (0.25f * kInvPi) * (a * b) / (d * std::sqrt(d));
}

/// The cosine of a sampled deflection with its complements, none of which is formed by a cancelling difference.
struct HgCosine {
  float cos, one_minus_cos, one_plus_cos;
};

/// Inverts the distribution of the deflection cosine at u in [0, 1): u = 0 is backward (c = −1), u → 1 forward.
/// With D = (1−g)(1−u) + (1+g)u: 1 − c = 2(1−g)²(1−u)((1−u) + (1+g)u)/D², 1 + c = 2(1+g)²u((1−g)(1−u) + u)/D².
inline HgCosine hg_sample_cosine(float u, float g) {
  const float a = 1 - g, b = 1 + g, v = 1 - u;
  const float inv_d = 1 / (a * v + b * u);
  const float av = a * inv_d, bv = b * inv_d;
  const float one_minus_cos = 2 * (av * av) * v * (v + b * u);
  const float one_plus_cos = 2 * (bv * bv) * u * (a * v + u);
  return {one_minus_cos < one_plus_cos ? 1 - one_minus_cos : one_plus_cos - 1, one_minus_cos, one_plus_cos};
}

/// The phase function of one medium.
struct HenyeyGreenstein {
  float g = 0;  ///< mean cosine of the deflection, |g| < 1; forward scattering for g > 0

  struct Sample {
    Vec3 wi;
    float pdf;  ///< per steradian; equals eval(wo, wi), so the weight of a sample is 1
  };

  /// Density per steradian. `wo` and `wi` are unit vectors that both point away from the scattering point:
  /// −dot(wo, wi) is the cosine of the deflection.
  float eval(Vec3 wo, Vec3 wi) const {
    // For unit vectors |wo ± wi|² = 2 (1 ± dot): the differences are exact where they are small.
    return hg_eval(0.5f * length_squared(wo + wi), 0.5f * length_squared(wo - wi), g);
  }

  /// Samples `wi` given `wo`, proportional to eval; u uniform in [0, 1)².
  Sample sample(Vec3 wo, Vec2 u) const {
    const HgCosine c = hg_sample_cosine(u.x, g);
    const float sin_theta = std::sqrt(c.one_minus_cos * c.one_plus_cos);
    const float phi = 2 * kPi * u.y;
    const Vec3 local{sin_theta * std::cos(phi), sin_theta * std::sin(phi), c.cos};
    return {Frame::from_normal(-wo).to_world(local), hg_eval(c.one_minus_cos, c.one_plus_cos, g)};
  }
};

/// The phase function at one point of a medium, as estimators see it.
class PhaseMix {
 public:
  struct Sample {
    Vec3 wi;
    float pdf;   ///< per steradian
    Rgb weight;  ///< eval / pdf per channel
  };

  explicit PhaseMix(const HenyeyGreenstein& phase) : phase_(&phase) {}

  /// Density per steradian and channel; directions as for HenyeyGreenstein.
  Rgb eval(Vec3 wo, Vec3 wi) const { return Rgb(phase_->eval(wo, wi)); }
  /// The density with which `sample` gives `wi`.
  float pdf(Vec3 wo, Vec3 wi) const { return phase_->eval(wo, wi); }
  /// u in [0,1)² for the direction, `u_choice` in [0,1) for the choice of a component.
  Sample sample(Vec3 wo, Vec2 u, float /*u_choice*/) const {
    const auto s = phase_->sample(wo, u);
    return {s.wi, s.pdf, Rgb(1)};
  }

 private:
  const HenyeyGreenstein* phase_;
};

}  // namespace woodcock
