// Spheres of smooth glass with something inside that scatters: light is sampled through their surface (transport/path_kernel_refraction.h).
#pragma once

#include <vector>

#include "renderer/geometry/geometry.h"
#include "renderer/geometry/refraction.h"
#include "renderer/scene/description.h"

namespace woodcock {

struct GlassScene;

/// Where a sphere of smooth glass stands in render space.
struct DielectricSphere {
  Sphere sphere;
  int shape = kNone;
  float eta = 1;         ///< index inside over that outside
  bool flip = false;     ///< the shape's normal points inwards
  bool is_empty = true;  ///< nothing but a medium is inside

  /// Whether the point is inside by more than the rounding that `is_empty` allows for.
  bool holds(DVec3 p) const {
    const double r = sphere.radius * (1 - 2e-6);
    return length_squared(p - sphere.center) < r * r;
  }
};

/// More than this many are left to chance, since each scattering looks at all.
inline constexpr size_t kMaxDielectricSpheres = 32;

/// The full spheres, scaled uniformly, whose material is a dielectric of index other than one without roughness, normal map, opacity below
/// one or emission, which hold a medium that scatters or other shapes; the smallest first.
std::vector<DielectricSphere> find_dielectric_spheres(const GlassScene& glass);

}  // namespace woodcock
