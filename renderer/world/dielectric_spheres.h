// Spheres of smooth glass with something inside that scatters: light is sampled through their surface (transport/path_kernel_refraction.h).
#pragma once

#include <span>
#include <vector>

#include "renderer/geometry/geometry.h"
#include "renderer/geometry/refraction.h"
#include "renderer/media/medium.h"
#include "renderer/scene/description.h"

namespace woodcock {

struct SurfaceInfo;

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
/// one or emission, which hold a medium that scatters or other shapes; the smallest first. `shapes`, `surfaces`
/// and `instances` as in the world; `lamps` are the positions of bounded lights; objects[i].first_shape of the objects that are placed.
std::vector<DielectricSphere> find_dielectric_spheres(const SceneDescription& scene, const Geometry& geometry,
                                                      const std::vector<SurfaceInfo>& surfaces, const Media& media,
                                                      std::span<const DVec3> lamps, int top_level,
                                                      const std::vector<Geometry::Object>& objects,
                                                      const std::vector<Geometry::Instance>& instances);

}  // namespace woodcock
