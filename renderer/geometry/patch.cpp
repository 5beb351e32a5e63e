#include "renderer/geometry/patch.h"

#include <algorithm>
#include <cmath>

namespace woodcock {
namespace {

/// Neighbours compute their common edge each in its own way. Where both find the ray beyond it by a rounding it must not
/// slip through; where both take it, it meets the surface all the same.
constexpr double kSlack = 0x1p-40;

}  // namespace

std::optional<PrimitiveHit> intersect_triangle(DVec3 p0, DVec3 p1, DVec3 p2, DVec3 o, DVec3 d, double t_min, double t_max) {
  auto hit = intersect_triangle_plane(p0, p1, p2, o, d);
  if (!hit || !(hit->t > t_min && hit->t < t_max)) return std::nullopt;
  const DVec2 uv = hit->uv;
  if (!(uv.x >= -kSlack && uv.y >= -kSlack && uv.x + uv.y <= 1 + kSlack)) return std::nullopt;
  hit->uv.x = std::clamp(uv.x, 0.0, 1.0);
  hit->uv.y = std::clamp(uv.y, 0.0, 1.0 - hit->uv.x);
  return hit;
}

std::optional<PrimitiveHit> intersect_patch(const PatchCorners& p, DVec3 o, DVec3 d, double t_min, double t_max) {
  // The line v ↦ P(u, v) meets the ray where a·u² + b·u + c = 0.
  const double a = glm::dot(glm::cross(p[1] - p[0], p[2] - p[3]), d);
  const double c = glm::dot(glm::cross(p[0] - o, d), p[2] - p[0]);
  const double b = glm::dot(glm::cross(p[1] - o, d), p[3] - p[1]) - (a + c);
  std::array<double, 2> roots{-1, -1};
  if (std::abs(a) <= 1e-14 * (std::abs(b) + std::abs(c))) {
    if (b == 0) return std::nullopt;
    roots[0] = -c / b;
  } else {
    const double discriminant = b * b - 4 * a * c;
    if (discriminant < 0) return std::nullopt;
    const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
    roots[0] = q / a;
    if (q != 0) roots[1] = c / q;
  }
  // A ray that starts on the patch meets it again at a t that is zero but for the rounding of u: a few units in
  // the last place of the patch as seen from the origin. Nothing in float coordinates lies that close on purpose.
  double extent = 0;
  for (const DVec3& corner : p) extent = std::max(extent, glm::dot(corner - o, corner - o));
  const double rounding = 0x1p-46 * std::sqrt(extent / glm::dot(d, d));
  std::optional<PrimitiveHit> nearest;
  for (double u : roots) {
    if (!(u >= -kSlack && u <= 1 + kSlack)) continue;
    u = std::clamp(u, 0.0, 1.0);
    const DVec3 start = glm::mix(p[0], p[1], u);
    const DVec3 along = glm::mix(p[2], p[3], u) - start;
    const DVec3 to_start = start - o;
    const DVec3 perpendicular = glm::cross(d, along);
    const double length2 = glm::dot(perpendicular, perpendicular);
    if (length2 == 0) continue;
    const double v = glm::dot(glm::cross(to_start, d), perpendicular) / length2;
    const double t = glm::dot(glm::cross(to_start, along), perpendicular) / length2;
    if (!(v >= -kSlack && v <= 1 + kSlack && t > t_min && std::abs(t) > rounding && t < t_max)) continue;
    const PrimitiveHit hit{t, {u, std::clamp(v, 0.0, 1.0)}};
    const bool layers = nearest && std::abs(t - nearest->t) <= 4 * rounding;
    if (!nearest || (layers ? glm::dot(patch_normal(p, hit.uv), d) < 0 : t < nearest->t)) nearest = hit;
  }
  return nearest;
}

}  // namespace woodcock
