#include "renderer/world/medium_boundaries.h"

#include <algorithm>
#include <array>

#include "renderer/world/coincident_hits.h"

namespace woodcock {
namespace {

/// Directions without symmetry, so that rays along edges of aligned boxes are unlikely.
constexpr std::array<Vec3, 5> kDirections{{{0.267f, 0.802f, 0.535f},
                                           {-0.781f, 0.312f, 0.541f},
                                           {0.371f, -0.557f, -0.743f},
                                           {-0.424f, -0.566f, 0.707f},
                                           {0.653f, 0.230f, -0.722f}}};

/// What most directions say; those that meet no boundary say nothing.
std::optional<int> majority(const std::array<std::optional<int>, kDirections.size()>& votes) {
  std::optional<int> best;
  ptrdiff_t most = 0;
  for (const auto& v : votes) {
    const ptrdiff_t count = std::count(votes.begin(), votes.end(), v);
    if (v && count > most) {
      best = v;
      most = count;
    }
  }
  return best;
}

}  // namespace

std::optional<int> first_near_side(const Geometry& geometry, const std::vector<SurfaceInfo>& surfaces, Ray ray, bool from_outside) {
  for (int crossings = 0; crossings < 1000; ++crossings) {
    const auto hit = geometry.intersect(ray, kInf);
    if (!hit) break;
    const SurfacePoint s = geometry.surface(*hit, ray);
    const SurfaceInfo& info = surfaces[static_cast<size_t>(hit->shape)];
    if (may_coincide(geometry, info, ray, *hit, s.p)) {
      const CoincidentHits coincident(geometry, surfaces, ray, *hit);
      if (const auto medium = coincident.medium_before(from_outside)) return medium;
      ray = coincident.ray_from(s.p, ray.d, ray.time);
      continue;
    }
    // What is never there bounds nothing.
    if (info.is_boundary && !info.is_absent()) return glm::dot(ray.d, DVec3(s.ng)) < 0 ? info.outside : info.inside;
    ray = ray_from(s, ray.d, ray.time);
  }
  return std::nullopt;
}

std::optional<int> find_medium(const Geometry& geometry, const std::vector<SurfaceInfo>& surfaces, DVec3 point) {
  std::array<std::optional<int>, kDirections.size()> votes;
  for (size_t i = 0; i < kDirections.size(); ++i)
    votes[i] = first_near_side(geometry, surfaces, {point, glm::normalize(DVec3(kDirections[i]))});
  return majority(votes);
}

std::optional<int> find_medium_around(const Geometry& geometry, const std::vector<SurfaceInfo>& surfaces) {
  const Box3 box = geometry.bounds();
  if (box.empty()) return std::nullopt;
  std::optional<int> around;
  for (const float sign : {1.0f, -1.0f})
    for (const Vec3 direction : kDirections) {
      const DVec3 d(sign * glm::normalize(direction));
      const auto seen =
          first_near_side(geometry, surfaces, {DVec3(box.center()) - d * static_cast<double>(glm::length(box.extent())), d}, true);
      if (around && seen && *around != *seen) return std::nullopt;
      if (seen) around = seen;
    }
  return around;
}

}  // namespace woodcock
