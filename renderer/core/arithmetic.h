// What the renderer expects of floating-point arithmetic, asked of the compiled code itself.
#pragma once

#include <limits>

namespace woodcock {

/// Why results of this translation unit could not be trusted, or nullptr: flags like -ffast-math let the compiler take NaN
/// for impossible (so that a sample that is none is no longer found), fuse products into sums (so that bits depend on how
/// a function was inlined) and reorder sums; a caller may have changed the rounding mode. Operands are volatile, so that
/// the question is answered by the program and not by the compiler's own arithmetic.
inline const char* arithmetic_fault() {
  volatile float zero = 0, one = 1;
  const float nan = zero / zero, infinity = one / zero;
  if (nan == nan || !(nan != nan)) return "NaN is not recognised";
  if (infinity - infinity == 0 || !(infinity > std::numeric_limits<float>::max())) return "infinities are not recognised";
  // (1 + e)² = 1 + 2e + e² in exact arithmetic; the product is rounded to 1 + 2e before the sum unless it is fused with it.
  volatile double e = 0x1p-30;
  const double factor = 1 + e, rest = factor * factor - (1 + 2 * e);
  if (rest != 0) return "products are fused into sums";
  volatile double volatile_large = 1e30, volatile_small = 1;
  const double large = volatile_large, small = volatile_small;
  if ((large + small) - large != 0) return "sums are reordered";
  volatile float three = 3;
  if (one / three != 0x1.555556p-2f || -one / three != -0x1.555556p-2f) return "results are not rounded to the nearest";
  return nullptr;
}

}  // namespace woodcock
