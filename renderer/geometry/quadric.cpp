#include "renderer/geometry/quadric.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace woodcock {
namespace {

constexpr double kTwoPi = 2 * 3.14159265358979323846;

double azimuth(DVec3 p) {
  const double phi = std::atan2(p.y, p.x);
  return phi < 0 ? phi + kTwoPi : phi;
}

/// Whether the point lies in the part of the quadric that z_min, z_max, inner_radius and phi_max keep.
bool kept(const Quadric& q, DVec3 p) {
  if (q.kind == Quadric::Kind::kDisk) {
    const double r2 = p.x * p.x + p.y * p.y;
    if (r2 > q.radius * q.radius || r2 < q.inner_radius * q.inner_radius) return false;
  } else {
    // A full sphere keeps its poles whatever their rounding.
    if (q.z_min > -q.radius && p.z < q.z_min && q.kind == Quadric::Kind::kSphere) return false;
    if (q.z_max < q.radius && p.z > q.z_max && q.kind == Quadric::Kind::kSphere) return false;
    if (q.kind == Quadric::Kind::kCylinder && (p.z < q.z_min || p.z > q.z_max)) return false;
  }
  return q.phi_max >= kTwoPi || azimuth(p) <= q.phi_max;
}

std::optional<double> first_kept(const Quadric& q, DVec3 o, DVec3 d, double t0, double t1, double t_min, double t_max) {
  for (const double t : {t0, t1}) {
    if (t > t_min && t < t_max && kept(q, o + t * d)) return t;
  }
  return std::nullopt;
}

}  // namespace

std::optional<double> intersect(const Quadric& q, DVec3 o, DVec3 d, double t_min, double t_max) {
  if (q.kind == Quadric::Kind::kDisk) {
    if (d.z == 0) return std::nullopt;
    const double t = (q.z_min - o.z) / d.z;
    return first_kept(q, o, d, t, t, t_min, t_max);
  }
  // The point of the ray nearest to the centre (or axis) comes first: b² − 4ac would cancel for a far or small
  // sphere (Haines et al. 2019, "Precision Improvements for Ray/Sphere Intersection").
  const bool sphere = q.kind == Quadric::Kind::kSphere;
  const DVec3 oo = sphere ? o : DVec3(o.x, o.y, 0);
  const DVec3 dd = sphere ? d : DVec3(d.x, d.y, 0);
  const double a = glm::dot(dd, dd);
  if (a == 0) return std::nullopt;
  const double t_near = -glm::dot(oo, dd) / a;
  const DVec3 nearest = oo + t_near * dd;
  const double discriminant = q.radius * q.radius - glm::dot(nearest, nearest);
  if (discriminant < 0) return std::nullopt;
  const double half = std::sqrt(discriminant / a);
  return first_kept(q, o, d, t_near - half, t_near + half, t_min, t_max);
}

ParametricPoint parametric_point(const Quadric& q, DVec3 p) {
  ParametricPoint r;
  switch (q.kind) {
    case Quadric::Kind::kSphere: {
      p *= q.radius / glm::length(p);
      const double theta_min = std::acos(std::clamp(std::max(q.z_min, -q.radius) / q.radius, -1.0, 1.0));
      const double theta_max = std::acos(std::clamp(std::min(q.z_max, q.radius) / q.radius, -1.0, 1.0));
      const double rho = std::sqrt(p.x * p.x + p.y * p.y);
      const double theta = std::atan2(rho, p.z);
      const double phi = azimuth(p);
      const double cos_phi = rho > 0 ? p.x / rho : 1, sin_phi = rho > 0 ? p.y / rho : 0;
      const double range = theta_max - theta_min;
      r.uv = {phi / q.phi_max, (theta - theta_min) / range};
      r.dpdu = {-q.phi_max * p.y, q.phi_max * p.x, 0};
      if (rho == 0) r.dpdu = {0, q.phi_max * q.radius * 1e-9, 0};  // at a pole only the direction matters
      r.dpdv = range * DVec3(p.z * cos_phi, p.z * sin_phi, -rho);
      break;
    }
    case Quadric::Kind::kDisk: {
      const double rho = std::sqrt(p.x * p.x + p.y * p.y);
      p.z = q.z_min;
      const double width = q.radius - q.inner_radius;
      r.uv = {azimuth(p) / q.phi_max, (q.radius - rho) / width};
      r.dpdu = rho > 0 ? DVec3(-q.phi_max * p.y, q.phi_max * p.x, 0) : DVec3(0, q.phi_max * q.radius * 1e-9, 0);
      r.dpdv = rho > 0 ? DVec3(p.x, p.y, 0) * (-width / rho) : DVec3(-width, 0, 0);
      break;
    }
    case Quadric::Kind::kCylinder: {
      const double scale = q.radius / std::sqrt(p.x * p.x + p.y * p.y);
      p.x *= scale;
      p.y *= scale;
      r.uv = {azimuth(p) / q.phi_max, (p.z - q.z_min) / (q.z_max - q.z_min)};
      r.dpdu = {-q.phi_max * p.y, q.phi_max * p.x, 0};
      r.dpdv = {0, 0, q.z_max - q.z_min};
      break;
    }
  }
  r.p = p;
  return r;
}

double edge_distance(const Quadric& q, DVec3 p) {
  double distance = std::numeric_limits<double>::infinity();
  const double rho = std::sqrt(p.x * p.x + p.y * p.y);
  if (q.kind == Quadric::Kind::kDisk) {
    distance = q.radius - rho;
    if (q.inner_radius > 0) distance = std::min(distance, rho - q.inner_radius);
  } else {
    const bool sphere = q.kind == Quadric::Kind::kSphere;
    if (!sphere || q.z_min > -q.radius) distance = std::min(distance, p.z - q.z_min);
    if (!sphere || q.z_max < q.radius) distance = std::min(distance, q.z_max - p.z);
  }
  if (q.phi_max < kTwoPi) {
    const double phi = azimuth(p);
    distance = std::min({distance, rho * std::abs(q.phi_max - phi), rho * phi, rho * (kTwoPi - phi)});
  }
  return std::max(0.0, distance);
}

void object_bounds(const Quadric& q, DVec3& lower, DVec3& upper) {
  lower = {-q.radius, -q.radius, q.z_min};
  upper = {q.radius, q.radius, q.kind == Quadric::Kind::kDisk ? q.z_min : q.z_max};
  if (q.kind == Quadric::Kind::kSphere) {
    lower.z = std::max(lower.z, -q.radius);
    upper.z = std::min(upper.z, q.radius);
  }
}

}  // namespace woodcock
