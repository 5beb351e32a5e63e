// Geometry of one bilinear patch that sampling needs.
#pragma once

#include <array>

#include "renderer/core/vec.h"

namespace woodcock {

/// In the order (u,v) = 00, 10, 01, 11.
using PatchCorners = std::array<DVec3, 4>;

inline DVec3 patch_point(const PatchCorners& c, DVec2 uv) {
  return (1 - uv.y) * ((1 - uv.x) * c[0] + uv.x * c[1]) + uv.y * ((1 - uv.x) * c[2] + uv.x * c[3]);
}
inline DVec3 patch_dpdu(const PatchCorners& c, double v) { return (1 - v) * (c[1] - c[0]) + v * (c[3] - c[2]); }
inline DVec3 patch_dpdv(const PatchCorners& c, double u) { return (1 - u) * (c[2] - c[0]) + u * (c[3] - c[1]); }
/// dpdu × dpdv: its length is the area per unit of (u,v).
inline DVec3 patch_normal(const PatchCorners& c, DVec2 uv) { return glm::cross(patch_dpdu(c, uv.y), patch_dpdv(c, uv.x)); }

/// True where the patch is a flat convex quadrilateral, to within the rounding of its corners.
bool is_flat_and_convex(const PatchCorners& c);
/// ∫|dpdu × dpdv| du dv, by 16 × 16 Gauss-Legendre points.
double patch_area(const PatchCorners& c);
/// The (u,v) in [0,1]² whose point is closest to `p`; `p` is known to lie on the patch up to rounding.
DVec2 invert_patch(const PatchCorners& c, DVec3 p);
/// The pdf per solid angle at `ref` of the point `p` = patch_point(uv) when (u,v) is uniform.
double patch_uv_pdf(const PatchCorners& c, DVec2 uv, DVec3 ref, DVec3 p);

}  // namespace woodcock
