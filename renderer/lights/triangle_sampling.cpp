#include "renderer/lights/triangle_sampling.h"

#include <algorithm>

namespace woodcock {
namespace {

struct View {
  std::array<DVec3, 3> to_corner;  // from the reference point
  double area_height;              // 2 · area · distance of the reference point from the plane
  double solid_angle;              // positive where the triangle is to be sampled by solid angle, else 0
};

/// Below this an area sample has smaller errors than the angles of the spherical triangle.
constexpr double kMinSolidAngle = 1e-6;
/// Edges shorter than this share of the distance leave a density by area within a factor of 2.5 of the best one at worst, and
/// cost no angles: in the Cornell box a fifth of the time for 0.03 % more variance (measured against 0.2).
constexpr double kSmallEdge = 0.35;

View look(const std::array<DVec3, 3>& corner, DVec3 ref) {
  View view;
  for (int i = 0; i < 3; ++i) view.to_corner[i] = corner[i] - ref;
  const DVec3 e1 = corner[1] - corner[0], e2 = corner[2] - corner[0], e3 = corner[2] - corner[1];
  view.area_height = std::abs(glm::dot(view.to_corner[0], glm::cross(e1, e2)));
  view.solid_angle = 0;
  const auto [a, b, c] = view.to_corner;
  const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
  const double longest = std::sqrt(std::max({glm::dot(e1, e1), glm::dot(e2, e2), glm::dot(e3, e3)}));
  if (longest > kSmallEdge * std::max({la, lb, lc})) {
    // Van Oosterom & Strackee 1983: tan(Ω/2) = a·(b × c) / (abc + (a·b)c + (b·c)a + (c·a)b).
    const double denominator = la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb;
    const double solid_angle = 2 * std::atan2(view.area_height, denominator);
    if (solid_angle > kMinSolidAngle) view.solid_angle = solid_angle;
  }
  return view;
}

/// Cosine and sine of the angle between two planes through the unit vector `at`, one through b and one through c.
DVec2 corner_angle(DVec3 at, DVec3 b, DVec3 c) {
  const DVec3 n = glm::cross(at, b), m = glm::cross(at, c);
  const DVec2 angle(glm::dot(n, m), glm::length(glm::cross(n, m)));
  const double length = glm::length(angle);
  return length > 0 ? angle / length : DVec2(1, 0);
}

/// v without its part along the unit vector `axis`, normalised.
DVec3 perpendicular(DVec3 v, DVec3 axis) {
  const DVec3 w = v - glm::dot(v, axis) * axis;
  const double length = glm::length(w);
  return length > 0 ? w / length : DVec3(0);
}

/// Arvo's map: a direction uniform over the spherical triangle.
DVec3 spherical_triangle_direction(const View& view, DVec2 u) {
  const DVec3 a = glm::normalize(view.to_corner[0]), b = glm::normalize(view.to_corner[1]), c = glm::normalize(view.to_corner[2]);
  const DVec2 alpha = corner_angle(a, b, c);
  const double cos_alpha = alpha.x, sin_alpha = alpha.y;
  // The sub-triangle a, b, c' of solid angle u.x · Ω: c' lies on the arc from a to c.
  const double part = u.x * view.solid_angle, sin_part = std::sin(part), cos_part = std::cos(part);
  const double s = sin_part * cos_alpha - cos_part * sin_alpha, t = cos_part * cos_alpha + sin_part * sin_alpha;
  const double x = t - cos_alpha, y = s + sin_alpha * glm::dot(a, b);
  const double denominator = (y * s + x * t) * sin_alpha;
  const double q = denominator != 0 ? std::clamp(((y * t - x * s) * cos_alpha - y) / denominator, -1.0, 1.0) : 1.0;
  const DVec3 c1 = q * a + std::sqrt((1 - q) * (1 + q)) * perpendicular(c, a);
  // A point on the arc from b to c', uniform in the cosine from b.
  const double z = 1 - u.y * (1 - glm::dot(c1, b));
  return z * b + std::sqrt(std::max(0.0, (1 - z) * (1 + z))) * perpendicular(c1, b);
}

}  // namespace

std::optional<TriangleSample> sample_triangle(const std::array<DVec3, 3>& corner, DVec3 ref, DVec2 u) {
  const View view = look(corner, ref);
  if (!(view.area_height > 0)) return std::nullopt;
  const DVec3 e1 = corner[1] - corner[0], e2 = corner[2] - corner[0];
  if (view.solid_angle > 0) {
    const DVec3 direction = spherical_triangle_direction(view, u);
    // Where the direction meets the plane, as barycentric coordinates (Möller & Trumbore 1997), kept inside.
    const DVec3 p = glm::cross(direction, e2);
    const double determinant = glm::dot(e1, p);
    if (determinant == 0) return std::nullopt;
    const DVec3 q = glm::cross(-view.to_corner[0], e1);
    DVec2 barycentric(std::clamp(glm::dot(-view.to_corner[0], p) / determinant, 0.0, 1.0),
                      std::clamp(glm::dot(direction, q) / determinant, 0.0, 1.0));
    if (barycentric.x + barycentric.y > 1) barycentric /= barycentric.x + barycentric.y;
    return TriangleSample{barycentric, 1 / view.solid_angle};
  }
  // Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
  const DVec2 barycentric = u.x < u.y ? DVec2(u.x / 2, u.y - u.x / 2) : DVec2(u.x - u.y / 2, u.y / 2);
  const double distance = glm::length(view.to_corner[0] + barycentric.x * e1 + barycentric.y * e2);
  return TriangleSample{barycentric, 2 * distance * distance * distance / view.area_height};
}

double triangle_pdf(const std::array<DVec3, 3>& corner, DVec3 ref, DVec3 p) {
  const View view = look(corner, ref);
  if (!(view.area_height > 0)) return 0;
  if (view.solid_angle > 0) return 1 / view.solid_angle;
  // d²/(A cos θ) with cos θ = h/d, which does not lose digits at grazing angles.
  const double distance = glm::distance(p, ref);
  return 2 * distance * distance * distance / view.area_height;
}

}  // namespace woodcock
