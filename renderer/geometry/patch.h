// Bilinear patches and triangles: exact (double) intersection of one primitive.
#pragma once

#include <array>
#include <optional>

#include "renderer/core/vec.h"

namespace woodcock {

struct PrimitiveHit {
  double t;
  DVec2 uv;
};

/// Where o + t·d meets the plane of the triangle, with barycentric coordinates of p1 and p2 (not clipped to
/// the triangle: that the ray hits it is the caller's knowledge). nullopt where the ray lies in the plane.
/// Möller & Trumbore 1997, in double.
inline std::optional<PrimitiveHit> intersect_triangle_plane(DVec3 p0, DVec3 p1, DVec3 p2, DVec3 o, DVec3 d) {
  const DVec3 e1 = p1 - p0, e2 = p2 - p0;
  const DVec3 p = glm::cross(d, e2);
  const double det = glm::dot(e1, p);
  if (det == 0) return std::nullopt;
  const DVec3 s = o - p0, q = glm::cross(s, e1);
  return PrimitiveHit{glm::dot(e2, q) / det, {glm::dot(s, p) / det, glm::dot(d, q) / det}};
}

/// The hit of the triangle itself with t in (t_min, t_max).
std::optional<PrimitiveHit> intersect_triangle(DVec3 p0, DVec3 p1, DVec3 p2, DVec3 o, DVec3 d, double t_min, double t_max);

/// The corners of a bilinear patch in the order (u,v) = 00, 10, 01, 11.
using PatchCorners = std::array<DVec3, 4>;

inline DVec3 patch_point(const PatchCorners& c, DVec2 uv) {
  return (1 - uv.y) * ((1 - uv.x) * c[0] + uv.x * c[1]) + uv.y * ((1 - uv.x) * c[2] + uv.x * c[3]);
}
inline DVec3 patch_dpdu(const PatchCorners& c, double v) { return (1 - v) * (c[1] - c[0]) + v * (c[3] - c[2]); }
inline DVec3 patch_dpdv(const PatchCorners& c, double u) { return (1 - u) * (c[2] - c[0]) + u * (c[3] - c[1]); }
/// dpdu × dpdv: its length is the area per unit of (u,v).
inline DVec3 patch_normal(const PatchCorners& c, DVec2 uv) { return glm::cross(patch_dpdu(c, uv.y), patch_dpdv(c, uv.x)); }

/// Whether the patch is a parallelogram to the last bit: then (u,v) are affine coordinates of its plane.
inline bool is_parallelogram(const PatchCorners& p) { return p[1] - p[0] == p[3] - p[2] && p[2] - p[0] == p[3] - p[1]; }

/// The nearest hit with t in (t_min, t_max) (Reshetov 2019, "Cool Patches"). Where the patch is folded flat and two of its layers
/// lie at one place, the one whose normal faces the ray is met.
std::optional<PrimitiveHit> intersect_patch(const PatchCorners& p, DVec3 o, DVec3 d, double t_min, double t_max);

}  // namespace woodcock
