// Sampling one triangle from a reference point.
#pragma once

#include <array>
#include <optional>

#include "renderer/core/vec.h"

namespace woodcock {

struct TriangleSample {
  DVec2 barycentric;  ///< of the second and third corner
  double pdf;         ///< per solid angle at the reference point
};

/// A point on the triangle: uniform by area where every part of it is about equally far away, uniform by solid
/// angle where it looks large (Arvo 1995, "Stratified Sampling of Spherical Triangles"). Nothing where the
/// reference point lies in the triangle's plane.
std::optional<TriangleSample> sample_triangle(const std::array<DVec3, 3>& corner, DVec3 ref, DVec2 u);

/// The pdf with which `sample_triangle` gives the point `p` of the triangle, per solid angle; 0 where it gives none.
double triangle_pdf(const std::array<DVec3, 3>& corner, DVec3 ref, DVec3 p);

}  // namespace woodcock
