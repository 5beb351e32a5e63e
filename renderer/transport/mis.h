// Multiple importance sampling.
#pragma once

namespace woodcock {

/// The power heuristic with exponent 2 (Veach 1997, section 9.2.4): the weight of a technique of density `pdf` beside
/// one of density `other` for the same thing. Written as a ratio so that large densities do not overflow.
inline float power_heuristic(float pdf, float other) {
  if (!(pdf > 0)) return 0;
  const float r = other / pdf;
  return 1 / (1 + r * r);
}

/// The same beside two others.
inline float power_heuristic(float pdf, float other1, float other2) {
  if (!(pdf > 0)) return 0;
  const float r1 = other1 / pdf, r2 = other2 / pdf;
  return 1 / (1 + r1 * r1 + r2 * r2);
}

}  // namespace woodcock
