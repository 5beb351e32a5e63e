#include "renderer/world/overlaps.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <tuple>

namespace woodcock {
namespace {

/// More boxes than this cost a ray more than a search.
constexpr size_t kMaxBoxes = 8;
/// With more shapes than this the search for pairs would be felt at load; all of them are then taken to touch.
constexpr size_t kMaxShapes = 4000;

bool may_let_light_pass(const SurfaceInfo& s) { return s.is_interface || s.has_alpha || !s.is_opaque; }

void add_overlap(SurfaceInfo& surface, const Box3& box) {
  if (surface.overlaps.size() < kMaxBoxes) {
    surface.overlaps.push_back(box);
    return;
  }
  Box3 all = box;
  for (const Box3& b : surface.overlaps) {
    all.add(b.lower);
    all.add(b.upper);
  }
  surface.overlaps = {all};
}

using Triangle = std::array<DVec3, 3>;

/// Whether two triangles of one plane, whose unit normal is n, have more in common than edges and vertices, by the
/// separating axes in the plane. Less than `tolerance` in common is nothing.
bool overlap(const Triangle& a, const Triangle& b, DVec3 n, double tolerance) {
  for (const Triangle* t : {&a, &b}) {
    for (size_t i = 0; i < 3; ++i) {
      const DVec3 axis = glm::normalize(glm::cross(n, (*t)[(i + 1) % 3] - (*t)[i]));
      const auto extent = [&](const Triangle& of) {
        const auto [low, high] = std::minmax({glm::dot(axis, of[0]), glm::dot(axis, of[1]), glm::dot(axis, of[2])});
        return std::pair(low, high);
      };
      const auto [a0, a1] = extent(a);
      const auto [b0, b1] = extent(b);
      if (std::min(a1, b1) - std::max(a0, b0) <= tolerance) return false;
    }
  }
  return true;
}

/// Whether the triangles lie on the surface of one convex body and none on another: then a ray meets two of them at one
/// place at an edge only. Tried for small meshes, such as the boxes around grids.
bool is_part_of_a_hull(const Mesh& mesh) {
  constexpr size_t kMaxTriangles = 128;
  if (mesh.triangles.size() > kMaxTriangles) return false;
  double size = 0;
  for (const DVec3 p : mesh.positions) size = std::max(size, glm::length(p - mesh.positions[0]));
  const double tolerance = 1e-5 * size;
  std::vector<Triangle> triangles;
  std::vector<DVec3> outward;
  for (const auto& t : mesh.triangles) {
    triangles.push_back({mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]});
    const Triangle& c = triangles.back();
    const DVec3 n = glm::normalize(glm::cross(c[1] - c[0], c[2] - c[0]));
    double below = 0, above = 0;
    for (const DVec3 p : mesh.positions) {
      const double distance = glm::dot(p - c[0], n);
      below = std::min(below, distance);
      above = std::max(above, distance);
    }
    if (std::min(-below, above) > tolerance) return false;
    outward.push_back(-below > above ? n : -n);
    // Flat meshes have no outside: only that none lies on another counts.
    for (size_t other = 0; other + 1 < triangles.size(); ++other) {
      const bool one_plane = std::abs(glm::dot(outward[other], outward.back())) > 1 - 1e-9 &&
                             std::abs(glm::dot(triangles[other][0] - c[0], outward.back())) <= tolerance;
      if (one_plane && overlap(triangles[other], c, outward.back(), tolerance)) return false;
    }
  }
  return true;
}

/// Sorts by what the scene says of a surface, not by where it says so.
void find_stacking(const Geometry& geometry, const std::vector<std::string>& medium_names, std::vector<SurfaceInfo>& surfaces) {
  const auto name = [&](int medium) { return medium == kNone ? std::string() : medium_names[static_cast<size_t>(medium)]; };
  const auto key = [&](int i) {
    const SurfaceInfo& s = surfaces[static_cast<size_t>(i)];
    const Box3 box = bounds_of(geometry.shapes()[static_cast<size_t>(i)]);
    return std::tuple(s.light == kNone, may_let_light_pass(s), s.is_interface, name(s.inside), name(s.outside),
                      std::array{box.lower.x, box.lower.y, box.lower.z, box.upper.x, box.upper.y, box.upper.z});
  };
  std::vector<decltype(key(0))> keys;
  for (size_t i = 0; i < surfaces.size(); ++i) keys.push_back(key(static_cast<int>(i)));
  std::vector<size_t> order(surfaces.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return keys[a] < keys[b]; });
  for (size_t i = 0; i < order.size(); ++i) surfaces[order[i]].stacking = static_cast<int>(i);
}

}  // namespace

void find_overlaps(const Geometry& geometry, const std::vector<std::string>& medium_names, std::vector<SurfaceInfo>& surfaces) {
  const bool any_lets_light_pass = std::any_of(surfaces.begin(), surfaces.end(), may_let_light_pass);
  if (!any_lets_light_pass) return;
  find_stacking(geometry, medium_names, surfaces);

  const Box3 scene = geometry.bounds();
  if (scene.empty()) return;
  const float margin = 0x1p-18f * max_component(glm::max(glm::abs(scene.lower), glm::abs(scene.upper)));
  std::vector<PlacedShape> placed = geometry.placed_shapes();
  for (PlacedShape& p : placed) {
    p.bounds.lower -= margin;
    p.bounds.upper += margin;
  }
  if (placed.size() > kMaxShapes) {
    for (SurfaceInfo& s : surfaces) s.overlaps = {{scene.lower - margin, scene.upper + margin}};
    return;
  }
  std::sort(placed.begin(), placed.end(), [](const PlacedShape& a, const PlacedShape& b) {
    return std::tie(a.bounds.lower.x, a.shape) < std::tie(b.bounds.lower.x, b.shape);
  });
  for (size_t i = 0; i < placed.size(); ++i) {
    const PlacedShape& a = placed[i];
    SurfaceInfo& sa = surfaces[static_cast<size_t>(a.shape)];
    const bool is_quadric = std::holds_alternative<Quadric>(geometry.shapes()[static_cast<size_t>(a.shape)].geometry);
    if (may_let_light_pass(sa) && !is_quadric) {
      const auto* mesh = std::get_if<Mesh>(&geometry.shapes()[static_cast<size_t>(a.shape)].geometry);
      sa.edges_touch = sa.edges_touch || (mesh != nullptr && is_part_of_a_hull(*mesh));
      if (!sa.edges_touch) add_overlap(sa, a.bounds);
    }
    for (size_t j = i + 1; j < placed.size() && placed[j].bounds.lower.x <= a.bounds.upper.x; ++j) {
      const PlacedShape& b = placed[j];
      SurfaceInfo& sb = surfaces[static_cast<size_t>(b.shape)];
      if (!may_let_light_pass(sa) && !may_let_light_pass(sb)) continue;
      const Box3 common{glm::max(a.bounds.lower, b.bounds.lower), glm::min(a.bounds.upper, b.bounds.upper)};
      if (common.empty()) continue;
      add_overlap(sa, common);
      add_overlap(sb, common);
    }
  }
}

}  // namespace woodcock
