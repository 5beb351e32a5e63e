// How deep a point lies in a closed mesh.
#pragma once

#include <span>
#include <vector>

#include "renderer/world/mesh_facet.h"

namespace woodcock {

/// Lower bounds of the distance to the triangles of a body, cell by cell of a grid over its box; 0 outside of the body.
class DepthGrid {
 public:
  DepthGrid() = default;
  DepthGrid(DVec3 lower, DVec3 upper, std::span<const MeshFacet> facets);

  double at(DVec3 p) const;

 private:
  static constexpr int kCells = 48;

  size_t index(IVec3 c) const {
    return (static_cast<size_t>(c.z) * static_cast<size_t>(size_.y) + static_cast<size_t>(c.y)) * static_cast<size_t>(size_.x) +
           static_cast<size_t>(c.x);
  }
  IVec3 cell_at(DVec3 p) const { return glm::clamp(IVec3(glm::floor((p - lower_) / cell_)), IVec3(0), size_ - 1); }

  /// Whether the plane of the triangle passes the cell, or next to it.
  bool may_meet(const MeshFacet& f, IVec3 c) const;

  /// Which cells lie outside, or are not known to lie inside: cells that meet each other apart from the surface lie on one side of it.
  std::vector<char> find_outside(std::span<const MeshFacet> facets, float far) const;

  /// By the solid angle under which p sees the body from its inner side (Van Oosterom & Strackee 1983): 4π inside, 0 outside.
  static bool is_inside(std::span<const MeshFacet> facets, DVec3 p);

  /// min over the cells of a line of their value and the square of the room between the two cells.
  void spread(int axis);

  DVec3 lower_{0};
  double cell_ = 1;
  IVec3 size_{0};
  std::vector<float> depth_;
};

}  // namespace woodcock
