// Warps from the unit square, each with its pdf beside it. Directions are unit vectors; pdfs are per solid
// angle (1/sr) for directions, per unit area of the target for points.
#pragma once

#include <algorithm>

#include "renderer/core/angle.h"
#include "renderer/core/vec.h"

namespace woodcock {

/// Uniform point on the unit disk (Shirley & Chiu 1997, concentric map). Which half of the square a point lies in is even chance, so
/// that the two cases are told apart without a branch.
inline Vec2 square_to_disk(Vec2 u) {
  const float x = 2 * u.x - 1, y = 2 * u.y - 1;
  const bool flat = std::abs(x) > std::abs(y);
  const float r = flat ? x : y, other = flat ? y : x;
  if (r == 0) return {0, 0};
  const Vec2 w = r * cos_sin_of_octant((kPi / 4) * (other / r));
  return {flat ? w.x : w.y, flat ? w.y : w.x};
}
inline float square_to_disk_pdf() { return kInvPi; }

/// Cosine-weighted direction on the hemisphere z ≥ 0 (Malley's method).
inline Vec3 square_to_cosine_hemisphere(Vec2 u) {
  const Vec2 d = square_to_disk(u);
  return {d.x, d.y, std::sqrt(std::max(0.0f, 1 - d.x * d.x - d.y * d.y))};
}
inline float square_to_cosine_hemisphere_pdf(Vec3 w) { return std::max(0.0f, w.z) * kInvPi; }

/// Uniform direction on the hemisphere z ≥ 0.
inline Vec3 square_to_hemisphere(Vec2 u) {
  const float z = u.x, r = std::sqrt(std::max(0.0f, (1 - z) * (1 + z))), phi = 2 * kPi * u.y;
  return {r * std::cos(phi), r * std::sin(phi), z};
}
inline float square_to_hemisphere_pdf() { return 0.5f * kInvPi; }

/// Uniform direction on the sphere.
inline Vec3 square_to_sphere(Vec2 u) {
  const float z = 1 - 2 * u.x, r = 2 * std::sqrt(u.x * (1 - u.x)), phi = 2 * kPi * u.y;
  return {r * std::cos(phi), r * std::sin(phi), z};
}
inline float square_to_sphere_pdf() { return 0.25f * kInvPi; }

/// Uniform point in a triangle as barycentric coordinates of its second and third vertex
/// (Heitz 2019, "A Low-Distortion Map Between Triangle and Square").
inline Vec2 square_to_triangle(Vec2 u) {
  if (u.x < u.y) return {u.x / 2, u.y - u.x / 2};
  return {u.x - u.y / 2, u.y / 2};
}

}  // namespace woodcock
