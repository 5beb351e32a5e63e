// The inside of Geometry: Embree's scene, the double-precision check of its candidates, and what a query carries
// to both. Included by the files of this folder only.
#pragma once

#include <embree3/rtcore.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>
#include <utility>

#include "renderer/core/transform.h"
#include "renderer/geometry/geometry.h"
#include "renderer/geometry/patch.h"
#include "renderer/geometry/quadric.h"

namespace woodcock {

/// One Embree device for the process.
RTCDevice embree_device();

/// Distances of two surfaces from each other, in units of their error bounds, up to which they count as coincident: as far as
/// the origin of a ray may lie from the surface that it leaves (CoincidentHits::origin), and no more, since what a medium does between
/// coincident surfaces is lost.
inline constexpr double kCoincidence = 4;
/// Embree misjudges by how much a ray misses an edge by less than this part of the distance: some units in the last place.
inline constexpr double kEmbreeError = 0x1p-20;

/// A lamp no wider than this part of the scene is met in double: Embree's rays and vertices, in float, are off by some 2⁻²³ of the scene,
/// and light that passes by the edges of a near wall by a thousandth of its width counts where the wall is all that keeps it in.
inline constexpr double kSmallLamp = 0x1p-12;

/// Half a unit in the last place of each coordinate of a float, and a little.
inline DVec3 float_rounding_error(DVec3 p) { return glm::abs(p) * 0x1.1p-24; }

struct Geometry::Impl {
  std::vector<Shape> shapes;
  int top_level = 0;
  std::vector<Object> objects;
  std::vector<Instance> instances;
  std::vector<DMat4> object_from_render;  ///< per instance
  std::vector<RTCScene> object_scenes;
  RTCScene scene = nullptr;
  Box3 bounds;                       ///< of everything, in render space
  std::vector<char> in_double;       ///< per shape: a small lamp, of which Embree gets the boxes only
  std::vector<char> parallelograms;  ///< per shape: patches, all of them parallelograms, and Embree's
  double largest = 0;                ///< absolute coordinate of the bounds
  double lead = 0;                   ///< Embree's rays start this far before ours

  /// What Embree's callbacks get for one geometry.
  struct ShapeUser {
    const Impl* impl;
    int shape;
  };
  std::vector<ShapeUser> users;

  ~Impl() {
    if (scene != nullptr) rtcReleaseScene(scene);
    for (RTCScene s : object_scenes) {
      if (s != nullptr) rtcReleaseScene(s);
    }
  }

  /// The instance that Embree's identifier names, -1 at top level.
  int instance_of(unsigned inst_id) const { return inst_id == RTC_INVALID_GEOMETRY_ID ? -1 : static_cast<int>(inst_id) - top_level; }
  /// The shape that Embree's identifiers name.
  int shape_of(unsigned geom_id, int instance) const {
    return (instance < 0 ? 0 : objects[instances[instance].object].first_shape) + static_cast<int>(geom_id);
  }

  void to_object(int instance, DVec3& o, DVec3& d) const {
    if (instance < 0) return;
    o = transform_point(object_from_render[instance], o);
    d = transform_vector(object_from_render[instance], d);
  }

  /// The exact hit, o and d in the space of the shape. Triangles and parallelograms that Embree met are taken to be hit and are not
  /// clipped to t_min < t < t_max; of all else it is the nearest hit there.
  std::optional<PrimitiveHit> intersect_primitive(int shape, uint32_t primitive, DVec3 o, DVec3 d, double t_min, double t_max) const {
    const auto& geometry = shapes[shape].geometry;
    if (const auto* mesh = std::get_if<Mesh>(&geometry)) {
      const auto& t = mesh->triangles[primitive];
      const DVec3 p0 = mesh->positions[t[0]], p1 = mesh->positions[t[1]], p2 = mesh->positions[t[2]];
      if (in_double[static_cast<size_t>(shape)] != 0) return intersect_triangle(p0, p1, p2, o, d, t_min, t_max);
      return intersect_triangle_plane(p0, p1, p2, o, d);
    }
    if (const auto* patches = std::get_if<PatchMesh>(&geometry); patches != nullptr && parallelograms[shape]) {
      const auto& p = patches->patches[primitive];
      return intersect_triangle_plane(patches->positions[p[0]], patches->positions[p[1]], patches->positions[p[2]], o, d);
    }
    if (const auto* patches = std::get_if<PatchMesh>(&geometry)) return intersect_patch(corners(*patches, primitive), o, d, t_min, t_max);
    const auto& q = std::get<Quadric>(geometry);
    const auto t =
        woodcock::intersect(q, transform_point(q.object_from_render, o), transform_vector(q.object_from_render, d), t_min, t_max);
    if (!t) return std::nullopt;
    return PrimitiveHit{*t, {0, 0}};
  }

