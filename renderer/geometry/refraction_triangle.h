// Straight paths that one smooth boundary of triangles refracts: through a plane in closed bounds, and step by step where the normal is
// interpolated between vertices. Knows of no scene and no path.
#pragma once

#include <array>
#include <optional>

#include "renderer/geometry/refraction.h"

namespace woodcock {

/// The way from x over the plane through p0 with the unit normal n to y, x on the inner side and y on the outer one, to which n points;
/// there is one and no more (Fermat). Nothing where they lie otherwise. `eta` is the index on x's side over that on y's.
///
/// With h and h′ the distances of x and y from the plane and d between their feet, the angles i and t obey h tan i + h′ tan t = d and
/// η sin i = sin t. The larger of the two tangents, T, is the root of h_a T + h_b T/√(k² + (k² − 1) T²) = d with k = max(η, 1/η), whose
/// left side grows and is concave: Newton's steps from below never pass the root, and one from above leads below it.
///
/// The solid angle follows from dω = sin i di dφ and dA = d dφ d(d) cos t.
/// `larger_sine` is where the search begins, the larger of sin i and sin t of a way near by if one is known.
std::optional<RefractedWay> way_through_plane(DVec3 p0, DVec3 n, double eta, DVec3 x, DVec3 y, double larger_sine = 0);

/// A triangle p0 + b1 e1 + b2 e2 whose shading normal is the interpolated one, (1 − b1 − b2) N0 + b1 N1 + b2 N2 up to its length, on the
/// side of the unit normal `ng`.
struct ShadedTriangle {
  DVec3 p0, e1, e2, ng;
  std::array<DVec3, 3> normals;

  DVec3 at(DVec2 b) const { return p0 + b.x * e1 + b.y * e2; }
  DVec3 normal_at(DVec2 b) const { return glm::normalize((1 - b.x - b.y) * normals[0] + b.x * normals[1] + b.y * normals[2]); }
};

/// A point of a triangle as part of a way x → v → y: how far it is from Snell's law there, and where Newton's method looks next.
struct RefractionStep {
  double error = 0;      ///< |η wi − wo| along the surface: sines
  DVec2 step{0};         ///< in barycentric coordinates
  RefractedWay way;      ///< as if it obeyed the law; the solid angle by the implicit function theorem
  bool crosses = false;  ///< the way passes the surface from inside to outside, by its own normal and by the shading normal
};

/// The constraint is η wi − wo ∥ n (Walter et al. 2009; Jakob & Marschner 2012): C_k = e_k·h − (e_k·n)(n·h) = 0 for h = η wi − wo. With
/// ∂C/∂b and, for y moved at right angles to wo, ∂C/∂y: db/dy = −(∂C/∂b)⁻¹ ∂C/∂y, so that
///   dω/dA = |wi·ng| |e1 × e2| |det ∂C/∂y| / (|det ∂C/∂b| |v − x|²).
RefractionStep refraction_step(const ShadedTriangle& triangle, DVec2 b, double eta, DVec3 x, DVec3 y);

}  // namespace woodcock
