// What rounding may do to a path.
#pragma once

#include <algorithm>
#include <cmath>

#include "tests/transport/weights/complete_path.h"

namespace woodcock::testing {

/// What float32 makes of a position or direction of unit size, generously.
inline constexpr double kNudge = 2e-7;

inline double largest(DVec3 v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

/// The same path as it might have been rounded otherwise.
inline void nudge(int way, LastVertex& v, LightEnd& e) {
  const DVec3 signs[] = {{1, -1, 1}, {-1, -1, 1}, {1, 1, -1}, {-1, 1, 1}};
  const auto move = [&](DVec3& p, int k) { p += signs[(way + k) % 4] * (kNudge * std::max(1.0, largest(p))); };
  move(v.p, 0);
  move(v.o, 1);
  move(v.wo, 2);
  move(v.d, 3);
  move(v.z, 1);
  move(e.p, 2);
  move(e.wi, 3);
  v.t *= 1 + (way % 2 == 0 ? kNudge : -kNudge);
}

}  // namespace woodcock::testing
