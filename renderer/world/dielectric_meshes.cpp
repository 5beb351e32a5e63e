#include "renderer/world/dielectric_meshes.h"

#include <algorithm>
#include <cmath>

#include "renderer/world/dielectric_facets.h"

namespace woodcock {
namespace {

/// Barycentric coordinates of the second and third corner.
DVec2 coordinates(const std::array<DVec3, 3>& p, DVec3 v) {
  const DVec3 e1 = p[1] - p[0], e2 = p[2] - p[0], r = v - p[0];
  const double g11 = glm::dot(e1, e1), g12 = glm::dot(e1, e2), g22 = glm::dot(e2, e2), det = g11 * g22 - g12 * g12;
  const double r1 = glm::dot(r, e1), r2 = glm::dot(r, e2);
  return {(g22 * r1 - g12 * r2) / det, (g11 * r2 - g12 * r1) / det};
}

bool is_within(DVec2 b) { return b.x >= 0 && b.y >= 0 && b.x + b.y <= 1; }

/// The way through a flat facet's plane, and where.
struct PlaneWay {
  RefractedWay way;
  DVec2 b;
};
std::optional<PlaneWay> plane_way(const MeshFacet& f, double eta, DVec3 x, DVec3 y, double larger_sine = 0) {
  const auto way = way_through_plane(f.p[0], f.n, eta, x, y, larger_sine);
  if (!way) return std::nullopt;
  return PlaneWay{*way, coordinates(f.p, way->v)};
}

}  // namespace

double DielectricMeshes::depth(DVec3 p) const {
  double deepest = 0;
  for (size_t i = 0; i < bodies_.size(); ++i) deepest = std::max(deepest, facets_->depths[i].at(p));
  return deepest;
}

std::optional<DielectricMeshes::Exit> DielectricMeshes::exit_towards(DVec3 from, DVec3 d, double distance) const {
  const auto is_around = [&](const Body& b) { return glm::all(glm::greaterThan(from, b.lower)) && glm::all(glm::lessThan(from, b.upper)); };
  if (std::none_of(bodies_.begin(), bodies_.end(), is_around)) return std::nullopt;
  const auto hit = facets_->geometry->intersect({from, d}, distance);
  if (!hit) return std::nullopt;
  const Body& body = bodies_[static_cast<size_t>(hit->shape)];
  const uint32_t facet = facets_->range[static_cast<size_t>(hit->shape)].first + hit->primitive;
  if (!(glm::dot(d, facets_->all[facet].n) > 0)) return std::nullopt;
  return Exit{&body, facet, hit->t};
}

/// Where the ray from x towards v leaves the body.
std::optional<DielectricMeshes::Facets::Place> DielectricMeshes::Facets::place_towards(int body, DVec3 x, DVec3 v) const {
  const auto hit = geometry->intersect({x, glm::normalize(v - x)}, kInf);
  if (!hit || hit->shape != body) return std::nullopt;
  return Place{range[static_cast<size_t>(body)].first + hit->primitive, hit->uv};
}

/// Newton's steps along the surface, each projected onto it from x and shortened until it comes nearer to Snell's law (Jakob & Marschner
/// 2012). Ends at a way, or, on flat facets, at one that the step does not leave.
std::optional<DielectricMeshes::Facets::WalkEnd> DielectricMeshes::Facets::walk(int body, const Place& from, double eta, DVec3 x, DVec3 y,
                                                                                double longest) const {
  constexpr int kSteps = 16, kHalvings = 6;
  constexpr double kDone = 1e-12, kGoodEnough = 1e-9;
  Place place = from;
  RefractionStep step = refraction_step(all[place.facet].shaded(), place.b, eta, x, y);
  const auto go_to = [&](const Place& next) {
    const RefractionStep there = refraction_step(all[next.facet].shaded(), next.b, eta, x, y);
    if (!(there.error < step.error)) return false;
    place = next;
    step = there;
    return true;
  };
  // The straight way may be far off where x lies near the surface; the plane that touches it there is solved at once.
  {
    const ShadedTriangle t = all[place.facet].shaded();
    if (const auto way = way_through_plane(t.at(place.b), t.normal_at(place.b), eta, x, y))
      if (const auto next = place_towards(body, x, way->v)) go_to(*next);
  }
  for (int i = 0; i < kSteps && step.error > kDone; ++i) {
    const MeshFacet& f = all[place.facet];
    if (!std::isfinite(step.step.x + step.step.y) || glm::distance(step.way.v, x) > longest) return std::nullopt;
    if (f.is_flat && is_within(place.b + step.step)) break;
    bool moved = false;
    double part = 1;
    for (int k = 0; k < kHalvings && !moved; ++k, part *= 0.5) {
      const DVec2 b = place.b + part * step.step;
      if (is_within(b)) {
        moved = go_to({place.facet, b});
      } else if (const auto next = place_towards(body, x, f.shaded().at(b))) {
        moved = go_to(*next);
      }
    }
    if (!moved) break;
  }
  if (!all[place.facet].is_flat && !(step.error < kGoodEnough && step.crosses)) return std::nullopt;
  return WalkEnd{place, step.way};
}

void DielectricMeshes::Facets::add_flat(const MeshFacet& facet, double eta, DVec3 x, DVec3 y, MeshWays& found) const {
  const auto plane = plane_way(facet, eta, x, y);
  if (plane && is_within(plane->b)) found.add({plane->way, facet.hit(plane->b), true});
}

/// All flat facets around one, as far as the ways through their planes pass near by them.
void DielectricMeshes::Facets::search_around(const WalkEnd& near, double eta, DVec3 x, DVec3 y, MeshWays& found) const {
  constexpr size_t kMax = 48;
  constexpr double kReach = 0.5;
  const double cosine = eta > 1 ? near.way.cos_t : near.way.cos_i, sine = std::sqrt(std::max(0.0, (1 - cosine) * (1 + cosine)));
  std::array<uint32_t, kMax> queue{near.place.facet};
  size_t count = 1;
  for (size_t i = 0; i < count; ++i) {
    const MeshFacet& f = all[queue[i]];
    if (!f.is_flat) continue;
    const auto plane = plane_way(f, eta, x, y, sine);
    if (plane && is_within(plane->b)) found.add({plane->way, f.hit(plane->b), true});
    if (i > 0 && !(plane && std::min({plane->b.x, plane->b.y, 1 - plane->b.x - plane->b.y}) > -kReach)) continue;
    for (const uint32_t corner : f.corners)
      for (uint32_t k = corner; around[k] != kLast; ++k)
        if (count < kMax && std::find(queue.begin(), queue.begin() + static_cast<ptrdiff_t>(count), around[k]) ==
                                queue.begin() + static_cast<ptrdiff_t>(count))
          queue[count++] = around[k];
  }
}

MeshWays DielectricMeshes::ways(const Exit& exit, DVec3 x, DVec3 y) const {
  MeshWays found;
  const auto body = static_cast<int>(exit.body - bodies_.data());
  const double eta = static_cast<double>(exit.body->eta);
  const auto [first, count] = facets_->range[static_cast<size_t>(body)];
  const auto& all = facets_->all;
  const bool is_small = count <= kMaxSearched;
  if (is_small)
    for (uint32_t i = first; i < first + count; ++i)
      if (all[i].is_flat) facets_->add_flat(all[i], eta, x, y, found);
  if (is_small && all[first].is_flat) return found;
  if (exit.distance > exit.body->longest) return found;
  const DVec3 v = x + exit.distance / glm::distance(x, y) * (y - x);
  const auto end = facets_->walk(body, {exit.facet, coordinates(all[exit.facet].p, v)}, eta, x, y, exit.body->longest);
  if (!end) return found;
  const MeshFacet& f = all[end->place.facet];
  if (!f.is_flat) {
    found.add({end->way, f.hit(end->place.b), false});
  } else if (!is_small) {
    facets_->search_around(*end, eta, x, y, found);
  }
  return found;
}

}  // namespace woodcock
