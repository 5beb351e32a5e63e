// The equal-area octahedral map between the unit square and the sphere (Clarberg 2008, "Fast Equal-Area Mapping of
// the (Hemi)Sphere using SIMD"). +z lies at the centre of the square, −z in its corners; a region of the square of
// area A covers the solid angle 4πA.
#pragma once

#include "renderer/core/vec.h"

namespace woodcock {

/// p in [0,1]²; returns a unit direction.
DVec3 octahedral_to_sphere(DVec2 p);
/// The inverse: `direction` is unit, the result lies in [0,1]².
DVec2 sphere_to_octahedral(DVec3 direction);

}  // namespace woodcock
