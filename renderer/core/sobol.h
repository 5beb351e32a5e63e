// The Owen-scrambled Sobol' sequence in two dimensions.
//
// Points of one sequence fill the unit square evenly: any 2^m of them that begin at a multiple of 2^m lie one in each
// cell of every partition into 2^m equal boxes (a (0, 2)-sequence). Higher dimensions are *padded*: each pair of
// numbers has a sequence of its own, scrambled and shuffled by its own seed (Burley 2020, "Practical Hash-based Owen
// Scrambling", section 5), so that pairs do not know of each other.
#pragma once

#include <cstdint>

#include "renderer/core/vec.h"

namespace woodcock {

inline uint32_t reverse_bits(uint32_t x) {
  x = __builtin_bswap32(x);
  x = ((x & 0x0f0f0f0fu) << 4) | ((x >> 4) & 0x0f0f0f0fu);
  x = ((x & 0x33333333u) << 2) | ((x >> 2) & 0x33333333u);
  return ((x & 0x55555555u) << 1) | ((x >> 1) & 0x55555555u);
}

/// A permutation in which a bit depends on lower bits only (Laine & Karras 2011; multipliers from Vegdahl 2021). On
/// reversed numbers it is a nested uniform scramble.
inline uint32_t scramble_upwards(uint32_t x, uint32_t seed) {
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return x;
}

/// The second coordinate of the Sobol' sequence has Pascal's triangle modulo 2 as its matrix: digit j is the sum of all
/// index bits i whose position contains the ones of j (Lucas' theorem). Returned with its digits reversed.
inline uint32_t pascal_digits(uint32_t i) {
  i ^= (i >> 1) & 0x55555555u;
  i ^= (i >> 2) & 0x33333333u;
  i ^= (i >> 4) & 0x0f0f0f0fu;
  i ^= (i >> 8) & 0x00ff00ffu;
  return i ^ ((i >> 16) & 0x0000ffffu);
}

/// Point `index` of the sequence that `seed` names, in [0, 1)² with 24 bits a coordinate.
inline Vec2 sobol_point(uint32_t index, uint64_t seed) {
  const auto low = static_cast<uint32_t>(seed), high = static_cast<uint32_t>(seed >> 32);
  const uint32_t i = reverse_bits(scramble_upwards(reverse_bits(index), low));
  const uint32_t x = reverse_bits(scramble_upwards(i, high));
  const uint32_t y = reverse_bits(scramble_upwards(pascal_digits(i), low ^ (high * 0x9e3779b9u)));
  return {static_cast<float>(x >> 8) * 0x1p-24f, static_cast<float>(y >> 8) * 0x1p-24f};
}

}  // namespace woodcock
