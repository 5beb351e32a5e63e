#include "renderer/geometry/geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/geometry/embree_scene.h"

namespace woodcock {
Geometry::~Geometry() = default;
Geometry::Geometry(Geometry&&) noexcept = default;
Geometry& Geometry::operator=(Geometry&&) noexcept = default;

std::optional<Hit> Geometry::intersect(const Ray& ray, double t_max) const {
  Query query(*impl_, ray, t_max);
  RTCRayHit r{};
  r.ray = embree_ray(query, -query.lead, t_max);
  // Each turn skips a candidate behind the origin; the bound only guards against a defect.
  for (int turn = 0; turn < 1000; ++turn) {
    const float t_far = r.ray.tfar;
    r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(impl_->scene, &query.context, &r);
    if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;

    const int instance = impl_->instance_of(r.hit.instID[0]);
    Hit hit{
        static_cast<double>(r.ray.tfar) - query.lead, {r.hit.u, r.hit.v}, impl_->shape_of(r.hit.geomID, instance), r.hit.primID, instance};
    DVec3 o = query.o, d = query.d;
    impl_->to_object(instance, o, d);
    if (const auto exact = impl_->intersect_primitive(hit.shape, hit.primitive, o, d, ray.skip, kInf)) {
      hit.t = exact->t;
      hit.uv = exact->uv;
      if (hit.t > ray.skip) impl_->keep_inside(hit, o, d);
    }
    if (hit.t > ray.skip) return hit.t < t_max ? std::optional(hit) : std::nullopt;
    r.ray.tnear = std::nextafter(std::max(r.ray.tfar, 0.0f), kInf);
    r.ray.tfar = t_far;
  }
  return std::nullopt;
}

bool Geometry::occluded(const Ray& ray, double t_max, TargetPrimitive target) const {
  Query query(*impl_, ray, t_max);
  query.target = target;
  RTCRay r = embree_ray(query, -query.lead, t_max);
  rtcOccluded1(impl_->scene, &query.context, &r);
  return r.tfar < 0;
}

bool Geometry::is_target(const Hit& hit, const Ray& ray, TargetPrimitive target) const {
  if (hit.shape != target.shape || hit.primitive != target.primitive) return false;
  if (impl_->is_flat(hit.shape)) return true;
  DVec3 o = ray.o, d = ray.d;
  impl_->to_object(hit.instance, o, d);
  return impl_->passes_along_normal(hit.shape, hit.primitive, o, d, {hit.t, hit.uv}) == target.along;
}

bool Geometry::Impl::is_flat(int shape) const {
  const auto& geometry = shapes[shape].geometry;
  if (const auto* quadric = std::get_if<Quadric>(&geometry)) return quadric->kind == Quadric::Kind::kDisk;
  const auto* patches = std::get_if<PatchMesh>(&geometry);
  return patches == nullptr || parallelograms[shape];
}

bool Geometry::Impl::passes_along_normal(int shape, uint32_t primitive, DVec3 o, DVec3 d, const PrimitiveHit& hit) const {
  const auto& geometry = shapes[shape].geometry;
  if (const auto* q = std::get_if<Quadric>(&geometry)) {
    const DVec3 d_object = transform_vector(q->object_from_render, d);
    return glm::dot(outward(*q, transform_point(q->object_from_render, o) + hit.t * d_object), d_object) > 0;
  }
  const auto c = corners(std::get<PatchMesh>(geometry), primitive);
  return glm::dot(patch_normal(c, hit.uv), d) > 0;
}

bool Geometry::Impl::hides_itself(TargetPrimitive target, DVec3 o, DVec3 d, double skip) const {
  if (is_flat(target.shape)) return false;
  // Of the two points at which the ray may meet it the nearer one is met first; it is either the sampled one or in its way.
  const auto first = intersect_primitive(target.shape, target.primitive, o, d, skip, std::numeric_limits<double>::infinity());
  return first && passes_along_normal(target.shape, target.primitive, o, d, *first) != target.along;
}

std::string Geometry::library_version() {
  const auto version = rtcGetDeviceProperty(embree_device(), RTC_DEVICE_PROPERTY_VERSION);
  return std::to_string(version / 10000) + "." + std::to_string(version / 100 % 100) + "." + std::to_string(version % 100);
}

const std::vector<Shape>& Geometry::shapes() const { return impl_->shapes; }

Box3 Geometry::bounds() const { return impl_->bounds; }

std::vector<PlacedShape> Geometry::placed_shapes() const {
  std::vector<PlacedShape> placed;
  for (int i = 0; i < impl_->top_level; ++i) placed.push_back({i, bounds_of(impl_->shapes[static_cast<size_t>(i)])});
  for (const Instance& instance : impl_->instances) {
    const Object& object = impl_->objects[static_cast<size_t>(instance.object)];
    for (int i = object.first_shape; i < object.first_shape + object.shape_count; ++i) {
      const Box3 box = bounds_of(impl_->shapes[static_cast<size_t>(i)]);
      Box3 around;
      for (int corner = 0; corner < 8 && !box.empty(); ++corner) {
        const DVec3 p((corner & 1) != 0 ? box.upper.x : box.lower.x, (corner & 2) != 0 ? box.upper.y : box.lower.y,
                      (corner & 4) != 0 ? box.upper.z : box.lower.z);
        around.add(Vec3(transform_point(instance.render_from_object, p)));
      }
      placed.push_back({i, around});
    }
  }
  return placed;
}

Box3 bounds_of(const Shape& shape) {
  Box3 box;
  if (const auto* mesh = std::get_if<Mesh>(&shape.geometry)) {
    for (const DVec3 p : mesh->positions) box.add(Vec3(p));
  } else if (const auto* patches = std::get_if<PatchMesh>(&shape.geometry)) {
    for (const DVec3 p : patches->positions) box.add(Vec3(p));
  } else {
    const auto& q = std::get<Quadric>(shape.geometry);
    DVec3 lower, upper;
    object_bounds(q, lower, upper);
    for (int i = 0; i < 8; ++i) {
      const DVec3 corner((i & 1) != 0 ? upper.x : lower.x, (i & 2) != 0 ? upper.y : lower.y, (i & 4) != 0 ? upper.z : lower.z);
      const DVec3 p = transform_point(q.render_from_object, corner);
      // Rounded outwards, so that the double intersection lies within.
      box.add(Vec3(p - 4.0 * float_rounding_error(p)));
      box.add(Vec3(p + 4.0 * float_rounding_error(p)));
    }
  }
  return box;
}

}  // namespace woodcock
