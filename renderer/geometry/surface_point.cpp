// The local geometry of a hit.
#include <algorithm>
#include <array>
#include <cmath>

#include "renderer/core/frame.h"
#include "renderer/geometry/embree_scene.h"

namespace woodcock {
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

/// Turns the derivatives of a patch along its own parameters into those along its texture coordinates at (s, t), by the inverse of
/// ∂(u, v)/∂(s, t); leaves them where that has none.
void patch_tangents(const std::array<Vec2, 4>& uv, double s, double t, DVec3& dpdu, DVec3& dpdv) {
  const DVec2 ds = (1 - t) * DVec2(uv[1] - uv[0]) + t * DVec2(uv[3] - uv[2]),
              dt = (1 - s) * DVec2(uv[2] - uv[0]) + s * DVec2(uv[3] - uv[1]);
  const double det = ds.x * dt.y - ds.y * dt.x;
  if (!(std::abs(det) > 1e-12)) return;
  const DVec3 dpds = dpdu, dpdt = dpdv;
  dpdu = (dt.y * dpds - ds.y * dpdt) / det;
  dpdv = (ds.x * dpdt - dt.x * dpds) / det;
}

/// How far off its plane a point of a triangle or parallelogram may seem to lie, in double arithmetic: `inverse` = 1/|e1 × e2|. Not
/// `tight`: lengths are sums of absolute coordinates, which are no less and need no roots.
double plane_error(DVec3 p, DVec3 p0, DVec3 e1, DVec3 e2, double inverse, bool tight) {
  const auto length = [&](DVec3 v) { return tight ? glm::length(v) : std::abs(v.x) + std::abs(v.y) + std::abs(v.z); };
  const double l1 = length(e1), l2 = length(e2);
  return 0x1p-49 * (length(p) + length(p0) + (l1 + l2) * (l1 * l2 * inverse));
}

/// How far along `normal`, a unit vector behind the map, rounding may move a point that is taken through the map `m`.
double affine_error(const DMat4& m, DVec3 p, DVec3 normal) {
  const DVec3 a = glm::abs(p);
  const DVec3 sum = glm::abs(DVec3(m[0])) * a.x + glm::abs(DVec3(m[1])) * a.y + glm::abs(DVec3(m[2])) * a.z + glm::abs(DVec3(m[3]));
  return 0x1p-50 * glm::dot(glm::abs(normal), sum);
}

}  // namespace

SurfacePoint Geometry::surface(const Hit& hit, const Ray& ray, Tangents tangents) const {
  const bool with_tangents = tangents == Tangents::kWanted;
  const Shape& shape = impl_->shapes[hit.shape];
  SurfacePoint s;
  DVec3 p, ng, ns{0};
  double error = 0;
  // Where rays start on surfaces, errors in double are far below those that count.
  const bool tight = impl_->lead > 0;
  if (const auto* mesh = std::get_if<Mesh>(&shape.geometry)) {
    const auto& t = mesh->triangles[hit.primitive];
    const DVec3 p0 = mesh->positions[t[0]], e1 = mesh->positions[t[1]] - p0, e2 = mesh->positions[t[2]] - p0;
    const double b1 = hit.uv.x, b2 = hit.uv.y, b0 = 1 - b1 - b2;
    p = p0 + b1 * e1 + b2 * e2;
    const DVec3 n = glm::cross(e1, e2);
    const double inverse = 1 / glm::length(n);
    ng = n * inverse;
    error = plane_error(p, p0, e1, e2, inverse, tight);
    if (shape.flip) ng = -ng;
    if (!mesh->normals.empty()) {
      ns = b0 * DVec3(mesh->normals[t[0]]) + b1 * DVec3(mesh->normals[t[1]]) + b2 * DVec3(mesh->normals[t[2]]);
      if (glm::dot(ns, ng) < 0) ng = -ng;
    }
    if (with_tangents) triangle_tangents(*mesh, t, Vec3(e1), Vec3(e2), Vec3(ng), s);
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
    // What intersect_patch may be off by, with room.
    if (impl_->parallelograms[static_cast<size_t>(hit.shape)])
      error = plane_error(p, c[0], c[1] - c[0], c[2] - c[0], 1 / glm::length(n), tight);
    else
      error = 0x1p-42 * (glm::length(p) + glm::length(c[3] - c[0]) + glm::length(c[2] - c[1]));
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
      if (with_tangents) patch_tangents({patches->uv[q[0]], patches->uv[q[1]], patches->uv[q[2]], patches->uv[q[3]]}, u, v, dpdu, dpdv);
    }
    if (with_tangents) {
      s.dpdu = Vec3(dpdu);
      s.dpdv = Vec3(dpdv);
    }
  } else {
    const auto& q = std::get<Quadric>(shape.geometry);
    DVec3 o = ray.o, d = ray.d;
    impl_->to_object(hit.instance, o, d);
    const DVec3 at = transform_point(q.object_from_render, o) + hit.t * transform_vector(q.object_from_render, d);
    const ParametricPoint point = parametric_point(q, at);
    p = transform_point(q.render_from_object, point.p);
    const DVec3 n_object = glm::normalize(outward(q, point.p)), n = transform_normal(q.object_from_render, n_object);
    ng = glm::normalize(n);
    error = (affine_error(q.object_from_render, p, n_object) + 0x1p-49 * (glm::length(point.p) + q.radius)) / glm::length(n);
    if (shape.flip) ng = -ng;
    if (with_tangents) {
      s.dpdu = Vec3(transform_vector(q.render_from_object, point.dpdu));
      s.dpdv = Vec3(transform_vector(q.render_from_object, point.dpdv));
    }
    s.uv = Vec2(point.uv);
  }
  const bool is_shaded = glm::dot(ns, ns) > 0;
  if (hit.instance >= 0) {
    const DMat4& m = impl_->instances[hit.instance].render_from_object;
    const DMat4& inverse = impl_->object_from_render[hit.instance];
    p = transform_point(m, p);
    const DVec3 n = transform_normal(inverse, ng);
    error = (error + affine_error(inverse, p, ng)) / glm::length(n);
    ng = glm::normalize(n);
    if (is_shaded) ns = transform_normal(inverse, ns);
    if (with_tangents) {
      s.dpdu = Vec3(transform_vector(m, s.dpdu));
      s.dpdv = Vec3(transform_vector(m, s.dpdv));
    }
  }
  s.p = p;
  s.ng = Vec3(ng);
  // Some units in the last place of a float, three times as many where Embree takes a ray to an object: a limit for slivers, whose
  // planes are known no better, and where rays start on surfaces what spares most of them a second look at the one they leave.
  const double in_float = 0x1.8p-24 * glm::dot(glm::abs(ng), glm::abs(p)) * (hit.instance < 0 ? 1.0 : 3.0);
  s.error = std::min(error, std::max(in_float, 0x1p-40 * impl_->largest));
  if (impl_->lead == 0) s.error = std::max(s.error, in_float);
  s.ns = is_shaded ? Vec3(glm::normalize(ns)) : s.ng;
  return s;
}

}  // namespace woodcock
