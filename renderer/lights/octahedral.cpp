#include "renderer/lights/octahedral.h"

#include <algorithm>
#include <numbers>
#include <utility>

namespace woodcock {

DVec3 octahedral_to_sphere(DVec2 p) {
  const double u = 2 * p.x - 1, v = 2 * p.y - 1;
  const double signed_distance = 1 - (std::abs(u) + std::abs(v));  // to the diamond that is the equator
  const double r = 1 - std::abs(signed_distance);
  const double phi = (r == 0 ? 1 : (std::abs(v) - std::abs(u)) / r + 1) * (std::numbers::pi / 4);
  const double sine = r * std::sqrt(2 - r * r);
  return {std::copysign(std::cos(phi), u) * sine, std::copysign(std::sin(phi), v) * sine, std::copysign(1 - r * r, signed_distance)};
}

DVec2 sphere_to_octahedral(DVec3 direction) {
  const double x = std::abs(direction.x), y = std::abs(direction.y), z = std::abs(direction.z);
  // √(1 − z), from x and y where 1 − z would cancel.
  const double r = std::sqrt((x * x + y * y) / (1 + z));
  const double phi = std::atan2(y, x) * (2 / std::numbers::pi);
  double v = phi * r, u = r - v;
  if (direction.z < 0) {
    // The southern hemisphere is folded outwards over the edges of the diamond.
    std::swap(u, v);
    u = 1 - u;
    v = 1 - v;
  }
  const auto to_unit = [](double c, double sign) { return std::clamp(0.5 * (std::copysign(c, sign) + 1), 0.0, 1.0); };
  return {to_unit(u, direction.x), to_unit(v, direction.y)};
}

}  // namespace woodcock
