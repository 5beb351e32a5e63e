// Pieces of scene text that the reference scenes are put together from.
#pragma once

#include <functional>
#include <string>

#include "renderer/core/vec.h"

namespace woodcock::reference {

/// A parallel camera at `eye` that looks at `target`; its window reaches `half_width` to each side of the axis.
/// Box filter, 16 × 16 pixels, no depth limit that matters unless `max_depth` says so.
std::string camera(DVec3 eye, DVec3 target, double half_width, int max_depth = 1000000);

/// A box as a mesh of 12 triangles with outward normals.
std::string box(DVec3 lower, DVec3 upper);

/// The box from `open.z` to `closed_z` without its face at `open_z`, `half_width` to each side in x and y, black.
std::string black_shell(double half_width, double open_z, double closed_z);

struct MediumText {
  double sigma_a = 0, sigma_s = 0, g = 0, emission = 0;
};
/// MakeNamedMedium "m", homogeneous.
std::string homogeneous_medium(const MediumText& medium);
/// MakeNamedMedium "m", a grid of ones that is constant over lower..upper: it reaches one voxel farther.
std::string constant_grid_medium(const MediumText& medium, DVec3 lower, DVec3 upper);
/// MakeNamedMedium "m": a grid over p0..p1 whose voxel centres have density(p).
std::string grid_medium(const MediumText& medium, IVec3 size, DVec3 p0, DVec3 p1, const std::function<double(DVec3)>& density);

/// LightSource "infinite" of constant radiance; empty for 0.
std::string environment(double radiance);

}  // namespace woodcock::reference
