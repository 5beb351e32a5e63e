// Ray casting: the only place that sees Embree.
//
// Embree says which primitive was hit; where it was hit is computed here, in double, from the primitive's own
// vertices. A candidate whose exact distance is not positive is Embree's rounding and is skipped, so that
// no ray meets the plane it starts from, however large its triangles are.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "renderer/geometry/hit.h"
#include "renderer/geometry/shape.h"

namespace woodcock {

/// The sampled point that a shadow ray aims at. A ray meets a flat primitive once, so any hit on the target is the point itself. It
/// meets a quadric or a curved patch at most twice, and passes the two points in opposite directions through the surface: `along` tells
/// which of the two was sampled.
struct TargetPrimitive {
  int shape = -1;
  uint32_t primitive = 0;
  bool along = false;  ///< the ray leaves towards the side of the shape's own normal (that of dpdu × dpdv, before any flip)
};

/// A shape where it stands in render space, by itself or in an instance.
struct PlacedShape {
  int shape = -1;
  Box3 bounds;
};

/// Shapes, instances and their acceleration structure: immutable and shareable once built.
class Geometry {
 public:
  /// A run of shapes that instances place together.
  struct Object {
    int first_shape = 0, shape_count = 0;
  };
  struct Instance {
    int object = 0;
    DMat4 render_from_object{1};
  };

  /// Where rays start. Embree computes distances in float, some of which have the wrong sign where a ray starts within
  /// a few units in the last place of a surface: one ray in fifty from there passes unseen through a tilted triangle.
  /// Harmless where nothing but surfaces is: rays start some units in the last place of a float off them (kOnSurfaces). Next to the
  /// boundary of a medium the path would take the medium to have no end, and such a distance may be many mean free paths. With
  /// kAnywhere Embree gets its rays from a little before their origin, what is met before the origin is skipped, and rays start as
  /// near to surfaces as double precision can tell.
  enum class Starts { kOnSurfaces, kAnywhere };

  /// Whether a hit's tangents matter: they do to normal maps and anisotropic roughness only.
  enum class Tangents { kWanted, kNotWanted };

  /// `shapes[0, top_level)` stand in the scene themselves, the others belong to objects.
  /// Throws std::runtime_error where Embree refuses (out of memory).
  Geometry(std::vector<Shape> shapes, int top_level, std::vector<Object> objects, std::vector<Instance> instances,
           Starts starts = Starts::kOnSurfaces);
  ~Geometry();
  Geometry(Geometry&&) noexcept;
  Geometry& operator=(Geometry&&) noexcept;

  /// The nearest hit with ray.skip < t < t_max (t in lengths of ray.d).
  std::optional<Hit> intersect(const Ray& ray, double t_max) const;

  /// All that the ray meets at the place where it met `hit` (a result of intersect), `hit` itself first: every hit whose
  /// order along the ray is not known for sure, since vertices were rounded to float, or since a ray that leaves one of the
  /// surfaces may start beyond the other. Hits whose exact
  /// distance is not beyond ray.skip are left out. Returns their number; those for which `found` has no room are counted only.
  /// Triangles that share an edge or vertex which the ray meets are all given.
  size_t coincident(const Ray& ray, const Hit& hit, std::span<CoincidentHit> found) const;

  /// Whether the ray met a triangle or patch so near to an edge that its neighbour may be met as well, or instead.
  bool is_at_edge(const Ray& ray, const Hit& hit) const;

  /// Whether anything lies at ray.skip < t < t_max, but for the point that `target` names.
  bool occluded(const Ray& ray, double t_max, TargetPrimitive target) const;

  /// Whether a hit of this ray is the point that `target` names.
  bool is_target(const Hit& hit, const Ray& ray, TargetPrimitive target) const;

  /// The local geometry at a hit that intersect() returned for this ray. dpdu and dpdv are left at zero unless asked for.
  SurfacePoint surface(const Hit& hit, const Ray& ray, Tangents tangents = Tangents::kWanted) const;

  /// The version of the ray-casting library that is loaded, e.g. "3.13.5".
  static std::string library_version();

  const std::vector<Shape>& shapes() const;
  /// Bounds of everything, empty for an empty scene.
  Box3 bounds() const;
  /// Every shape at top level and in every instance.
  std::vector<PlacedShape> placed_shapes() const;

  struct Impl;  // embree_scene.h

 private:
  std::unique_ptr<Impl> impl_;
};

/// Render-space bounds of a shape at top level; object-space bounds of one in an object.
Box3 bounds_of(const Shape& shape);

}  // namespace woodcock
