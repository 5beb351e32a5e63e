#include "renderer/world/contacts.h"

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

bool is_passable(const SurfaceInfo& s) { return s.is_interface || s.has_alpha || !s.is_opaque; }

void add_contact(SurfaceInfo& surface, const Box3& box) {
  if (surface.contacts.size() < kMaxBoxes) {
    surface.contacts.push_back(box);
    return;
  }
  Box3 all = box;
  for (const Box3& b : surface.contacts) {
    all.add(b.lower);
    all.add(b.upper);
  }
  surface.contacts = {all};
}

/// Sorts by what the scene says of a surface, not by where it says so.
void find_stacking(const Geometry& geometry, const std::vector<std::string>& medium_names, std::vector<SurfaceInfo>& surfaces) {
  const auto name = [&](int medium) { return medium == kNone ? std::string() : medium_names[static_cast<size_t>(medium)]; };
  const auto key = [&](int i) {
    const SurfaceInfo& s = surfaces[static_cast<size_t>(i)];
    const Box3 box = bounds_of(geometry.shapes()[static_cast<size_t>(i)]);
    return std::tuple(s.light == kNone, is_passable(s), s.is_interface, name(s.inside), name(s.outside),
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

void find_contacts(const Geometry& geometry, const std::vector<std::string>& medium_names, std::vector<SurfaceInfo>& surfaces) {
  const bool any_passable = std::any_of(surfaces.begin(), surfaces.end(), is_passable);
  if (!any_passable) return;
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
    for (SurfaceInfo& s : surfaces) s.contacts = {{scene.lower - margin, scene.upper + margin}};
    return;
  }
  std::sort(placed.begin(), placed.end(), [](const PlacedShape& a, const PlacedShape& b) {
    return std::tie(a.bounds.lower.x, a.shape) < std::tie(b.bounds.lower.x, b.shape);
  });
  for (size_t i = 0; i < placed.size(); ++i) {
    const PlacedShape& a = placed[i];
    SurfaceInfo& sa = surfaces[static_cast<size_t>(a.shape)];
    const bool is_quadric = std::holds_alternative<Quadric>(geometry.shapes()[static_cast<size_t>(a.shape)].geometry);
    if (is_passable(sa) && !is_quadric) add_contact(sa, a.bounds);
    for (size_t j = i + 1; j < placed.size() && placed[j].bounds.lower.x <= a.bounds.upper.x; ++j) {
      const PlacedShape& b = placed[j];
      SurfaceInfo& sb = surfaces[static_cast<size_t>(b.shape)];
      if (!is_passable(sa) && !is_passable(sb)) continue;
      const Box3 common{glm::max(a.bounds.lower, b.bounds.lower), glm::min(a.bounds.upper, b.bounds.upper)};
      if (common.empty()) continue;
      add_contact(sa, common);
      add_contact(sb, common);
    }
  }
}

}  // namespace woodcock
