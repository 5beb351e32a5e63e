#include "renderer/media/draine.h"

#include <algorithm>
#include <cmath>

namespace woodcock {

// With v in [0, 1] the part of Henyey-Greenstein's distribution that lies forward of a deflection, a = 1 − g, b = 1 + g and
// x = a v/(a v + b (1 − v)), g ≥ 0 (else mirrored), that deflection has
//
//     1 − c = 2x (a + g x),      1 + c = 2 (1 − x)(1 + g x),
//
// and the part of c² HG forward of it is ∫₀ᵛ c² dv = v (1 − 2a x + ⅔ a x² (2a + g x)): by dv = b dz/(1 + 2gz)², z = x/a, and
// y = z (1 + g z), c = 1 − 2a² y, it is b ∫ (1 − 2a² y)² (1 + 4g y)^(−3/2) dy, whose three terms are elementary. Nothing is
// divided by g. Draine's distribution F(v) = v (1 + α (…))/(1 + α (1 + 2g²)/3) is increasing with F′ = (1 + α c²)/(…), and
// inverted by Newton's method, kept within a bracket by bisection.
Deflection Draine::sample(float u) const {
  const double gd = std::abs(static_cast<double>(g)), ad = static_cast<double>(alpha);
  const double a = 1 - gd, b = 1 + gd, inverse_norm = 1 / (1 + ad * (1 + 2 * gd * gd) / 3);
  const double forward = g >= 0 ? 1 - static_cast<double>(u) : static_cast<double>(u);
  double low = 0, high = 1, v = forward, x = 0, rest = 1;
  constexpr int kMaxSteps = 100;  // bisection alone needs fewer
  for (int step = 0; step < kMaxSteps; ++step) {
    const double d = a * v + b * (1 - v);
    x = a * v / d;
    rest = b * (1 - v) / d;  // 1 − x
    const double cos = 1 - 2 * x * (a + gd * x);
    const double f = v * (1 + ad * (1 - 2 * a * x + 2.0 / 3 * a * x * x * (2 * a + gd * x))) * inverse_norm - forward;
    const double newton = f / ((1 + ad * cos * cos) * inverse_norm);
    if (std::abs(newton) <= 1e-12 * v) break;
    (f > 0 ? high : low) = v;
    v -= newton;
    if (!(v > low && v < high)) v = 0.5 * (low + high);
  }
  const auto near = static_cast<float>(2 * x * (a + gd * x)), far = static_cast<float>(2 * rest * (1 + gd * x));
  return g >= 0 ? Deflection::of_complements(near, far) : Deflection::of_complements(far, near);
}

}  // namespace woodcock
