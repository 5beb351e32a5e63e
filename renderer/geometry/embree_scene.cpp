#include "renderer/geometry/embree_scene.h"

#include <cmath>
#include <limits>
#include <stdexcept>

namespace woodcock {
namespace {

void check_device(const char* what) {
  if (const RTCError error = rtcGetDeviceError(embree_device()); error != RTC_ERROR_NONE) {
    throw std::runtime_error(std::string("Embree failed while ") + what + " (error " + std::to_string(error) +
                             (error == RTC_ERROR_OUT_OF_MEMORY ? ": out of memory)" : ")"));
  }
}

/// A candidate that Embree offers to a filter.
struct Candidate {
  const Query& query;
  int shape, instance;
  uint32_t primitive;

  Candidate(const Query& of, const RTCFilterFunctionNArguments* args)
      : query(of),
        shape(static_cast<const Geometry::Impl::ShapeUser*>(args->geometryUserPtr)->shape),
        instance(of.impl->instance_of(RTCHitN_instID(args->hit, 1, 0, 0))),
        primitive(RTCHitN_primID(args->hit, 1, 0)) {}

  std::optional<PrimitiveHit> exact() const {
    DVec3 o = query.o, d = query.d;
    query.impl->to_object(instance, o, d);
    return query.impl->intersect_primitive(shape, primitive, o, d, query.skip, query.t_max);
  }
};

/// Whether Embree's own distances of a triangle or parallelogram say that it is met at skip < t < limit: their error along the normal is a
/// few units in the last place of the largest coordinate. Instances are another space, where that is not known.
bool is_certain(const Query& query, const RTCFilterFunctionNArguments* args, double limit) {
  if (RTCHitN_instID(args->hit, 1, 0, 0) != RTC_INVALID_GEOMETRY_ID) return false;
  const Vec3 n(RTCHitN_Ng_x(args->hit, 1, 0), RTCHitN_Ng_y(args->hit, 1, 0), RTCHitN_Ng_z(args->hit, 1, 0));
  const float t = RTCRayN_tfar(args->ray, 1, 0) - static_cast<float>(query.lead), across = std::abs(glm::dot(n, Vec3(query.d)));
  const float least = std::min(t - static_cast<float>(query.skip), static_cast<float>(limit) - t) * across;
  return least > 0 && least * least > query.near * query.near * length_squared(n);
}

template <typename Index>
RTCGeometry new_geometry(RTCGeometryType type, RTCFormat format, const std::vector<DVec3>& positions, const std::vector<Index>& indices) {
  RTCGeometry g = rtcNewGeometry(embree_device(), type);
  auto* p = static_cast<Vec3*>(
      rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3), std::max<size_t>(1, positions.size())));
  auto* i = static_cast<Index*>(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, format, sizeof(Index), indices.size()));
  if (p == nullptr || i == nullptr) {
    rtcReleaseGeometry(g);
    check_device("storing a mesh");
    throw std::runtime_error("Embree refused a mesh");
  }
  std::transform(positions.begin(), positions.end(), p, [](DVec3 v) { return Vec3(v); });
  std::copy(indices.begin(), indices.end(), i);
  return g;
}

bool is_empty(const Shape& shape) {
  const auto* mesh = std::get_if<Mesh>(&shape.geometry);
  const auto* patches = std::get_if<PatchMesh>(&shape.geometry);
  return (mesh != nullptr && mesh->triangles.empty()) || (patches != nullptr && patches->patches.empty());
}

/// Whether all of a shape can be left to Embree's own quadrilaterals.
bool are_parallelograms(const Shape& shape) {
  const auto* patches = std::get_if<PatchMesh>(&shape.geometry);
  if (patches == nullptr) return false;
  for (uint32_t i = 0; i < patches->patches.size(); ++i)
    if (!is_parallelogram(Geometry::Impl::corners(*patches, i))) return false;
  return true;
}

/// Parallelograms, whose corners Embree wants in the order of the circumference.
RTCGeometry new_quads(const PatchMesh& patches) {
  auto quads = patches.patches;
  for (auto& quad : quads) std::swap(quad[2], quad[3]);
  return new_geometry(RTC_GEOMETRY_TYPE_QUAD, RTC_FORMAT_UINT4, patches.positions, quads);
}

}  // namespace

