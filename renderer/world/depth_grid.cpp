#include "renderer/world/depth_grid.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace woodcock {

DepthGrid::DepthGrid(DVec3 lower, DVec3 upper, std::span<const MeshFacet> facets) : lower_(lower) {
  const DVec3 extent = upper - lower;
  cell_ = std::max({extent.x, extent.y, extent.z}) / kCells;
  for (int i = 0; i < 3; ++i) size_[i] = std::clamp(static_cast<int>(std::ceil(extent[i] / cell_)), 1, kCells);
  // Squares of distances in cells; those of cells that the box of a triangle meets are 0.
  constexpr float kFar = 1e9f;
  depth_.assign(static_cast<size_t>(size_.x) * static_cast<size_t>(size_.y) * static_cast<size_t>(size_.z), kFar);
  for (const MeshFacet& f : facets) {
    const double margin = 1e-3 * cell_;
    const IVec3 first = cell_at(glm::min(f.p[0], glm::min(f.p[1], f.p[2])) - margin),
                last = cell_at(glm::max(f.p[0], glm::max(f.p[1], f.p[2])) + margin);
    for (int z = first.z; z <= last.z; ++z)
      for (int y = first.y; y <= last.y; ++y)
        for (int x = first.x; x <= last.x; ++x)
          if (may_meet(f, {x, y, z})) depth_[index({x, y, z})] = 0;
  }
  const std::vector<char> outside = find_outside(facets, kFar);
  for (int axis = 0; axis < 3; ++axis) spread(axis);
  for (size_t i = 0; i < depth_.size(); ++i)
    depth_[i] = outside[i] != 0 ? 0 : static_cast<float>(cell_ * (1 - 1e-6) * std::sqrt(static_cast<double>(depth_[i])));
}

double DepthGrid::at(DVec3 p) const {
  if (depth_.empty()) return 0;
  const DVec3 q = (p - lower_) / cell_;
  if (!glm::all(glm::greaterThanEqual(q, DVec3(0))) || !glm::all(glm::lessThan(q, DVec3(size_)))) return 0;
  return static_cast<double>(depth_[index(IVec3(q))]);
}

bool DepthGrid::may_meet(const MeshFacet& f, IVec3 c) const {
  const DVec3 middle = lower_ + cell_ * (DVec3(c) + 0.5), n = glm::abs(f.n);
  return std::abs(glm::dot(middle - f.p[0], f.n)) <= 0.501 * cell_ * (n.x + n.y + n.z);
}

std::vector<char> DepthGrid::find_outside(std::span<const MeshFacet> facets, float far) const {
  constexpr int kMaxRooms = 16;
  std::vector<char> outside(depth_.size(), 1);
  std::vector<bool> seen(depth_.size());
  std::vector<IVec3> room;
  const auto visit = [&](IVec3 c) {
    if (glm::any(glm::lessThan(c, IVec3(0))) || glm::any(glm::greaterThanEqual(c, size_))) return;
    if (seen[index(c)] || depth_[index(c)] < far) return;
    seen[index(c)] = true;
    room.push_back(c);
  };
  int rooms = 0;
  for (int z = 0; z < size_.z; ++z)
    for (int y = 0; y < size_.y; ++y)
      for (int x = 0; x < size_.x; ++x) {
        room.clear();
        visit({x, y, z});
        if (room.empty() || ++rooms > kMaxRooms) continue;
        for (size_t i = 0; i < room.size(); ++i)
          for (int axis = 0; axis < 3; ++axis)
            for (const int step : {-1, 1}) {
              IVec3 next = room[i];
              next[axis] += step;
              visit(next);
            }
        if (!is_inside(facets, lower_ + cell_ * (DVec3(x, y, z) + 0.5))) continue;
        for (const IVec3 c : room) outside[index(c)] = 0;
      }
  return outside;
}

bool DepthGrid::is_inside(std::span<const MeshFacet> facets, DVec3 p) {
  double sum = 0;
  for (const MeshFacet& f : facets) {
    const DVec3 a = f.p[0] - p, b = f.p[1] - p, c = f.p[2] - p;
    const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
    const double half =
        std::atan2(std::abs(glm::dot(a, glm::cross(b, c))), la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb);
    sum += glm::dot(a, f.n) > 0 ? half : -half;
  }
  return sum > std::numbers::pi;
}

void DepthGrid::spread(int axis) {
  const std::vector<float> before = depth_;
  for (int z = 0; z < size_.z; ++z)
    for (int y = 0; y < size_.y; ++y)
      for (int x = 0; x < size_.x; ++x) {
        IVec3 c(x, y, z);
        float& least = depth_[index(c)];
        const int here = c[axis];
        for (int other = 0; other < size_[axis]; ++other) {
          c[axis] = other;
          const auto room = static_cast<float>(std::max(0, std::abs(other - here) - 1));
          least = std::min(least, before[index(c)] + room * room);
        }
      }
}

}  // namespace woodcock
