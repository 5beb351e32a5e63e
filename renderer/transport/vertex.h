// What the vertices of all estimators' paths have in common.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "renderer/core/frame.h"
#include "renderer/world/coincident_hits.h"
#include "renderer/world/world.h"

namespace woodcock {

/// A frame around ns whose first axis follows ∂p/∂u, for anisotropic roughness.
inline Frame shading_frame(Vec3 ns, Vec3 dpdu) {
  const Vec3 s = dpdu - ns * glm::dot(ns, dpdu);
  const float length2 = length_squared(s);
  if (!(length2 > 1e-12f * length_squared(dpdu))) return Frame::from_normal(ns);
  const Vec3 unit = s / std::sqrt(length2);
  return {unit, glm::cross(ns, unit), ns};
}

/// The point at distance t of a ray, on the near side of the hit that ends its segment, if one does: rounding may put a point next to a
/// boundary on it or beyond, and a path that went on from there would take the medium to have no end. `may_touch`: other surfaces may
/// coincide with the one hit.
inline DVec3 point_before(const World& world, const Ray& ray, double t, const std::optional<Hit>& hit, bool may_touch = true) {
  const DVec3 p = ray.at(t);
  if (!hit) return p;
  constexpr double kNear = 1e-6;  // farther away rounding matters only to rays that graze at less than 1e-6
  if (hit->t - t > kNear * (std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) + hit->t)) return p;
  const SurfacePoint s = world.geometry.surface(*hit, ray, Geometry::Tangents::kNotWanted);
  const DVec3 n(s.ng), towards_us = glm::dot(ray.d, n) < 0 ? n : -n;
  // What coincides with it may lie a little before it.
  if (may_touch && may_coincide(world, ray, *hit, s.p)) return CoincidentHits(world, ray, *hit).origin(p, -ray.d);
  if (glm::dot(p - s.p, towards_us) > 2 * s.error) return p;
  return offset_origin(s, -ray.d);
}

}  // namespace woodcock
