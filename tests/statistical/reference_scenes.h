// Reference cases as scene texts in pbrt-v4 format.
//
// How each is set up, so that nothing but noise and rounding separates the picture from the exact value:
//
// * Every scene is seen by a parallel camera through a window so small that the value is the same in all pixels
//   (the furnaces, where it is the same anyway, are seen whole). So pixels are independent repetitions.
// * A slab is a box 800 mean free paths wide. Light that reaches its sides has crossed 400 mean free paths inside;
//   the slowest decay in the list (P05, diffusion length 17.5 mean free paths) leaves less than 1e-9 of it.
// * "An environment that fills one half space only" is a constant environment and a black shell, open on the lit
//   side, whose rim lies in the plane of that face of the slab. A ray leaving through the lit face moves away from
//   that plane and cannot meet the shell, whatever its angle; a ray leaving through the other face cannot miss it.
//   So there is no error at the horizon, which a finite black plane would have.
// * A constant grid reaches one voxel beyond the boundary on every side, since it fades in its outer half voxel.
#pragma once

#include <string>
#include <vector>

#include "tests/statistical/reference_cases.h"

namespace woodcock::reference {

/// How a medium is stated: both must give the same radiance.
enum class Container { kHomogeneous, kGrid };

struct Scene {
  std::string name;  ///< "P01.R.homogeneous": names the test and seeds it
  std::string text;
  double expected = 0;
  double uncertainty = 0;     ///< of the reference value, absolute
  double discretisation = 0;  ///< bound on what a sampled grid adds, absolute
};

/// The scenes of one case: one for each of its values and each container it can be stated in.
std::vector<Scene> scenes_of(const Case& c);

/// P07: the transmittance through the profile ρ0·exp(−z/h) as the grid interpolates it, exactly integrated.
double interpolated_profile_transmittance(const Case& c);
/// P08: the transmittance through the Gaussian blob as the grid interpolates it, exactly integrated.
double interpolated_blob_transmittance(const Case& c);

}  // namespace woodcock::reference
