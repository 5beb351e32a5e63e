// The logarithm behind every distance.
#include "renderer/core/random.h"

#include <gtest/gtest.h>

namespace woodcock {
namespace {

TEST(MinusLog, is_the_c_librarys_logarithm_next_to_zero_and_to_one) {
  Stream random(1);
  for (int i = 0; i < 300000; ++i) {
    // Numbers of every size in (0, 1), seen from either end; both are multiples of 2^-53, so that 1 − u is exact.
    const double small = static_cast<double>((random.next_u64() >> (11 + random.next_u32() % 53)) + 1) * 0x1p-53;
    if (small >= 1) continue;
    for (const double u : {small, 1 - small, random.uniform_double()}) {
      const double expected = -std::log1p(-u);
      EXPECT_NEAR(minus_log(1 - u), expected, 1e-10 * expected) << std::hexfloat << u;
    }
  }
}

TEST(MinusLog, is_exact_at_its_ends) {
  EXPECT_EQ(minus_log(1), 0);
  EXPECT_FALSE(std::signbit(minus_log(1)));
  EXPECT_NEAR(minus_log(0x1p-53), 53 * std::log(2.0), 1e-13);
}

TEST(MinusLog, does_not_jump_where_the_series_starts_anew) {
  // Next to √½ · 2ᵏ the series starts anew; the two sides may each be off by 1e-10.
  for (int k = 0; k < 53; ++k) {
    const double seam = std::ldexp(std::sqrt(0.5), -k);
    EXPECT_NEAR(minus_log(std::nextafter(seam, 0)), minus_log(std::nextafter(seam, 1)), 2e-10 * minus_log(seam)) << k;
  }
}

}  // namespace
}  // namespace woodcock
