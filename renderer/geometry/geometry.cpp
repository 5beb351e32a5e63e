#include "renderer/geometry/geometry.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "renderer/core/frame.h"
#include "renderer/core/transform.h"
#include "renderer/geometry/patch.h"
#include "renderer/geometry/quadric.h"

namespace woodcock {
namespace {

/// One Embree device for the process. AVX-512 differs from AVX2 in the bits of hits and was measured no
/// faster, so the instruction set is pinned.
RTCDevice device() {
  static RTCDevice shared = [] {
    RTCDevice d = rtcNewDevice("max_isa=avx2");
    if (d == nullptr) throw std::runtime_error("Embree cannot open a device: this processor lacks AVX2");
    return d;
  }();
  return shared;
}

void check_device(const char* what) {
  if (const RTCError error = rtcGetDeviceError(device()); error != RTC_ERROR_NONE) {
    throw std::runtime_error(std::string("Embree failed while ") + what + " (error " + std::to_string(error) +
                             (error == RTC_ERROR_OUT_OF_MEMORY ? ": out of memory)" : ")"));
  }
}

/// Half a unit in the last place of each coordinate, and a little.
Vec3 rounding_error(Vec3 p) { return glm::abs(p) * 0x1.1p-24f; }

/// The ray in double, as a query carries it beside Embree's copy.
struct Query {
  RTCIntersectContext context;  ///< first, so that Embree's pointer to it is a pointer to the query
  DVec3 o, d;
  double t_max = 0;
  TargetPrimitive target;

  /// How far a primitive may be hit: on the target the last thousandth of the way is the sampled point itself.
  double limit(int shape, uint32_t primitive) const {
    return shape == target.shape && primitive == target.primitive ? t_max * (1 - 1e-3) : t_max;
  }
};

}  // namespace

struct Geometry::Impl {
  std::vector<Shape> shapes;
  int top_level = 0;
  std::vector<Object> objects;
  std::vector<Instance> instances;
  std::vector<DMat4> object_from_render;  ///< per instance
  std::vector<RTCScene> object_scenes;
  RTCScene scene = nullptr;

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

  /// The shape and instance that Embree's identifiers name.
  std::pair<int, int> resolve(unsigned geom_id, unsigned inst_id) const {
    if (inst_id == RTC_INVALID_GEOMETRY_ID) return {static_cast<int>(geom_id), -1};
    const int instance = static_cast<int>(inst_id) - top_level;
    return {objects[instances[instance].object].first_shape + static_cast<int>(geom_id), instance};
  }

  void to_object(int instance, DVec3& o, DVec3& d) const {
    if (instance < 0) return;
    o = transform_point(object_from_render[instance], o);
    d = transform_vector(object_from_render[instance], d);
  }

  std::optional<PrimitiveHit> intersect_primitive(int shape, uint32_t primitive, DVec3 o, DVec3 d, double t_min, double t_max) const {
    const auto& geometry = shapes[shape].geometry;
    if (const auto* mesh = std::get_if<Mesh>(&geometry)) {
      const auto& t = mesh->triangles[primitive];
      return intersect_triangle_plane(mesh->positions[t[0]], mesh->positions[t[1]], mesh->positions[t[2]], o, d);
    }
    if (const auto* patches = std::get_if<PatchMesh>(&geometry)) return intersect_patch(corners(*patches, primitive), o, d, t_min, t_max);
    const auto& q = std::get<Quadric>(geometry);
    const auto t =
        woodcock::intersect(q, transform_point(q.object_from_render, o), transform_vector(q.object_from_render, d), t_min, t_max);
    if (!t) return std::nullopt;
    return PrimitiveHit{*t, {0, 0}};
  }

  static std::array<DVec3, 4> corners(const PatchMesh& m, uint32_t primitive) {
    const auto& p = m.patches[primitive];
    return {DVec3(m.positions[p[0]]), DVec3(m.positions[p[1]]), DVec3(m.positions[p[2]]), DVec3(m.positions[p[3]])};
  }

