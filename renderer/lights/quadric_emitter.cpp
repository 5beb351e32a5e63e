#include <algorithm>
#include <numbers>

#include "renderer/core/transform.h"
#include "renderer/geometry/quadric.h"
#include "renderer/lights/emitter.h"

namespace woodcock {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

glm::dmat3 cofactor(const glm::dmat3& m) { return glm::dmat3(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1])); }

DVec3 sphere_direction(DVec2 u) {
  const double z = 1 - 2 * u.x, r = 2 * std::sqrt(u.x * (1 - u.x)), phi = kTwoPi * u.y;
  return {r * std::cos(phi), r * std::sin(phi), z};
}

/// The cone of directions under which a sphere of radius r is seen from the distance d > r: 1 − cos of its half
/// angle, in the form that keeps its digits for far-away spheres.
double cone_height(double r, double d) {
  const double sin_squared = (r / d) * (r / d);
  const double cosine = std::sqrt((d - r) * (d + r)) / d;
  return sin_squared / (1 + cosine);
}

}  // namespace

QuadricEmitter::QuadricEmitter(const Shape& shape) : quadric_(std::get<Quadric>(shape.geometry)), flip_(shape.flip) {
  const Quadric& q = quadric_;
  full_sphere_ = q.kind == Quadric::Kind::kSphere && q.z_min <= -q.radius && q.z_max >= q.radius && q.phi_max >= kTwoPi * (1 - 1e-12);
  const glm::dmat3 render_from_object(q.render_from_object);
  directions_ = DirectionMap(glm::dmat3(q.object_from_render));
  cofactor_ = cofactor(render_from_object);
  if (q.kind == Quadric::Kind::kDisk) {
    object_area_ = 0.5 * q.phi_max * (q.radius - q.inner_radius) * (q.radius + q.inner_radius);
  } else {
    const double lower = q.kind == Quadric::Kind::kSphere ? std::max(q.z_min, -q.radius) : q.z_min;
    const double upper = q.kind == Quadric::Kind::kSphere ? std::min(q.z_max, q.radius) : q.z_max;
    object_area_ = std::abs(q.phi_max * q.radius * (upper - lower));
  }
  // The mean stretch of area over the shape; one value where the transform keeps angles or the shape is flat.
  constexpr int kNodes = 64;
  double ratio = 0;
  for (int i = 0; i < kNodes; ++i)
    for (int j = 0; j < kNodes; ++j) ratio += area_ratio(point({(i + 0.5) / kNodes, (j + 0.5) / kNodes}));
  area_ = object_area_ * ratio / (kNodes * kNodes);
}

DVec3 QuadricEmitter::object_normal(DVec3 p) const {
  switch (quadric_.kind) {
    case Quadric::Kind::kSphere:
      return glm::normalize(p);
    case Quadric::Kind::kCylinder:
      return glm::normalize(DVec3(p.x, p.y, 0)) * (quadric_.z_max < quadric_.z_min ? -1.0 : 1.0);
    case Quadric::Kind::kDisk:
      break;
  }
  return {0, 0, 1};
}

