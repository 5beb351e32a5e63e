#include <algorithm>

#include "renderer/geometry/patch.h"
#include "renderer/lights/emitter.h"
#include "renderer/lights/patch_geometry.h"
#include "renderer/lights/triangle_sampling.h"

namespace woodcock {
namespace {

double triangle_area(const std::array<DVec3, 3>& c) { return 0.5 * glm::length(glm::cross(c[1] - c[0], c[2] - c[0])); }

DVec3 interpolate(const std::array<DVec3, 3>& c, DVec2 b) { return (1 - b.x - b.y) * c[0] + b.x * c[1] + b.y * c[2]; }

/// The two triangles of a flat patch, cut along the diagonal from (0,0) to (1,1).
std::array<DVec3, 3> half(const PatchCorners& c, int which) {
  return which == 0 ? std::array<DVec3, 3>{c[0], c[1], c[3]} : std::array<DVec3, 3>{c[0], c[3], c[2]};
}

}  // namespace

MeshEmitter::MeshEmitter(const Shape& shape, bool equal_weights) : flip_(shape.flip) {
  if (const Mesh* mesh = std::get_if<Mesh>(&shape.geometry)) {
    positions_ = mesh->positions;
    normals_ = mesh->normals;
    uv_ = mesh->uv;
    triangles_ = mesh->triangles;
  } else {
    const PatchMesh& patches = std::get<PatchMesh>(shape.geometry);
    positions_ = patches.positions;
    normals_ = patches.normals;
    uv_ = patches.uv;
    patches_ = patches.patches;
  }
  for (size_t i = 0; i < triangles_.size(); ++i) areas_.push_back(triangle_area(triangle(i)));
  for (size_t i = 0; i < patches_.size(); ++i) {
    const PatchCorners c = patch(i);
    flat_.push_back(is_flat_and_convex(c));
    const double first = triangle_area(half(c, 0));
    areas_.push_back(is_flat(i) ? first + triangle_area(half(c, 1)) : patch_area(c));
    first_half_.push_back(is_flat(i) ? first / areas_[i] : 0);
  }
  std::vector<double> weights;
  for (double& area : areas_) {
    // What has no area has no normal either.
    if (!(area > 0) || !std::isfinite(area)) area = 0;
    weights.push_back(equal_weights && area > 0 ? 1.0 : area);
  }
  choice_ = DiscreteDistribution(weights);
}

std::array<DVec3, 3> MeshEmitter::triangle(size_t i) const {
  return {vertex(triangles_[i][0]), vertex(triangles_[i][1]), vertex(triangles_[i][2])};
}

PatchCorners MeshEmitter::patch(size_t i) const {
  return {vertex(patches_[i][0]), vertex(patches_[i][1]), vertex(patches_[i][2]), vertex(patches_[i][3])};
}

DVec3 MeshEmitter::orient(DVec3 normal, DVec3 shading) const {
  if (flip_) normal = -normal;
  return glm::normalize(glm::dot(normal, shading) < 0 ? -normal : normal);
}

DirectionCone MeshEmitter::normals() const {
  std::vector<DVec3> all;
  DVec3 sum(0);
  for (size_t i = 0; i < areas_.size(); ++i) {
    if (!(areas_[i] > 0)) continue;
    if (!patches_.empty() && !is_flat(i)) return {};
    DVec3 normal(0);
    if (patches_.empty()) {
      const std::array<DVec3, 3> c = triangle(i);
      normal = glm::cross(c[1] - c[0], c[2] - c[0]);
    } else {
      normal = patch_normal(patch(i), {0.5, 0.5});
    }
    DVec3 n = orient(normal, DVec3(0));
    if (!normals_.empty()) {
      // Vertex normals that disagree about the side leave it to the point.
      int same = 0, other = 0;
      const auto count = [&](uint32_t v) { (glm::dot(DVec3(normals_[v]), n) > 0 ? same : other) += 1; };
      if (patches_.empty()) {
        for (const uint32_t v : triangles_[i]) count(v);
      } else {
        for (const uint32_t v : patches_[i]) count(v);
      }
      if (same > 0 && other > 0) return {};
      if (other > 0) n = -n;
    }
    all.push_back(n);
    sum += areas_[i] * n;
  }
  const double length = glm::length(sum);
  if (!(length > 0) || !std::isfinite(length)) return {};
  DirectionCone cone{sum / length, 1};
  for (const DVec3 n : all) cone.cos_angle = std::min(cone.cos_angle, glm::dot(n, cone.axis));
  return cone.cos_angle > 0 ? cone : DirectionCone{};
}

std::optional<EmitterSample> MeshEmitter::sample(DVec3 ref, DVec2 u, double u_primitive) const {
  if (!(choice_.total() > 0)) return std::nullopt;
  const auto choice = choice_.sample(u_primitive);
  const size_t i = choice.index;
  double pdf = choice_.probability(i);
  EmitterSample sample;
  sample.primitive = static_cast<uint32_t>(i);
  DVec3 normal, shading(0);
  if (!triangles_.empty()) {
    const std::array<DVec3, 3> corner = triangle(i);
    const auto point = sample_triangle(corner, ref, u);
    if (!point) return std::nullopt;
    const DVec2 b = point->barycentric;
    sample.p = interpolate(corner, b);
    normal = glm::cross(corner[1] - corner[0], corner[2] - corner[0]);
    const auto& v = triangles_[i];
    const float b0 = static_cast<float>(1 - b.x - b.y), b1 = static_cast<float>(b.x), b2 = static_cast<float>(b.y);
    if (!normals_.empty()) shading = DVec3(b0 * normals_[v[0]] + b1 * normals_[v[1]] + b2 * normals_[v[2]]);
    sample.uv = uv_.empty() ? Vec2(b1 + b2, b2) : b0 * uv_[v[0]] + b1 * uv_[v[1]] + b2 * uv_[v[2]];
    pdf *= point->pdf;
  } else {
    const PatchCorners corner = patch(i);
    DVec2 uv = u;
    if (is_flat(i)) {
      const double first = first_half_[i];
      const int which = choice.remainder < first ? 0 : 1;
      const std::array<DVec3, 3> c = half(corner, which);
      const auto point = sample_triangle(c, ref, u);
      if (!point) return std::nullopt;
      sample.p = interpolate(c, point->barycentric);
      const DVec2 b = point->barycentric;
      if (is_parallelogram(corner)) {
        uv = which == 0 ? DVec2(b.x + b.y, b.y) : DVec2(b.x, b.x + b.y);
      } else {
        // Flat but for the rounding of its corners: the point is put back on the surface.
        uv = invert_patch(corner, sample.p);
        sample.p = patch_point(corner, uv);
      }
      pdf *= (which == 0 ? first : 1 - first) * point->pdf;
    } else {
      sample.p = patch_point(corner, u);
      pdf *= patch_uv_pdf(corner, u, ref, sample.p);
    }
    normal = patch_normal(corner, uv);
    const auto& v = patches_[i];
    const Vec2 t(uv);
    const auto blend = [&](const auto& values) {
      return (1 - t.y) * ((1 - t.x) * values[v[0]] + t.x * values[v[1]]) + t.y * ((1 - t.x) * values[v[2]] + t.x * values[v[3]]);
    };
    if (!normals_.empty()) shading = DVec3(blend(normals_));
    sample.uv = uv_.empty() ? t : blend(uv_);
  }
  const DVec3 to_light = sample.p - ref;
  sample.distance = glm::length(to_light);
  if (!(pdf > 0) || !std::isfinite(pdf) || !(sample.distance > 0) || !(glm::dot(normal, normal) > 0)) return std::nullopt;
  sample.wi = to_light / sample.distance;
  sample.along = glm::dot(normal, sample.wi) > 0;
  sample.ng = orient(normal, shading);
  sample.pdf = pdf;
  return sample;
}

double MeshEmitter::pdf(DVec3 ref, const EmitterHit& hit, DVec3 /*wi*/) const {
  const size_t i = hit.primitive;
  const double probability = choice_.probability(i);
  if (!(probability > 0)) return 0;
  const DVec3 p(hit.p);
  double pdf = 0;
  if (!triangles_.empty()) {
    pdf = triangle_pdf(triangle(i), ref, p);
  } else {
    const PatchCorners corner = patch(i);
    if (is_flat(i)) {
      // Which side of the diagonal the point lies on says which triangle it was sampled from.
      const DVec3 normal = patch_normal(corner, {0.5, 0.5});
      const int which = glm::dot(glm::cross(corner[3] - corner[0], p - corner[0]), normal) < 0 ? 0 : 1;
      const double first = first_half_[i];
      pdf = (which == 0 ? first : 1 - first) * triangle_pdf(half(corner, which), ref, p);
    } else {
      pdf = patch_uv_pdf(corner, hit.parameters, ref, p);
    }
  }
  return std::isfinite(pdf) ? probability * pdf : 0;
}

}  // namespace woodcock
