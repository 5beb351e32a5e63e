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

/// Whether the patch is a parallelogram to the last bit: then (u,v) are affine coordinates of its plane.
inline bool is_parallelogram(const std::array<DVec3, 4>& p) { return p[1] - p[0] == p[3] - p[2] && p[2] - p[0] == p[3] - p[1]; }

/// The nearest hit with t in (t_min, t_max) of the patch with corners (u,v) = 00, 10, 01, 11
/// (Reshetov 2019, "Cool Patches").
std::optional<PrimitiveHit> intersect_patch(const std::array<DVec3, 4>& p, DVec3 o, DVec3 d, double t_min, double t_max);

}  // namespace woodcock
