// Draine's phase function, for scatterers between small and large.
//
// p(c) = HG(c; g) · (1 + α c²)/(1 + α (1 + 2g²)/3), c the cosine of the deflection (Draine 2003, "Scattering by
// Interstellar Dust Grains. I. Optical and Ultraviolet"). α = 0 is Henyey-Greenstein; α = 1 is Cornette & Shanks 1992, of which g = 0 is
// Rayleigh scattering, 3/(16π) (1 + c²). The mean cosine is g (1 + α (3 + 2g²)/5)/(1 + α (1 + 2g²)/3).
#pragma once

#include "renderer/media/henyey_greenstein.h"

namespace woodcock {

struct Draine {
  float g = 0;      ///< |g| < 1
  float alpha = 1;  ///< not negative

  /// Density per steradian.
  float eval(const Deflection& c) const {
    return hg_eval(c.one_minus_cos, c.one_plus_cos, g) * (1 + alpha * c.cos * c.cos) / (1 + alpha * (1 + 2 * g * g) / 3);
  }
  /// Inverts the distribution of the deflection at u in [0, 1): u = 0 is backward, u → 1 forward.
  Deflection sample(float u) const;
};

}  // namespace woodcock
