// Spheres, disks and cylinders: intersection and local geometry, in double.
#pragma once

#include <optional>

#include "renderer/geometry/shape.h"

namespace woodcock {

/// A parametric surface point in the quadric's object space.
struct ParametricPoint {
  DVec3 p, dpdu, dpdv;
  DVec2 uv;
};

/// The nearest t in (t_min, t_max) at which o + t·d (object space, d of any length) meets the quadric.
std::optional<double> intersect(const Quadric& q, DVec3 o, DVec3 d, double t_min, double t_max);

/// The surface at the object-space point `p`, which is first moved onto the quadric exactly.
ParametricPoint parametric_point(const Quadric& q, DVec3 p);

/// The direction (of any length) that is normal to the quadric at p, outwards and for a disk along +z.
inline DVec3 outward(const Quadric& q, DVec3 p) {
  if (q.kind == Quadric::Kind::kDisk) return {0, 0, 1};
  return q.kind == Quadric::Kind::kSphere ? p : DVec3(p.x, p.y, 0);
}

/// How far `p` on the quadric is from where the quadric ends, in object space; infinite for a full sphere.
double edge_distance(const Quadric& q, DVec3 p);

/// Object-space bounds.
void object_bounds(const Quadric& q, DVec3& lower, DVec3& upper);

}  // namespace woodcock