DVec3 QuadricEmitter::point(DVec2 u) const {
  const Quadric& q = quadric_;
  const double phi = u.y * q.phi_max;
  if (q.kind == Quadric::Kind::kDisk) {
    const double r = std::sqrt(q.inner_radius * q.inner_radius + u.x * (q.radius - q.inner_radius) * (q.radius + q.inner_radius));
    return {r * std::cos(phi), r * std::sin(phi), q.z_min};
  }
  if (q.kind == Quadric::Kind::kCylinder) return {q.radius * std::cos(phi), q.radius * std::sin(phi), q.z_min + u.x * (q.z_max - q.z_min)};
  const double lower = std::max(q.z_min, -q.radius), upper = std::min(q.z_max, q.radius);
  const double z = lower + u.x * (upper - lower);
  const double r = std::sqrt(std::max(0.0, (q.radius - z) * (q.radius + z)));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

double QuadricEmitter::area_ratio(DVec3 p) const { return glm::length(cofactor_ * object_normal(p)); }

Vec2 QuadricEmitter::texture_coordinates(DVec3 p) const {
  const Quadric& q = quadric_;
  double phi = std::atan2(p.y, p.x);
  if (phi < 0) phi += kTwoPi;
  double v = 0;
  if (q.kind == Quadric::Kind::kDisk) {
    v = (q.radius - std::hypot(p.x, p.y)) / (q.radius - q.inner_radius);
  } else if (q.kind == Quadric::Kind::kCylinder) {
    v = (p.z - q.z_min) / (q.z_max - q.z_min);
  } else {
    const auto theta = [&](double z) { return std::acos(std::clamp(z / q.radius, -1.0, 1.0)); };
    v = (theta(p.z) - theta(q.z_min)) / (theta(q.z_max) - theta(q.z_min));
  }
  return {static_cast<float>(phi / q.phi_max), static_cast<float>(v)};
}

EmitterSample QuadricEmitter::finish(DVec3 p_object, DVec3 ref) const {
  EmitterSample sample;
  sample.p = transform_point(quadric_.render_from_object, p_object);
  const DVec3 normal = glm::transpose(glm::dmat3(quadric_.object_from_render)) * object_normal(p_object);
  sample.ng = glm::normalize(flip_ ? -normal : normal);
  const DVec3 to_light = sample.p - ref;
  sample.distance = glm::length(to_light);
  sample.wi = to_light / sample.distance;
  sample.along = glm::dot(outward(quadric_, p_object), glm::dmat3(quadric_.object_from_render) * to_light) > 0;
  sample.uv = texture_coordinates(p_object);
  sample.primitive = 0;
  return sample;
}

DirectionCone QuadricEmitter::normals() const {
  if (quadric_.kind != Quadric::Kind::kDisk) return {};
  const DVec3 n = glm::transpose(glm::dmat3(quadric_.object_from_render)) * DVec3(0, 0, flip_ ? -1 : 1);
  return {glm::normalize(n), 1};
}

std::optional<EmitterSample> QuadricEmitter::sample(DVec3 ref, DVec2 u, double /*u_primitive*/, Pieces /*pieces*/) const {
  if (!full_sphere_) {
    const DVec3 p_object = point(u);
    EmitterSample sample = finish(p_object, ref);
    const double cosine = std::abs(glm::dot(sample.wi, sample.ng));
    sample.pdf = sample.distance * sample.distance / (cosine * object_area_ * area_ratio(p_object));
    if (!(sample.pdf > 0) || !std::isfinite(sample.pdf)) return std::nullopt;
    return sample;
  }
  const double r = quadric_.radius;
  const DVec3 o = transform_point(quadric_.object_from_render, ref);
  const double d = glm::length(o);
  DVec3 p_object;
  if (d > r) {
    // Uniform in the cone of directions; the point is where the direction enters the sphere.
    const double height = u.x * cone_height(r, d);  // 1 − cos θ
    const double cosine = 1 - height, sine = std::sqrt(height * (1 + cosine)), phi = kTwoPi * u.y;
    const DVec3 axis = -o / d;
    const DVec3 s = glm::normalize(std::abs(axis.x) > 0.5 ? glm::cross(axis, DVec3(0, 1, 0)) : glm::cross(axis, DVec3(1, 0, 0)));
    const DVec3 t = glm::cross(axis, s);
    const DVec3 across = s * std::cos(phi) + t * std::sin(phi);
    // From the centre, the point lies at an angle α from −axis: it is d·sin θ and what is left of r away from them.
    const double offset = d * sine, near = std::sqrt(std::max(0.0, (r - offset) * (r + offset)));
    // In the plane of axis and across: distance along the ray t = d cos θ − near.
    const double along = d * cosine - near;
    p_object = r * glm::normalize(o + along * (cosine * axis + sine * across));
  } else {
    const DVec3 direction = sphere_direction(u);
    const double b = glm::dot(o, direction);
    const double along = -b + std::sqrt(std::max(0.0, b * b + (r - d) * (r + d)));
    p_object = r * glm::normalize(o + along * direction);
  }
  EmitterSample sample = finish(p_object, ref);
  if (!(sample.distance > 0)) return std::nullopt;
  sample.pdf = sphere_pdf(d, sample.wi);
  return sample;
}

double QuadricEmitter::sphere_pdf(double d, DVec3 wi) const {
  const double r = quadric_.radius;
  const double in_object = d > r ? 1 / (kTwoPi * cone_height(r, d)) : 1 / (2 * kTwoPi);
  return in_object * directions_.solid_angle_ratio(wi);
}

double QuadricEmitter::pdf(DVec3 ref, const EmitterHit& hit, DVec3 wi, Pieces /*pieces*/) const {
  if (full_sphere_) {
    const double d = glm::length(transform_point(quadric_.object_from_render, ref));
    if (d > quadric_.radius) {
      // The far side is met by rays that pass through the near one, but never sampled.
      const DVec3 p = transform_point(quadric_.object_from_render, hit.p);
      if (glm::dot(p, directions_.to_b(wi)) > 0) return 0;
    }
    return sphere_pdf(d, wi);
  }
  const DVec3 p(hit.p), to_light = p - ref;
  const double ratio = area_ratio(transform_point(quadric_.object_from_render, p));
  const double pdf = glm::dot(to_light, to_light) / (std::abs(glm::dot(wi, DVec3(hit.ng))) * object_area_ * ratio);
  return std::isfinite(pdf) ? pdf : 0;
}

}  // namespace woodcock
