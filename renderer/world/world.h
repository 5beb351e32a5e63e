// The compiled scene: immutable, shareable between threads, in render space.
//
// Render space is scale · (world − center): the centre lies near the camera, rounded to a coarse grid of powers of
// two so that the frames of a moving camera share it, and the scale is a power of two that brings the scene to about
// unit size. A scene moved by 1e5 or scaled by 1e5 renders as well as one at the origin.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "renderer/core/distribution.h"
#include "renderer/geometry/geometry.h"
#include "renderer/lights/light.h"
#include "renderer/materials/material.h"
#include "renderer/media/medium.h"
#include "renderer/scene/description.h"
#include "renderer/textures/texture.h"
#include "renderer/world/camera.h"
#include "renderer/world/dielectric_meshes.h"
#include "renderer/world/dielectric_spheres.h"
#include "renderer/world/filter.h"

namespace woodcock {

/// What the path loop asks of a shape beyond its geometry; parallel to Geometry::shapes().
struct SurfaceInfo {
  int material = kNone;
  FloatParameter alpha{1, kNone};
  bool has_alpha = false;  ///< alpha may be below one: a ray that misses it meets nothing, not even a boundary
  int light = kNone;
  bool is_boundary = false;  ///< has a MediumInterface of its own
  int inside = kNone, outside = kNone;
  bool is_interface = false;            ///< no surface at all, only a boundary
  bool is_opaque = true;                ///< the material lets nothing through
  bool transparent_to_shadows = false;  ///< an interface, a mix, or alpha below one: shadow rays may go on
  std::vector<Box3> overlaps;           ///< boxes in render space outside of which nothing coincides with this surface
  bool edges_touch = false;             ///< a mesh whose triangles coincide at its own edges, and nowhere else
  int stacking = 0;  ///< the order of surfaces that nothing else puts in order (coincident_hits.h): lights, opaque ones, others

  /// Something may coincide with it somewhere.
  bool may_overlap() const { return edges_touch || !overlaps.empty(); }
  /// No ray ever meets it.
  bool is_absent() const { return alpha.texture == kNone && alpha.value <= 0; }
};

struct RenderSpace {
  DVec3 center{0};
  double scale = 1;
  DMat4 render_from_world{1}, world_from_render{1};
};

/// Chooses render space for a scene.
RenderSpace choose_render_space(const SceneDescription& scene);

struct World {
  RenderSpace space;
  Geometry geometry;
  Textures textures;
  Materials materials;
  Media media;
  Lights lights;
  Camera camera;
  PixelFilter filter;
  std::vector<SurfaceInfo> surfaces;
  int camera_medium = kNone;
  std::optional<int> medium_around;  ///< where rays leave the scene, if that is the same everywhere
  /// Some shadow ray may have to go on behind a surface (interfaces, partial opacity).
  bool has_transparent_surfaces = false;
  /// The Effect bits (effects.h) that the scene calls for, by use.
  uint32_t effects = 0;
  /// Where the scene was read differently than written, for the user.
  std::vector<std::string> notes;

  /// The media whose emission is sampled as that of lights, and the choice between them by power.
  std::vector<int> emissive_media{};
  DiscreteDistribution emissive_choice{};
  /// A medium to sample; there must be one. u in [0, 1).
  int choose_emissive(double u) const { return emissive_media[emissive_choice.sample(u).index]; }
  /// The probability that `choose_emissive` gives this medium.
  float emissive_pmf(int medium) const {
    for (size_t i = 0; i < emissive_media.size(); ++i)
      if (emissive_media[i] == medium) return static_cast<float>(emissive_choice.probability(i));
    return 0;
  }

  /// The spheres through whose surface light is sampled, the smallest first.
  std::vector<DielectricSphere> dielectric_spheres{};
  /// The smallest of them around a point; null where there is none. Next to the surface, where rounding decides, there is none.
  const DielectricSphere* dielectric_around(DVec3 p) const {
    for (const DielectricSphere& body : dielectric_spheres) {
      const double r = body.sphere.radius * (1 - 1e-9);
      if (length_squared(p - body.sphere.center) < r * r) return &body;
    }
    return nullptr;
  }

  /// The meshes through whose triangles light is sampled.
  DielectricMeshes dielectric_meshes{};

  /// The medium behind a surface for a ray that leaves it in direction `w`.
  int medium_after(const SurfaceInfo& s, Vec3 ng, DVec3 w, int current) const {
    if (!s.is_boundary) return current;
    return glm::dot(w, DVec3(ng)) > 0 ? s.outside : s.inside;
  }
};

/// Compiles a description. Throws SceneError for what cannot be built.
std::unique_ptr<const World> build_world(const SceneDescription& scene);

}  // namespace woodcock