RTCDevice embree_device() {
  // AVX-512 differs from AVX2 in the bits of hits and was measured no faster, so the instruction set is pinned.
  static RTCDevice shared = [] {
    RTCDevice d = rtcNewDevice("max_isa=avx2");
    if (d == nullptr) throw std::runtime_error("Embree cannot open a device: this processor lacks AVX2");
    return d;
  }();
  return shared;
}

RTCGeometry Geometry::Impl::make_geometry(int shape) {
  const Shape& s = shapes[shape];
  const auto* mesh = std::get_if<Mesh>(&s.geometry);
  if (is_embrees(shape)) {
    RTCGeometry g = mesh != nullptr ? new_geometry(RTC_GEOMETRY_TYPE_TRIANGLE, RTC_FORMAT_UINT3, mesh->positions, mesh->triangles)
                                    : new_quads(std::get<PatchMesh>(s.geometry));
    users[shape] = {this, shape};
    rtcSetGeometryUserData(g, &users[shape]);
    if (lead > 0) {
      // Among the candidates is what the ray has just left.
      rtcSetGeometryIntersectFilterFunction(g, [](const RTCFilterFunctionNArguments* args) {
        const Query& query = Query::of(args->context);
        if (is_certain(query, args, std::numeric_limits<double>::infinity())) return;
        const auto hit = Candidate(query, args).exact();
        if (hit && !(hit->t > query.skip)) args->valid[0] = 0;
      });
    }
    // Any-hit queries stop at the first candidate that this lets pass.
    rtcSetGeometryOccludedFilterFunction(g, [](const RTCFilterFunctionNArguments* args) {
      Query& query = Query::of(args->context);
      const Candidate c(query, args);
      if (query.gathering != nullptr) {
        query.gathering->offer(query, c.shape, c.primitive, c.instance);
        args->valid[0] = 0;
        return;
      }
      if (query.is_target(c.shape, c.primitive)) {
        args->valid[0] = 0;
        return;
      }
      if (is_certain(query, args, query.t_max)) return;
      const auto hit = c.exact();
      if (hit && !(hit->t > query.skip && hit->t < query.t_max)) args->valid[0] = 0;
    });
    rtcCommitGeometry(g);
    return g;
  }
  RTCGeometry g = rtcNewGeometry(embree_device(), RTC_GEOMETRY_TYPE_USER);
  const auto* patches = std::get_if<PatchMesh>(&s.geometry);
  rtcSetGeometryUserPrimitiveCount(g, static_cast<unsigned>(patches != nullptr ? patches->patches.size()
                                                            : mesh != nullptr  ? mesh->triangles.size()
                                                                               : 1));
  users[shape] = {this, shape};
  rtcSetGeometryUserData(g, &users[shape]);
  rtcSetGeometryBoundsFunction(
      g,
      [](const RTCBoundsFunctionArguments* args) {
        const auto* user = static_cast<const ShapeUser*>(args->geometryUserPtr);
        const Shape& of = user->impl->shapes[user->shape];
        Box3 box;
        if (const auto* m = std::get_if<PatchMesh>(&of.geometry)) {
          for (const uint32_t v : m->patches[args->primID]) box.add(Vec3(m->positions[v]));
        } else if (const auto* triangles = std::get_if<Mesh>(&of.geometry)) {
          for (const uint32_t v : triangles->triangles[args->primID]) box.add(Vec3(triangles->positions[v]));
        } else {
          box = bounds_of(of);
        }
        // Embree takes rays to these boxes in float; they are flat where patches are.
        const Vec3 margin(0x1p-20f * static_cast<float>(user->impl->largest) + 0x1p-18f * max_component(glm::max(-box.lower, box.upper)));
        box.lower -= margin;
        box.upper += margin;
        *args->bounds_o = {box.lower.x, box.lower.y, box.lower.z, 0, box.upper.x, box.upper.y, box.upper.z, 0};
      },
      nullptr);
  rtcSetGeometryIntersectFunction(g, [](const RTCIntersectFunctionNArguments* args) {
    if (args->valid[0] == 0) return;
    const auto* user = static_cast<const ShapeUser*>(args->geometryUserPtr);
    const Query& query = Query::of(args->context);
    auto* ray_hit = reinterpret_cast<RTCRayHit*>(args->rayhit);
    DVec3 o = query.o, d = query.d;
    user->impl->to_object(user->impl->instance_of(args->context->instID[0]), o, d);
    const auto hit = user->impl->intersect_primitive(user->shape, args->primID, o, d, query.skip, ray_hit->ray.tfar - query.lead);
    if (!hit) return;
    ray_hit->ray.tfar = static_cast<float>(hit->t + query.lead);
    ray_hit->hit.geomID = args->geomID;
    ray_hit->hit.primID = args->primID;
    ray_hit->hit.instID[0] = args->context->instID[0];
    ray_hit->hit.u = static_cast<float>(hit->uv.x);
    ray_hit->hit.v = static_cast<float>(hit->uv.y);
  });
  rtcSetGeometryOccludedFunction(g, [](const RTCOccludedFunctionNArguments* args) {
    if (args->valid[0] == 0) return;
    const auto* user = static_cast<const ShapeUser*>(args->geometryUserPtr);
    const Query& query = Query::of(args->context);
    const int instance = user->impl->instance_of(args->context->instID[0]);
    if (query.gathering != nullptr) {
      query.gathering->offer(query, user->shape, args->primID, instance);
      return;
    }
    DVec3 o = query.o, d = query.d;
    user->impl->to_object(instance, o, d);
    const bool hidden = query.is_target(user->shape, args->primID)
                            ? user->impl->hides_itself(query.target, o, d, query.skip)
                            : user->impl->intersect_primitive(user->shape, args->primID, o, d, query.skip, query.t_max).has_value();
    if (hidden) {
      reinterpret_cast<RTCRay*>(args->ray)->tfar = -std::numeric_limits<float>::infinity();
    }
  });
  rtcCommitGeometry(g);
  return g;
}

