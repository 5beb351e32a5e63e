// Lights on shapes and elsewhere, from their formulas.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "tests/transport/weights/scene_formulas.h"

namespace woodcock::testing {
namespace {

constexpr double kPiD = std::numbers::pi;

DVec3 point(const DMat4& m, DVec3 p) { return DVec3(m * glm::dvec4(p, 1)); }
DVec3 vector(const DMat4& m, DVec3 v) { return glm::dmat3(m) * v; }
double cosine_of_degrees(double a) { return std::cos(a * kPiD / 180); }

double area(const std::array<DVec3, 3>& c) { return glm::length(glm::cross(c[1] - c[0], c[2] - c[0])) / 2; }

/// l'Huilier's theorem.
double solid_angle(const std::array<DVec3, 3>& corner, DVec3 from) {
  std::array<DVec3, 3> w;
  for (size_t i = 0; i < 3; ++i) w[i] = glm::normalize(corner[i] - from);
  const auto side = [&](size_t i, size_t j) { return 2 * std::asin(std::min(1.0, glm::length(w[i] - w[j]) / 2)); };
  const double a = side(1, 2), b = side(2, 0), c = side(0, 1), s = (a + b + c) / 2;
  const double t = std::tan(s / 2) * std::tan((s - a) / 2) * std::tan((s - b) / 2) * std::tan((s - c) / 2);
  return 4 * std::atan(std::sqrt(std::max(t, 0.0)));
}

/// Whether two triangles are the halves of a rectangle and face the same side. Throws TooNear.
bool is_rectangle(const std::array<DVec3, 3>& a, const std::array<DVec3, 3>& b) {
  const auto in = [](const std::array<DVec3, 3>& c, DVec3 p) { return c[0] == p || c[1] == p || c[2] == p; };
  std::vector<DVec3> shared, other;
  for (const DVec3 p : a) (in(b, p) ? shared : other).push_back(p);
  for (const DVec3 p : b)
    if (!in(a, p)) other.push_back(p);
  if (shared.size() != 2 || other.size() != 2) return false;
  if (glm::dot(glm::cross(a[1] - a[0], a[2] - a[0]), glm::cross(b[1] - b[0], b[2] - b[0])) < 0) return false;
  const DVec3 x = shared[0] - other[0], y = shared[1] - other[0];
  const double side = std::min(glm::length(x), glm::length(y));
  const double off = std::max(glm::length(other[0] + other[1] - shared[0] - shared[1]), std::abs(glm::dot(x, y)) / side);
  if (off > 1e-5 * side) return false;
  if (off > 1e-7 * side) throw TooNear{};
  return true;
}

}  // namespace

LightFormula::LightFormula(const LightDescription& light, const RenderSpace& space, double scene_radius) {
  const DMat4 to_render = space.render_from_world * light.world_from_light;
  if (const auto* l = std::get_if<PointLightDescription>(&light.kind)) {
    kind_ = Kind::kPoint;
    include(point(to_render, l->position));
    position_ = point(to_render, l->position);
    radiance_ = DVec3(l->intensity) * (space.scale * space.scale);
    power_ = 4 * kPiD * radiance_;
  } else if (const auto* s = std::get_if<SpotLightDescription>(&light.kind)) {
    kind_ = Kind::kSpot;
    position_ = point(to_render, s->from);
    axis_ = glm::normalize(vector(to_render, s->to - s->from));
    include(point(to_render, s->from));
    facing_ = glm::normalize(vector(to_render, s->to - s->from));
    spread_ = static_cast<double>(s->cone_angle - s->cone_delta_angle) * kPiD / 180;
    reach_ = static_cast<double>(s->cone_delta_angle) * kPiD / 180;
    cos_zero_ = cosine_of_degrees(static_cast<double>(s->cone_angle));
    cos_full_ = cosine_of_degrees(static_cast<double>(s->cone_angle - s->cone_delta_angle));
    radiance_ = DVec3(s->intensity) * (space.scale * space.scale);
    power_ = radiance_ * (2 * kPiD * (1 - (cos_full_ + cos_zero_) / 2));
  } else if (const auto* q = std::get_if<DistantLightDescription>(&light.kind)) {
    kind_ = Kind::kDistant;
    bounded_ = false;
    axis_ = glm::normalize(vector(to_render, q->from - q->to));
    radiance_ = DVec3(q->radiance);
    power_ = radiance_ * (kPiD * scene_radius * scene_radius);
  } else {
    const auto& i = std::get<InfiniteLightDescription>(light.kind);
    if (!i.image_file.empty()) throw std::logic_error("no formula for an environment image");
    kind_ = Kind::kInfinite;
    bounded_ = delta_ = false;
    radiance_ = DVec3(i.radiance);
    power_ = radiance_ * (4 * kPiD * kPiD * scene_radius * scene_radius);
  }
}

LightFormula::LightFormula(const ShapeDescription& shape, const RenderSpace& space) {
  const DMat4 to_render = space.render_from_world * shape.world_from_object;
  const double determinant = glm::determinant(glm::dmat3(to_render)), scale = std::cbrt(std::abs(determinant));
  flip_ = shape.reverse_orientation != (determinant < 0);
  const AreaLightDescription& light = *shape.area_light;
  two_sided_ = light.two_sided;
  opacity_ = std::clamp(static_cast<double>(shape.alpha.value), 0.0, 1.0);
  delta_ = opacity_ == 0;
  radiance_ = DVec3(light.radiance * light.scale);
  if (const auto* s = std::get_if<SphereDescription>(&shape.kind)) {
    kind_ = Kind::kSphere;
    position_ = point(to_render, DVec3(0));
    radius_ = s->radius * scale;
    area_ = 4 * kPiD * radius_ * radius_;
  } else if (const auto* q = std::get_if<DiskDescription>(&shape.kind)) {
    kind_ = Kind::kDisk;
    position_ = point(to_render, DVec3(0, 0, q->height));
    axis_ = glm::normalize(vector(to_render, DVec3(0, 0, 1)));
    area_ = kPiD * (q->radius * q->radius - q->inner_radius * q->inner_radius) * scale * scale;
  } else if (const auto* c = std::get_if<CylinderDescription>(&shape.kind)) {
    kind_ = Kind::kCylinder;
    position_ = point(to_render, DVec3(0, 0, (c->z_min + c->z_max) / 2));
    radius_ = c->radius * scale;
    axis_ = glm::normalize(vector(to_render, DVec3(0, 0, 1)));
    area_ = 2 * kPiD * c->radius * (c->z_max - c->z_min) * scale * scale;
  } else if (const auto* patches = std::get_if<std::shared_ptr<const BilinearMesh>>(&shape.kind)) {
    // A flat one, cut along the diagonal from its first corner to its last.
    if ((*patches)->patches.size() != 1) throw std::logic_error("no formula for several patches");
    kind_ = Kind::kTriangles;
    patch_ = true;
    std::array<DVec3, 4> corner;
    for (size_t i = 0; i < 4; ++i) corner[i] = point(to_render, (*patches)->positions[(*patches)->patches[0][i]]);
    triangles_ = {{corner[0], corner[1], corner[3]}, {corner[0], corner[3], corner[2]}};
    area_ = area(triangles_[0]) + area(triangles_[1]);
    position_ = 0.5 * (glm::min(glm::min(corner[0], corner[1]), glm::min(corner[2], corner[3])) +
                       glm::max(glm::max(corner[0], corner[1]), glm::max(corner[2], corner[3])));
  } else {
    const auto& mesh = *std::get<std::shared_ptr<const TriangleMesh>>(shape.kind);
    kind_ = Kind::kTriangles;
    DVec3 lower(1e300), upper(-1e300);
    for (const DVec3 p : mesh.positions) {
      lower = glm::min(lower, point(to_render, p));
      upper = glm::max(upper, point(to_render, p));
    }
    position_ = 0.5 * (lower + upper);
    for (const auto& t : mesh.triangles) {
      triangles_.push_back(
          {point(to_render, mesh.positions[t[0]]), point(to_render, mesh.positions[t[1]]), point(to_render, mesh.positions[t[2]])});
      area_ += area(triangles_.back());
    }
  }
  reach_ = kPiD / 2;
  const auto include_box = [&](double r, double z0, double z1) {
    for (int i = 0; i < 8; ++i) include(point(to_render, DVec3((i & 1) != 0 ? r : -r, (i & 2) != 0 ? r : -r, (i & 4) != 0 ? z1 : z0)));
  };
  if (const auto* s = std::get_if<SphereDescription>(&shape.kind)) {
    include_box(s->radius, -s->radius, s->radius);
  } else if (const auto* q = std::get_if<DiskDescription>(&shape.kind)) {
    include_box(q->radius, q->height, q->height);
    facing_ = normal(0, position_);
    spread_ = 0;
  } else if (const auto* c = std::get_if<CylinderDescription>(&shape.kind)) {
    include_box(c->radius, c->z_min, c->z_max);
  } else {
    DVec3 sum(0);
    for (size_t i = 0; i < triangles_.size(); ++i) {
      for (const DVec3 corner : triangles_[i]) include(corner);
      sum += area(triangles_[i]) * normal(static_cast<uint32_t>(i), position_);
    }
    double least = -1;
    if (glm::length(sum) > 1e-6 * area_) {
      least = 1;
      facing_ = glm::normalize(sum);
      for (size_t i = 0; i < triangles_.size(); ++i)
        least = std::min(least, glm::dot(facing_, normal(static_cast<uint32_t>(i), position_)));
    }
    spread_ = least > 0 ? std::acos(std::min(least, 1.0)) : kPiD;
  }
  power_ = radiance_ * (kPiD * area_ * (two_sided_ ? 2 : 1) * (opacity_ > 0 ? opacity_ : 1));
}

void LightFormula::include(DVec3 corner) {
  lower_ = glm::min(lower_, bounded_ && delta_ && area_ == 0 ? corner : DVec3(Vec3(corner)));
  upper_ = glm::max(upper_, bounded_ && delta_ && area_ == 0 ? corner : DVec3(Vec3(corner)));
}

double LightFormula::expected(DVec3 at) const {
  const auto mean = [](DVec3 v) { return (v.x + v.y + v.z) / 3; };
  if (kind_ == Kind::kInfinite) return 0;
  if (kind_ == Kind::kDistant) return mean(radiance_);
  // The largest intensity: radiance × area, of which a surface that faces all ways shows a fourth.
  const bool all_ways = spread_ >= kPiD;
  double intensity = mean(radiance_);
  if (area_ > 0) intensity *= area_ * (opacity_ > 0 ? opacity_ : 1) * (all_ways ? 0.25 : 1);
  const DVec3 center = (lower_ + upper_) / 2.0, half = (upper_ - lower_) * (0.5 * (1 + 1e-6)) + 1e-7 * glm::abs(center), to = at - center;
  const double radius = glm::length(half), distance = glm::length(to);
  if (std::abs(distance - radius) < 1e-5 * radius) throw TooNear{};
  if (distance < radius) return intensity / (radius * radius);
  double angle = std::acos(std::clamp(glm::dot(facing_, to) / distance, -1.0, 1.0));
  if (two_sided_) angle = std::min(angle, kPiD - angle);
  const double beyond = all_ways ? 0 : std::max(0.0, angle - spread_ - std::asin(radius / distance));
  if (!all_ways && std::abs(beyond - reach_) < 1e-4 + 2e-3 * (reach_ < 0.1 ? 1 : 0)) throw TooNear{};
  if (!all_ways && beyond > reach_) return 0;
  return intensity * std::max(std::cos(beyond), 0.05) / (distance * distance);
}

DVec3 LightFormula::normal(uint32_t primitive, DVec3 p) const {
  DVec3 n = axis_;
  if (kind_ == Kind::kSphere) n = glm::normalize(p - position_);
  if (kind_ == Kind::kCylinder) n = glm::normalize((p - position_) - axis_ * glm::dot(p - position_, axis_));
  if (kind_ == Kind::kTriangles) {
    const auto& c = triangles_[patch_ ? 0 : primitive];
    n = glm::normalize(glm::cross(c[1] - c[0], c[2] - c[0]));
  }
  return flip_ ? -n : n;
}

size_t LightFormula::triangle(uint32_t primitive, DVec3 p) const {
  if (!patch_) return primitive;
  const auto& c = triangles_[0];
  const DVec3 diagonal = c[2] - c[0], n = glm::cross(c[1] - c[0], diagonal);
  const double side = glm::dot(glm::cross(diagonal, p - c[0]), n) / (glm::length(n) * glm::dot(diagonal, diagonal));
  if (std::abs(side) < 1e-4) throw TooNear{};
  return side < 0 ? 0 : 1;
}

std::vector<std::array<DVec3, 3>> LightFormula::piece(size_t triangle, bool whole) const {
  if (!whole) return {triangles_[triangle]};
  // Of triangles in a row the first two that fit belong together.
  for (size_t i = 0; i <= triangle; ++i) {
    const bool fits = i + 1 < triangles_.size() && is_rectangle(triangles_[i], triangles_[i + 1]);
    if (fits && i + 1 >= triangle) return {triangles_[i], triangles_[i + 1]};
    if (fits) ++i;
  }
  return {triangles_[triangle]};
}

double LightFormula::flat_pdf(const std::vector<std::array<DVec3, 3>>& piece, DVec3 from, DVec3 p) const {
  // By solid angle where the longest line in it is longer than this share of the distance to the farthest corner, else by area.
  const double share = piece.size() > 1 ? 0.5 : 0.35;
  double line = 0, far = 0, omega = 0, piece_area = 0;
  for (const auto& triangle : piece) {
    for (const DVec3 a : triangle) {
      far = std::max(far, glm::distance(a, from));
      for (const auto& other : piece)
        for (const DVec3 b : other) line = std::max(line, glm::distance(a, b));
    }
    omega += solid_angle(triangle, from);
    piece_area += area(triangle);
  }
  const DVec3 to = p - from, n = glm::normalize(glm::cross(piece[0][1] - piece[0][0], piece[0][2] - piece[0][0]));
  const double height = std::abs(glm::dot(to, n));
  if (std::abs(line - share * far) < 1e-5 * far || (line > share * far && omega < 2e-5)) throw TooNear{};
  if (piece.size() > 1 && height < 1e-4 * line) throw TooNear{};
  if (line > share * far) return piece_area / area_ / omega;
  const double distance2 = glm::dot(to, to);
  return distance2 * std::sqrt(distance2) / (height * area_);
}

double LightFormula::pdf(DVec3 from, uint32_t primitive, DVec3 p, DVec3 wi, bool whole) const {
  switch (kind_) {
    case Kind::kPoint:
    case Kind::kSpot:
    case Kind::kDistant:
      return 1;
    case Kind::kInfinite:
      return 1 / (4 * kPiD);
    case Kind::kSphere: {
      const double distance = glm::distance(from, position_);
      if (std::abs(distance - radius_) < 1e-5 * (1 + radius_)) throw TooNear{};
      if (distance < radius_) return 1 / (4 * kPiD);
      // From outside the near side is sampled, the far side never.
      const double side = glm::dot(glm::normalize(p - position_), wi);
      if (std::abs(side) < 1e-3) throw TooNear{};
      const double sine = radius_ / distance;
      return side > 0 ? 0 : (1 + std::sqrt(1 - sine * sine)) / (2 * kPiD * sine * sine);
    }
    case Kind::kTriangles:
      return flat_pdf(piece(triangle(primitive, p), whole), from, p);
    case Kind::kDisk:
    case Kind::kCylinder:
      break;
  }
  const DVec3 to = p - from;
  return glm::dot(to, to) / (std::abs(glm::dot(wi, normal(primitive, p))) * area_);
}

bool LightFormula::hides(DVec3 from, uint32_t primitive, DVec3 p) const {
  if (opacity_ < 1) return false;
  const DVec3 to = p - from;
  // What rounding may take for the point itself, or for the other side of an edge, is left out.
  constexpr double kMargin = 1e-4;
  if (patch_) return false;
  if (kind_ == Kind::kTriangles) {
    for (size_t i = 0; i < triangles_.size(); ++i) {
      if (i == primitive) continue;
      const auto& c = triangles_[i];
      const DVec3 n = glm::cross(c[1] - c[0], c[2] - c[0]);
      const double s = glm::dot(c[0] - from, n) / glm::dot(to, n);
      if (!(s > kMargin && glm::length(to) * (1 - s) > 1e-2 * std::sqrt(area_))) continue;
      bool inside = true;
      for (size_t k = 0; k < 3; ++k) {
        const DVec3 side = glm::cross(n, c[(k + 1) % 3] - c[k]);
        inside = inside && glm::dot(from + s * to - c[k], side) > 1e-2 * glm::length(side) * std::sqrt(area_);
      }
      if (inside) return true;
    }
    return false;
  }
  if (kind_ != Kind::kCylinder) return false;
  const DVec3 o = from - position_, across = o - axis_ * glm::dot(o, axis_), along = to - axis_ * glm::dot(to, axis_);
  const double a = glm::dot(along, along), b = glm::dot(along, across), c = glm::dot(across, across) - radius_ * radius_, d = b * b - a * c;
  if (!(d > 0)) return false;
  // The other of the two walls.
  const double first = (-b - std::sqrt(d)) / a, second = (-b + std::sqrt(d)) / a,
               s = std::abs(first - 1) > std::abs(second - 1) ? first : second;
  const double height = std::abs(glm::dot(o + s * to, axis_)), half = area_ / (4 * kPiD * radius_);
  return s > kMargin && glm::length(to) * (1 - s) > 1e-2 * radius_ && height < half * (1 - kMargin);
}

DVec3 LightFormula::radiance(DVec3 from, uint32_t primitive, DVec3 p, DVec3 wi, bool sampled) const {
  const auto inverse_square = [&] { return 1 / glm::dot(position_ - from, position_ - from); };
  switch (kind_) {
    case Kind::kPoint:
      return radiance_ * inverse_square();
    case Kind::kSpot: {
      const double x = std::clamp((glm::dot(glm::normalize(from - position_), axis_) - cos_zero_) / (cos_full_ - cos_zero_), 0.0, 1.0);
      return radiance_ * (inverse_square() * x * x * (3 - 2 * x));
    }
    case Kind::kDistant:
    case Kind::kInfinite:
      return radiance_;
    default:
      break;
  }
  // Along a surface rounding says which side is seen; next to nothing comes from there.
  const double side = glm::dot(normal(primitive, p), wi);
  if (!two_sided_ && std::abs(side) < 1e-6) throw TooNear{};
  if (!two_sided_ && side > 0) return DVec3(0);
  // What is sampled is seen through the opacity; a ray meets it with that probability. All of it where no ray does.
  return sampled && opacity_ > 0 ? radiance_ * opacity_ : radiance_;
}

}  // namespace woodcock::testing
