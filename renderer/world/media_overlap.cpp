#include "renderer/world/media_overlap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <tuple>

#include "renderer/world/coincident_hits.h"
#include "renderer/world/scene_notes.h"

namespace woodcock {
namespace {

/// Bounds of the work: some 10^4 rays at most, a few milliseconds.
constexpr size_t kMaxBoundaries = 4000, kMaxPairs = 256;
constexpr int kPoints = 24, kMaxCrossings = 256;

/// Directions without symmetry, so that rays along edges of aligned boxes are unlikely.
constexpr std::array<Vec3, 3> kDirections{{{0.291f, 0.815f, 0.501f}, {-0.755f, 0.342f, 0.560f}, {0.613f, -0.417f, 0.671f}}};

bool lets_nothing_through(const SurfaceInfo& s) { return !s.is_interface && s.is_opaque && !s.has_alpha; }

bool is_boundary_that_light_passes(const SurfaceInfo& s) { return s.is_boundary && !s.is_absent() && !lets_nothing_through(s); }

/// The shape of a description behind each shape of the geometry.
std::vector<const ShapeDescription*> descriptions_of(const SceneDescription& scene) {
  std::vector<const ShapeDescription*> list;
  for (const ShapeDescription& s : scene.shapes) list.push_back(&s);
  for (const ObjectDescription& o : scene.objects)
    for (const ShapeDescription& s : o.shapes) list.push_back(&s);
  return list;
}

/// How many leading crossings of a shape are exits: what a point lies within.
int exits_first(const std::vector<BoundaryCrossing>& crossings, const BoundaryCrossing& of) {
  int count = 0;
  for (const BoundaryCrossing& c : crossings) {
    if (c.shape != of.shape || c.instance != of.instance) continue;
    if (!c.exit) break;
    ++count;
  }
  return count;
}

struct Pair {
  int a, b;  ///< shapes, the inner one first as far as a ray tells
};

/// Two boundaries around p that do not know of each other, seen along d; nothing where all is right or not known.
std::optional<Pair> overlap_at(const World& world, Vec3 p, Vec3 d) {
  const Crossings way = crossings_along(world, {p, d});
  const std::vector<BoundaryCrossing>& ahead = way.list;
  for (size_t i = 1; i < ahead.size(); ++i) {
    const BoundaryCrossing &inner = ahead[i - 1], &outer = ahead[i];
    if (outer.near == inner.far) continue;
    // Only what is left on both sides of p is surely around it: a surface with a hole is not judged.
    if (!inner.exit || !outer.exit) return std::nullopt;
    const auto [behind, left_body] = crossings_along(world, {p, -d});
    // Nothing is seen within an opaque body.
    if (left_body >= 0 && left_body == way.left_body) return std::nullopt;
    const bool same = inner.shape == outer.shape && inner.instance == outer.instance;
    const int needed = same ? 2 : 1;
    for (const BoundaryCrossing& c : {inner, outer})
      if (exits_first(ahead, c) < needed || exits_first(behind, c) < needed) return std::nullopt;
    return Pair{inner.shape, outer.shape};
  }
  return std::nullopt;
}

/// The fractional part of a multiple of an irrational number: points that fill a box evenly.
Vec3 point_in(const Box3& box, int i) {
  const auto part = [&](double step) {
    const double x = (i + 0.5) * step;
    return static_cast<float>(x - std::floor(x));
  };
  // Powers of 1/1.2207, the root of x⁴ = x + 1 (Roberts 2018).
  return box.lower + box.extent() * Vec3(part(0.8191725133961645), part(0.6710436067037893), part(0.5497004779019703));
}

std::optional<Pair> probe(const World& world, const Box3& box) {
  for (int i = 0; i < kPoints; ++i)
    if (const auto pair = overlap_at(world, point_in(box, i), glm::normalize(kDirections[static_cast<size_t>(i) % kDirections.size()])))
      return pair;
  return std::nullopt;
}

}  // namespace

Crossings crossings_along(const World& world, Ray ray) {
  Crossings result;
  std::vector<BoundaryCrossing>& crossings = result.list;
  const auto info_of = [&](const Hit& hit) -> const SurfaceInfo& { return world.surfaces[static_cast<size_t>(hit.shape)]; };
  /// False where the ray ends.
  const auto cross = [&](const Hit& hit, bool outside) {
    const SurfaceInfo& info = info_of(hit);
    if (info.is_absent()) return true;
    if (lets_nothing_through(info)) {
      if (!outside) result.left_body = hit.shape;
      return false;
    }
    if (info.is_boundary)
      crossings.push_back({hit.shape, hit.instance, !outside, outside ? info.outside : info.inside, outside ? info.inside : info.outside});
    return true;
  };
  for (int i = 0; i < kMaxCrossings; ++i) {
    const auto hit = world.geometry.intersect(ray, kInf);
    if (!hit) break;
    const SurfacePoint s = world.geometry.surface(*hit, ray);
    if (!may_coincide(world, ray, *hit, s.p)) {
      if (!cross(*hit, glm::dot(ray.d, DVec3(s.ng)) < 0)) break;
      ray = ray_from(s, ray.d, ray.time);
      continue;
    }
    CoincidentHits coincident(world, ray, *hit);
    int medium = crossings.empty() ? coincident.medium_before().value_or(kNone) : crossings.back().far;
    for (int member = coincident.next(ray.d, medium); member != kNone; member = coincident.next(ray.d, medium)) {
      if (!cross(coincident[member].hit, coincident[member].outside)) return result;
      if (!crossings.empty()) medium = crossings.back().far;
      coincident.leave(member, ray.d);
    }
    ray = coincident.ray_from(s.p, ray.d, ray.time);
  }
  return result;
}

std::string note_on_overlap(const SceneDescription& scene, const World& world) {
  std::vector<PlacedShape> placed;
  for (const PlacedShape& p : world.geometry.placed_shapes())
    if (is_boundary_that_light_passes(world.surfaces[static_cast<size_t>(p.shape)])) placed.push_back(p);
  if (placed.empty() || placed.size() > kMaxBoundaries) return "";
  std::sort(placed.begin(), placed.end(), [](const PlacedShape& a, const PlacedShape& b) {
    return std::tie(a.bounds.lower.x, a.shape) < std::tie(b.bounds.lower.x, b.shape);
  });
  const auto surface = [&](const PlacedShape& p) -> const SurfaceInfo& { return world.surfaces[static_cast<size_t>(p.shape)]; };
  const auto holds_something = [](const SurfaceInfo& s) { return s.inside != kNone; };
  std::optional<Pair> first;
  size_t probed = 0;
  std::set<std::pair<int, int>> found;
  const auto look_into = [&](const Box3& box) {
    ++probed;
    if (const auto pair = probe(world, box)) {
      if (!first) first = pair;
      found.insert(std::minmax(pair->a, pair->b));
    }
  };
  for (size_t i = 0; i < placed.size() && probed < kMaxPairs; ++i) {
    const PlacedShape& a = placed[i];
    // A mesh may hold bodies that overlap each other.
    if (holds_something(surface(a)) && !std::holds_alternative<Quadric>(world.geometry.shapes()[static_cast<size_t>(a.shape)].geometry))
      look_into(a.bounds);
    for (size_t j = i + 1; j < placed.size() && placed[j].bounds.lower.x <= a.bounds.upper.x && probed < kMaxPairs; ++j) {
      const PlacedShape& b = placed[j];
      if (!holds_something(surface(a)) && !holds_something(surface(b))) continue;
      const Box3 common{glm::max(a.bounds.lower, b.bounds.lower), glm::min(a.bounds.upper, b.bounds.upper)};
      const float size = std::min(glm::length(a.bounds.extent()), glm::length(b.bounds.extent()));
      if (common.empty() || !(min_component(common.extent()) > 1e-4f * size)) continue;
      look_into(common);
    }
  }
  if (!first) return "";
  const std::vector<const ShapeDescription*> shapes = descriptions_of(scene);
  const auto shown = [&](int shape) {
    const int medium = world.surfaces[static_cast<size_t>(shape)].inside;
    return "\"" + (medium == kNone ? std::string() : scene.media[static_cast<size_t>(medium)].name) + "\" of the shape at " +
           place_of(shapes[static_cast<size_t>(shape)]->where);
  };
  return "media overlap: a part of " + shown(first->a) + " lies inside " + shown(first->b) +
         ", and neither boundary names the other's medium as its outside; the boundary that was crossed last counts, and behind the "
         "overlap one medium is missing (as in pbrt-v4). A boundary within a medium names it: MediumInterface \"inner\" \"outer\"; media "
         "that "
         "add up are one of type \"sum\"" +
         (found.size() > 1 ? "; " + std::to_string(found.size()) + " pairs of boundaries overlap so" : "");
}

}  // namespace woodcock