  /// Embree decided that a triangle or parallelogram is hit; rounding must not put the point outside of it, least of all by the large
  /// distances along which a ray and a plane that it grazes cannot be told apart. o and d in the space of the shape.
  void keep_inside(Hit& hit, DVec3 o, DVec3 d) const {
    const auto* mesh = std::get_if<Mesh>(&shapes[hit.shape].geometry);
    if (mesh == nullptr && !parallelograms[hit.shape]) return;
    const DVec2 before = hit.uv;
    hit.uv.x = std::clamp(before.x, 0.0, 1.0);
    hit.uv.y = std::clamp(before.y, 0.0, mesh != nullptr ? 1.0 - hit.uv.x : 1.0);
    if (hit.uv == before) return;
    DVec3 p;
    if (mesh != nullptr) {
      const auto& t = mesh->triangles[hit.primitive];
      const DVec3 p0 = mesh->positions[t[0]];
      p = p0 + hit.uv.x * (mesh->positions[t[1]] - p0) + hit.uv.y * (mesh->positions[t[2]] - p0);
    } else {
      const auto c = corners(std::get<PatchMesh>(shapes[hit.shape].geometry), hit.primitive);
      p = c[0] + hit.uv.x * (c[1] - c[0]) + hit.uv.y * (c[2] - c[0]);
    }
    hit.t = glm::dot(p - o, d) / glm::dot(d, d);
  }

  static std::array<DVec3, 4> corners(const PatchMesh& m, uint32_t primitive) {
    const auto& p = m.patches[primitive];
    return {m.positions[p[0]], m.positions[p[1]], m.positions[p[2]], m.positions[p[3]]};
  }

  /// How well the place of a hit is known; o and d in render space.
  ErrorBound error_bound(const Hit& hit, DVec3 o, DVec3 d) const;

  /// A ray meets a primitive of the shape once at the most.
  bool is_flat(int shape) const;
  /// Whether a ray along d, in the space of the shape, that meets the primitive at `t`, `uv` leaves towards the side of its own normal.
  bool passes_along_normal(int shape, uint32_t primitive, DVec3 o, DVec3 d, const PrimitiveHit& hit) const;
  /// Whether something of the target lies before the sampled point, o and d in the space of the shape.
  bool hides_itself(TargetPrimitive target, DVec3 o, DVec3 d, double skip) const;

  /// Whether Embree itself finds the primitives of a shape; else it gets their boxes.
  bool is_embrees(int shape) const {
    const auto i = static_cast<size_t>(shape);
    return std::holds_alternative<Mesh>(shapes[i].geometry) ? in_double[i] == 0 : parallelograms[i] != 0;
  }
  RTCGeometry make_geometry(int shape);
  RTCScene make_scene(int first, int count);
};

/// What a query carries beside Embree's copy of the ray.
struct Query {
  RTCIntersectContext context;  ///< first, so that Embree's pointer to it is a pointer to the query
  const Geometry::Impl* impl;
  DVec3 o, d;
  double skip = 0, t_max = 0;
  double lead = 0;  ///< Embree's distances are larger than ours by this
  TargetPrimitive target;
  /// Embree's error of a distance along the normal of a triangle is below this: some units in the last place of the
  /// largest coordinate.
  float near = 0;
  /// Set by Geometry::coincident: every candidate is offered to it and none stops the query.
  struct Gathering* gathering = nullptr;

  Query(const Geometry::Impl& geometry, const Ray& ray, double limit)
      : impl(&geometry),
        o(ray.o),
        d(ray.d),
        skip(ray.skip),
        t_max(limit),
        lead(geometry.lead),
        near(static_cast<float>(0x1p-19 * geometry.largest)) {
    rtcInitIntersectContext(&context);
  }
  static Query& of(RTCIntersectContext* context) { return *reinterpret_cast<Query*>(context); }

  bool is_target(int shape, uint32_t primitive) const { return shape == target.shape && primitive == target.primitive; }
};

/// The next float above x, as std::nextafter; without its call for what every ray has.
inline float next_above(float x) {
  return x > 0 && x < kInf ? std::bit_cast<float>(std::bit_cast<uint32_t>(x) + 1) : std::nextafter(x, kInf);
}

/// Embree's ray for t0 < t < t1, a little wider.
inline RTCRay embree_ray(const Query& query, double t0, double t1) {
  const DVec3 o = query.o - query.lead * query.d;
  RTCRay r{};
  r.org_x = static_cast<float>(o.x);
  r.org_y = static_cast<float>(o.y);
  r.org_z = static_cast<float>(o.z);
  r.dir_x = static_cast<float>(query.d.x);
  r.dir_y = static_cast<float>(query.d.y);
  r.dir_z = static_cast<float>(query.d.z);
  r.tnear = std::max(0.0f, static_cast<float>(t0 + query.lead));
  r.tfar = next_above(static_cast<float>(t1 + query.lead));
  r.mask = 0xffffffffu;
  return r;
}

/// The search of Geometry::coincident.
struct Gathering {
  CoincidentHit at;
  double plane_t;  ///< where the ray meets the plane of `at`, which may be beside the primitive
  double t0, t1;   ///< nothing outside of it can coincide
  std::span<CoincidentHit> found;
  size_t count = 0;  ///< of all, those that found no room included

  /// How far along the ray something with that error may lie from `at` to coincide with it.
  double reach(const ErrorBound& other) const;
  void offer(const Query& query, int shape, uint32_t primitive, int instance);
};

}  // namespace woodcock