RTCScene Geometry::Impl::make_scene(int first, int count) {
  RTCScene s = rtcNewScene(embree_device());
  rtcSetSceneFlags(s, RTC_SCENE_FLAG_ROBUST);
  for (int i = 0; i < count; ++i) {
    if (is_empty(shapes[first + i])) continue;
    RTCGeometry g = make_geometry(first + i);
    rtcAttachGeometryByID(s, g, static_cast<unsigned>(i));
    rtcReleaseGeometry(g);
  }
  return s;
}

Geometry::Geometry(std::vector<Shape> shapes, int top_level, std::vector<Object> objects, std::vector<Instance> instances, Starts starts)
    : impl_(std::make_unique<Impl>()) {
  impl_->shapes = std::move(shapes);
  impl_->top_level = top_level;
  impl_->objects = std::move(objects);
  impl_->instances = std::move(instances);
  impl_->users.resize(impl_->shapes.size());
  for (const Instance& i : impl_->instances) impl_->object_from_render.push_back(glm::inverse(i.render_from_object));

  for (const PlacedShape& placed : placed_shapes()) {
    if (placed.bounds.empty()) continue;
    impl_->bounds.add(placed.bounds.lower);
    impl_->bounds.add(placed.bounds.upper);
  }
  if (const Box3& box = impl_->bounds; !box.empty()) impl_->largest = max_component(glm::max(-box.lower, box.upper));
  for (const Shape& shape : impl_->shapes) {
    const Box3 box = bounds_of(shape);
    const bool small = shape.emits && !box.empty() && max_component(box.extent()) < kSmallLamp * impl_->largest;
    impl_->in_double.push_back(small);
    impl_->parallelograms.push_back(!small && are_parallelograms(shape));
  }
  if (starts == Starts::kAnywhere) impl_->lead = 0x1p-12 * impl_->largest;

  for (const Object& object : impl_->objects) {
    RTCScene s = impl_->make_scene(object.first_shape, object.shape_count);
    rtcCommitScene(s);
    impl_->object_scenes.push_back(s);
  }
  impl_->scene = impl_->make_scene(0, top_level);
  for (size_t i = 0; i < impl_->instances.size(); ++i) {
    const Instance& instance = impl_->instances[i];
    RTCGeometry g = rtcNewGeometry(embree_device(), RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(g, impl_->object_scenes[instance.object]);
    const glm::mat4 m(instance.render_from_object);
    rtcSetGeometryTransform(g, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, &m[0][0]);
    rtcCommitGeometry(g);
    rtcAttachGeometryByID(impl_->scene, g, static_cast<unsigned>(top_level + static_cast<int>(i)));
    rtcReleaseGeometry(g);
  }
  rtcCommitScene(impl_->scene);
  check_device("building the acceleration structure");
}

}  // namespace woodcock