  RTCGeometry make_geometry(int shape);
  RTCScene make_scene(int first, int count);
};

RTCGeometry Geometry::Impl::make_geometry(int shape) {
  const Shape& s = shapes[shape];
  if (const auto* mesh = std::get_if<Mesh>(&s.geometry)) {
    RTCGeometry g = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* positions = static_cast<Vec3*>(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3),
                                                                 std::max<size_t>(1, mesh->positions.size())));
    auto* triangles = static_cast<std::array<uint32_t, 3>*>(
        rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, sizeof(uint32_t) * 3, mesh->triangles.size()));
    if (positions == nullptr || triangles == nullptr) {
      rtcReleaseGeometry(g);
      check_device("storing a mesh");
      throw std::runtime_error("Embree refused a mesh");
    }
    std::copy(mesh->positions.begin(), mesh->positions.end(), positions);
    std::copy(mesh->triangles.begin(), mesh->triangles.end(), triangles);
    users[shape] = {this, shape};
    rtcSetGeometryUserData(g, &users[shape]);
    // Any-hit queries stop at the first candidate, so each is checked in double here.
    rtcSetGeometryOccludedFilterFunction(g, [](const RTCFilterFunctionNArguments* args) {
      const auto* query = reinterpret_cast<const Query*>(args->context);
      const auto* impl = static_cast<const ShapeUser*>(args->geometryUserPtr)->impl;
      const uint32_t primitive = RTCHitN_primID(args->hit, 1, 0);
      const auto [shape_index, instance] = impl->resolve(RTCHitN_geomID(args->hit, 1, 0), RTCHitN_instID(args->hit, 1, 0, 0));
      DVec3 o = query->o, d = query->d;
      impl->to_object(instance, o, d);
      const double limit = query->limit(shape_index, primitive);
      const auto hit = impl->intersect_primitive(shape_index, primitive, o, d, 0, limit);
      if (hit && !(hit->t > 0 && hit->t < limit)) args->valid[0] = 0;
    });
    rtcCommitGeometry(g);
    return g;
  }
  RTCGeometry g = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_USER);
  const auto* patches = std::get_if<PatchMesh>(&s.geometry);
  rtcSetGeometryUserPrimitiveCount(g, patches != nullptr ? static_cast<unsigned>(patches->patches.size()) : 1);
  users[shape] = {this, shape};
  rtcSetGeometryUserData(g, &users[shape]);
  rtcSetGeometryBoundsFunction(
      g,
      [](const RTCBoundsFunctionArguments* args) {
        const auto* user = static_cast<const ShapeUser*>(args->geometryUserPtr);
        const Shape& of = user->impl->shapes[user->shape];
        Box3 box;
        if (const auto* m = std::get_if<PatchMesh>(&of.geometry)) {
          for (const uint32_t v : m->patches[args->primID]) box.add(m->positions[v]);
        } else {
          box = bounds_of(of);
        }
        *args->bounds_o = {box.lower.x, box.lower.y, box.lower.z, 0, box.upper.x, box.upper.y, box.upper.z, 0};
      },
      nullptr);
  rtcSetGeometryIntersectFunction(g, [](const RTCIntersectFunctionNArguments* args) {
    if (args->valid[0] == 0) return;
    const auto* user = static_cast<const ShapeUser*>(args->geometryUserPtr);
    const auto* query = reinterpret_cast<const Query*>(args->context);
    auto* ray_hit = reinterpret_cast<RTCRayHit*>(args->rayhit);
    const auto instance = user->impl->resolve(args->geomID, args->context->instID[0]).second;
    DVec3 o = query->o, d = query->d;
    user->impl->to_object(instance, o, d);
    const auto hit = user->impl->intersect_primitive(user->shape, args->primID, o, d, ray_hit->ray.tnear, ray_hit->ray.tfar);
    if (!hit) return;
    ray_hit->ray.tfar = static_cast<float>(hit->t);
    ray_hit->hit.geomID = args->geomID;
    ray_hit->hit.primID = args->primID;
    ray_hit->hit.instID[0] = args->context->instID[0];
    ray_hit->hit.u = static_cast<float>(hit->uv.x);
    ray_hit->hit.v = static_cast<float>(hit->uv.y);
  });
  rtcSetGeometryOccludedFunction(g, [](const RTCOccludedFunctionNArguments* args) {
    if (args->valid[0] == 0) return;
    const auto* user = static_cast<const ShapeUser*>(args->geometryUserPtr);
    const auto* query = reinterpret_cast<const Query*>(args->context);
    const auto instance = user->impl->resolve(args->geomID, args->context->instID[0]).second;
    DVec3 o = query->o, d = query->d;
    user->impl->to_object(instance, o, d);
    if (user->impl->intersect_primitive(user->shape, args->primID, o, d, 0, query->limit(user->shape, args->primID))) {
      reinterpret_cast<RTCRay*>(args->ray)->tfar = -std::numeric_limits<float>::infinity();
    }
  });
  rtcCommitGeometry(g);
  return g;
}

