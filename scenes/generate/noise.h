// Lattice noise from integer hashes. Only + − × ÷ √ and floor are used, so that the generated data has the same
// bits on every machine.
#pragma once

#include <cmath>
#include <cstdint>

#include "renderer/core/random.h"
#include "renderer/core/vec.h"

namespace woodcock::generate {

/// A number in [0, 1) that depends on the lattice point and `seed` only.
inline double lattice_value(int64_t x, int64_t y, int64_t z, uint64_t seed) {
  uint64_t h = hash_combine(seed, static_cast<uint64_t>(x));
  h = hash_combine(h, static_cast<uint64_t>(y));
  h = hash_combine(h, static_cast<uint64_t>(z));
  return static_cast<double>(h >> 11) * 0x1p-53;
}

inline double smoothstep(double low, double high, double x) {
  const double t = std::fmin(1.0, std::fmax(0.0, (x - low) / (high - low)));
  return t * t * (3 - 2 * t);
}

/// Value noise in [−1, 1], continuously differentiable, features of size 1.
double value_noise(DVec3 p, uint64_t seed);

/// Sum of `octaves` of value noise, each half as large and twice as fine; within [−2, 2].
double fractal_noise(DVec3 p, int octaves, uint64_t seed);

/// 1 on the points of a jittered lattice, falling to 0 at distance 1: round bumps, the billows of a cloud
/// (Worley 1996, "A Cellular Texture Basis Function", distance to the nearest point).
double billow(DVec3 p, uint64_t seed);

/// 1 on creases, 0 between them: mountain ridges. Sum of `octaves`, normalised to [0, 1].
double ridges(DVec3 p, int octaves, uint64_t seed);

}  // namespace woodcock::generate
