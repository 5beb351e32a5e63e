#include "renderer/core/sobol.h"

namespace woodcock {
namespace {

/// A primitive polynomial modulo 2 with its first direction numbers: dimensions 3 to 6 of "new-joe-kuo-6" (Joe & Kuo 2008,
/// "Constructing Sobol' sequences with better two-dimensional projections"), which counts from 1.
struct Polynomial {
  int degree;
  uint32_t coefficients;  ///< between the first and the last, which are one
  std::array<uint32_t, 4> m;
};
constexpr std::array<Polynomial, 2 * kSobolPairs - 2> kPolynomials{
    {{2, 1, {1, 3, 0, 0}}, {3, 1, {1, 3, 1, 0}}, {3, 2, {1, 1, 1, 0}}, {4, 1, {1, 1, 3, 3}}}};

constexpr SobolTables make_tables() {
  SobolTables tables{};
  for (size_t d = 0; d < kPolynomials.size(); ++d) {
    const Polynomial& p = kPolynomials[d];
    std::array<uint32_t, 32> v{};
    for (int j = 0; j < 32; ++j) {
      const auto at = [&](int k) -> uint32_t& { return v[static_cast<size_t>(k)]; };
      if (j < p.degree) {
        at(j) = p.m[static_cast<size_t>(j)] << (31 - j);
        continue;
      }
      at(j) = at(j - p.degree) ^ (at(j - p.degree) >> p.degree);
      for (int k = 1; k < p.degree; ++k) at(j) ^= ((p.coefficients >> (p.degree - 1 - k)) & 1u) * at(j - k);
    }
    for (size_t byte = 0; byte < 4; ++byte)
      for (uint32_t i = 0; i < 256; ++i) {
        uint32_t digits = 0;
        for (uint32_t bit = 0; bit < 8; ++bit)
          if (((i >> bit) & 1u) != 0) digits ^= v[8 * byte + bit];
        tables.part[d][byte][i] = reverse_bits(digits);
      }
  }
  return tables;
}

}  // namespace

constexpr SobolTables kSobolTables = make_tables();

}  // namespace woodcock
