// Streams whose next numbers are chosen, so that limits which chance meets once in 2⁶⁴ draws are met at once.
#pragma once

#include "renderer/core/random.h"

namespace woodcock::testing {

/// The z with mix64(z) = value: its steps undone one by one. The shift is undone by shifting again until nothing is left, the odd
/// factor by its inverse modulo 2⁶⁴ (Newton's iteration doubles the right digits).
inline uint64_t unmix64(uint64_t value) {
  const auto unshift = [](uint64_t z, int shift) {
    uint64_t x = z;
    for (int done = shift; done < 64; done += shift) x = z ^ (x >> shift);
    return x;
  };
  const auto inverse = [](uint64_t odd) {
    uint64_t x = odd;
    for (int i = 0; i < 6; ++i) x *= 2 - odd * x;
    return x;
  };
  uint64_t z = unshift(value, 31) * inverse(0x94d049bb133111ebULL);
  z = unshift(z, 27) * inverse(0xbf58476d1ce4e5b9ULL);
  return unshift(z, 30);
}

/// A stream whose next 64 bits are `bits`; what follows is as random as ever.
inline Stream stream_with_next(uint64_t bits) { return Stream(unmix64(bits) - 0x9e3779b97f4a7c15ULL); }

/// The 64 bits that uniform2() reads as (x, y), multiples of 2⁻²⁴ in [0, 1).
inline uint64_t bits_of(Vec2 u) { return static_cast<uint64_t>(u.x * 0x1p24f) << 40 | static_cast<uint64_t>(u.y * 0x1p24f) << 8; }

}  // namespace woodcock::testing