RTCScene Geometry::Impl::make_scene(int first, int count) {
  RTCScene s = rtcNewScene(device());
  rtcSetSceneFlags(s, RTC_SCENE_FLAG_ROBUST);
  for (int i = 0; i < count; ++i) {
    if (const auto* mesh = std::get_if<Mesh>(&shapes[first + i].geometry); mesh != nullptr && mesh->triangles.empty()) continue;
    RTCGeometry g = make_geometry(first + i);
    rtcAttachGeometryByID(s, g, static_cast<unsigned>(i));
    rtcReleaseGeometry(g);
  }
  return s;
}

Geometry::Geometry(std::vector<Shape> shapes, int top_level, std::vector<Object> objects, std::vector<Instance> instances)
    : impl_(std::make_unique<Impl>()) {
  impl_->shapes = std::move(shapes);
  impl_->top_level = top_level;
  impl_->objects = std::move(objects);
  impl_->instances = std::move(instances);
  impl_->users.resize(impl_->shapes.size());
  for (const Instance& i : impl_->instances) impl_->object_from_render.push_back(glm::inverse(i.render_from_object));

  for (const Object& object : impl_->objects) {
    RTCScene s = impl_->make_scene(object.first_shape, object.shape_count);
    rtcCommitScene(s);
    impl_->object_scenes.push_back(s);
  }
  impl_->scene = impl_->make_scene(0, top_level);
  for (size_t i = 0; i < impl_->instances.size(); ++i) {
    const Instance& instance = impl_->instances[i];
    RTCGeometry g = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_INSTANCE);
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

Geometry::~Geometry() = default;
Geometry::Geometry(Geometry&&) noexcept = default;
Geometry& Geometry::operator=(Geometry&&) noexcept = default;

std::optional<Hit> Geometry::intersect(const Ray& ray, double t_max) const {
  Query query;
  rtcInitIntersectContext(&query.context);
  query.o = ray.o;
  query.d = ray.d;
  float t_near = 0;
  // Each turn skips a candidate behind the origin; the bound only guards against a defect.
  for (int turn = 0; turn < 1000; ++turn) {
    RTCRayHit r{};
    r.ray.org_x = ray.o.x;
    r.ray.org_y = ray.o.y;
    r.ray.org_z = ray.o.z;
    r.ray.dir_x = ray.d.x;
    r.ray.dir_y = ray.d.y;
    r.ray.dir_z = ray.d.z;
    r.ray.tnear = t_near;
    r.ray.tfar = std::nextafter(static_cast<float>(t_max), kInf);
    r.ray.mask = 0xffffffffu;
    r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    query.t_max = t_max;
    rtcIntersect1(impl_->scene, &query.context, &r);
    if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;

    const auto [shape, instance] = impl_->resolve(r.hit.geomID, r.hit.instID[0]);
    Hit hit{r.ray.tfar, {r.hit.u, r.hit.v}, shape, r.hit.primID, instance};
    DVec3 o = query.o, d = query.d;
    impl_->to_object(instance, o, d);
    if (const auto exact = impl_->intersect_primitive(shape, hit.primitive, o, d, t_near, kInf)) {
      hit.t = exact->t;
      hit.uv = exact->uv;
      if (std::holds_alternative<Mesh>(impl_->shapes[static_cast<size_t>(shape)].geometry)) {
        // Embree decided that the triangle is hit; rounding must not put the point outside it.
        hit.uv.x = std::clamp(hit.uv.x, 0.0, 1.0);
        hit.uv.y = std::clamp(hit.uv.y, 0.0, 1.0 - hit.uv.x);
      }
    }
    if (hit.t > 0) return hit.t < t_max ? std::optional(hit) : std::nullopt;
    t_near = std::nextafter(std::max(r.ray.tfar, 0.0f), kInf);
  }
  return std::nullopt;
}

bool Geometry::occluded(const Ray& ray, double t_max, TargetPrimitive target) const {
  Query query;
  rtcInitIntersectContext(&query.context);
  query.o = ray.o;
  query.d = ray.d;
  query.t_max = t_max;
  query.target = target;
  RTCRay r{};
  r.org_x = ray.o.x;
  r.org_y = ray.o.y;
  r.org_z = ray.o.z;
  r.dir_x = ray.d.x;
  r.dir_y = ray.d.y;
  r.dir_z = ray.d.z;
  r.tnear = 0;
  r.tfar = std::nextafter(static_cast<float>(t_max), kInf);
  r.mask = 0xffffffffu;
  rtcOccluded1(impl_->scene, &query.context, &r);
  return r.tfar < 0;
}

namespace {

/// Tangents of a triangle from its texture coordinates (or pbrt-v4's default ones).
void triangle_tangents(const Mesh& mesh, const std::array<uint32_t, 3>& t, Vec3 e1, Vec3 e2, Vec3 n, SurfacePoint& s) {
  Vec2 uv0{0, 0}, uv1{1, 0}, uv2{1, 1};
  if (!mesh.uv.empty()) {
    uv0 = mesh.uv[t[0]];
    uv1 = mesh.uv[t[1]];
    uv2 = mesh.uv[t[2]];
  }
  const Vec2 d1 = uv1 - uv0, d2 = uv2 - uv0;
  const float det = d1.x * d2.y - d1.y * d2.x;
  if (std::abs(det) > 1e-12f) {
    s.dpdu = (d2.y * e1 - d1.y * e2) / det;
    s.dpdv = (d1.x * e2 - d2.x * e1) / det;
    if (length_squared(glm::cross(s.dpdu, s.dpdv)) > 0) return;
  }
  const Frame frame = Frame::from_normal(n);
  s.dpdu = frame.s;
  s.dpdv = frame.t;
}

}  // namespace

SurfacePoint Geometry::surface(const Hit& hit, const Ray& ray) const {
  const Shape& shape = impl_->shapes[hit.shape];
  SurfacePoint s;
  DVec3 p, ng, ns{0};
  if (const auto* mesh = std::get_if<Mesh>(&shape.geometry)) {
    const auto& t = mesh->triangles[hit.primitive];
    const DVec3 p0 = mesh->positions[t[0]], e1 = DVec3(mesh->positions[t[1]]) - p0, e2 = DVec3(mesh->positions[t[2]]) - p0;
    const double b1 = hit.uv.x, b2 = hit.uv.y, b0 = 1 - b1 - b2;
    p = p0 + b1 * e1 + b2 * e2;
    ng = glm::normalize(glm::cross(e1, e2));
    if (shape.flip) ng = -ng;
    if (!mesh->normals.empty()) {
      ns = b0 * DVec3(mesh->normals[t[0]]) + b1 * DVec3(mesh->normals[t[1]]) + b2 * DVec3(mesh->normals[t[2]]);
      if (glm::dot(ns, ng) < 0) ng = -ng;
    }
    triangle_tangents(*mesh, t, Vec3(e1), Vec3(e2), Vec3(ng), s);
    s.uv = {static_cast<float>(b1 + b2), static_cast<float>(b2)};
    if (!mesh->uv.empty()) s.uv = float(b0) * mesh->uv[t[0]] + float(b1) * mesh->uv[t[1]] + float(b2) * mesh->uv[t[2]];
  } else if (const auto* patches = std::get_if<PatchMesh>(&shape.geometry)) {
    const auto c = Impl::corners(*patches, hit.primitive);
    const double u = hit.uv.x, v = hit.uv.y;
    p = (1 - v) * ((1 - u) * c[0] + u * c[1]) + v * ((1 - u) * c[2] + u * c[3]);
    DVec3 dpdu = (1 - v) * (c[1] - c[0]) + v * (c[3] - c[2]);
    DVec3 dpdv = (1 - u) * (c[2] - c[0]) + u * (c[3] - c[1]);
    const DVec3 n = glm::cross(dpdu, dpdv);
    ng = glm::normalize(n);
    if (shape.flip) ng = -ng;
    const auto& q = patches->patches[hit.primitive];
    const std::array<double, 4> w{(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
    if (!patches->normals.empty()) {
      for (int i = 0; i < 4; ++i) ns += w[i] * DVec3(patches->normals[q[i]]);
      if (glm::dot(ns, ng) < 0) ng = -ng;
    }
    s.uv = {static_cast<float>(u), static_cast<float>(v)};
    if (!patches->uv.empty()) {
      s.uv = {0, 0};
      for (int i = 0; i < 4; ++i) s.uv += static_cast<float>(w[i]) * patches->uv[q[i]];
    }
    s.dpdu = Vec3(dpdu);
    s.dpdv = Vec3(dpdv);
  } else {
    const auto& q = std::get<Quadric>(shape.geometry);
    DVec3 o = ray.o, d = ray.d;
    impl_->to_object(hit.instance, o, d);
    const DVec3 at = transform_point(q.object_from_render, o) + hit.t * transform_vector(q.object_from_render, d);
    const ParametricPoint point = parametric_point(q, at);
    p = transform_point(q.render_from_object, point.p);
    const DVec3 outward = q.kind == Quadric::Kind::kDisk     ? DVec3(0, 0, 1)
                          : q.kind == Quadric::Kind::kSphere ? point.p
                                                             : DVec3(point.p.x, point.p.y, 0);
    ng = glm::normalize(transform_normal(q.object_from_render, outward));
    if (shape.flip) ng = -ng;
    s.dpdu = Vec3(transform_vector(q.render_from_object, point.dpdu));
    s.dpdv = Vec3(transform_vector(q.render_from_object, point.dpdv));
    s.uv = Vec2(point.uv);
  }
  if (!(glm::dot(ns, ns) > 0)) ns = ng;
  if (hit.instance >= 0) {
    const DMat4& m = impl_->instances[hit.instance].render_from_object;
    const DMat4& inverse = impl_->object_from_render[hit.instance];
    p = transform_point(m, p);
    ng = glm::normalize(transform_normal(inverse, ng));
    ns = transform_normal(inverse, ns);
    s.dpdu = Vec3(transform_vector(m, s.dpdu));
    s.dpdv = Vec3(transform_vector(m, s.dpdv));
  }
  s.p = Vec3(p);
  s.p_error = rounding_error(s.p);
  s.ng = Vec3(ng);
  s.ns = Vec3(glm::normalize(ns));
  return s;
}

std::string Geometry::library_version() {
  const auto version = rtcGetDeviceProperty(device(), RTC_DEVICE_PROPERTY_VERSION);
  return std::to_string(version / 10000) + "." + std::to_string(version / 100 % 100) + "." + std::to_string(version % 100);
}

const std::vector<Shape>& Geometry::shapes() const { return impl_->shapes; }

Box3 Geometry::bounds() const {
  RTCBounds b;
  rtcGetSceneBounds(impl_->scene, &b);
  return {{b.lower_x, b.lower_y, b.lower_z}, {b.upper_x, b.upper_y, b.upper_z}};
}

Box3 bounds_of(const Shape& shape) {
  Box3 box;
  if (const auto* mesh = std::get_if<Mesh>(&shape.geometry)) {
    for (const Vec3 p : mesh->positions) box.add(p);
  } else if (const auto* patches = std::get_if<PatchMesh>(&shape.geometry)) {
    for (const Vec3 p : patches->positions) box.add(p);
  } else {
    const auto& q = std::get<Quadric>(shape.geometry);
    DVec3 lower, upper;
    object_bounds(q, lower, upper);
    for (int i = 0; i < 8; ++i) {
      const DVec3 corner((i & 1) != 0 ? upper.x : lower.x, (i & 2) != 0 ? upper.y : lower.y, (i & 4) != 0 ? upper.z : lower.z);
      const Vec3 p(transform_point(q.render_from_object, corner));
      // Rounded outwards, so that the double intersection lies within.
      box.add(p - rounding_error(p) * 4.0f);
      box.add(p + rounding_error(p) * 4.0f);
    }
  }
  return box;
}

}  // namespace woodcock
