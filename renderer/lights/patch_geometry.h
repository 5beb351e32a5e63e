// Geometry of one bilinear patch that sampling needs.
#pragma once

#include "renderer/geometry/patch.h"

namespace woodcock {

/// True where the patch is a flat convex quadrilateral, to within the rounding of its corners.
bool is_flat_and_convex(const PatchCorners& c);
/// ∫|dpdu × dpdv| du dv, by 16 × 16 Gauss-Legendre points.
double patch_area(const PatchCorners& c);
/// The (u,v) in [0,1]² whose point is closest to `p`; `p` is known to lie on the patch up to rounding.
DVec2 invert_patch(const PatchCorners& c, DVec3 p);
/// The pdf per solid angle at `ref` of the point `p` = patch_point(uv) when (u,v) is uniform.
double patch_uv_pdf(const PatchCorners& c, DVec2 uv, DVec3 ref, DVec3 p);

}  // namespace woodcock
