// The Owen-scrambled Sobol' sequence, in pairs of dimensions.
//
// Points of the first pair fill the unit square evenly: any 2^m of them that begin at a multiple of 2^m lie one in each
// cell of every partition into 2^m equal boxes (a (0, 2)-sequence). Numbers of different pairs are either *padded*: each pair has a
// sequence of its own, scrambled and shuffled by its own seed (Burley 2020, "Practical Hash-based Owen Scrambling", section 5), so that
// pairs do not know of each other; or *joint*: up to kSobolPairs pairs of one sequence, shuffled alike, which fill more dimensions evenly.
#pragma once

#include <array>
#include <cstdint>

#include "renderer/core/vec.h"

namespace woodcock {

constexpr uint32_t reverse_bits(uint32_t x) {
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

inline constexpr int kSobolPairs = 3;

/// Coordinates 2 to 5 of the sequence: what each byte of an index adds to the digits, reversed. 16 kB.
struct SobolTables {
  std::array<std::array<std::array<uint32_t, 256>, 4>, 2 * kSobolPairs - 2> part;

  uint32_t digits(int dimension, uint32_t i) const {
    const auto& p = part[static_cast<size_t>(dimension - 2)];
    return p[0][i & 255] ^ p[1][(i >> 8) & 255] ^ p[2][(i >> 16) & 255] ^ p[3][i >> 24];
  }
};
extern const SobolTables kSobolTables;

/// Point `index`, in [0, 1)² with 24 bits a coordinate: coordinates 2·pair and 2·pair + 1 of the sequence, its order shuffled by
/// `shuffle`, both scrambled by `seed`.
inline Vec2 sobol_point(uint32_t index, uint32_t shuffle, uint64_t seed, int pair) {
  const auto low = static_cast<uint32_t>(seed), high = static_cast<uint32_t>(seed >> 32);
  const uint32_t i = reverse_bits(scramble_upwards(reverse_bits(index), shuffle));
  const uint32_t x_digits = pair == 0 ? i : kSobolTables.digits(2 * pair, i);
  const uint32_t y_digits = pair == 0 ? pascal_digits(i) : kSobolTables.digits(2 * pair + 1, i);
  const uint32_t x = reverse_bits(scramble_upwards(x_digits, high));
  const uint32_t y = reverse_bits(scramble_upwards(y_digits, low ^ (high * 0x9e3779b9u)));
  return {static_cast<float>(x >> 8) * 0x1p-24f, static_cast<float>(y >> 8) * 0x1p-24f};
}

/// A point of the padded sequence that `seed` names.
inline Vec2 sobol_point(uint32_t index, uint64_t seed) { return sobol_point(index, static_cast<uint32_t>(seed), seed, 0); }

}  // namespace woodcock
