// What DielectricMeshes keeps of its bodies; for its own source files.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "renderer/geometry/refraction_triangle.h"
#include "renderer/world/depth_grid.h"
#include "renderer/world/dielectric_meshes.h"
#include "renderer/world/mesh_facet.h"

namespace woodcock {

/// Ends a list of facets.
inline constexpr uint32_t kLast = 0xffffffff;

struct DielectricMeshes::Facets {
  std::vector<MeshFacet> all;
  std::vector<std::pair<uint32_t, uint32_t>> range;  ///< of each body: the first, and how many
  std::vector<uint32_t> around;                      ///< facets that meet at a corner, one corner after the other, each up to kLast
  std::vector<DepthGrid> depths;                     ///< of each body
  std::unique_ptr<const Geometry> geometry;          ///< one shape a body, its triangles those of the body

  /// A point of the surface.
  struct Place {
    uint32_t facet;
    DVec2 b;
  };
  std::optional<Place> place_towards(int body, DVec3 x, DVec3 v) const;
  struct WalkEnd {
    Place place;
    RefractedWay way;  ///< of vertex normals
  };
  std::optional<WalkEnd> walk(int body, const Place& from, double eta, DVec3 x, DVec3 y, double longest) const;
  void search_around(const WalkEnd& near, double eta, DVec3 x, DVec3 y, MeshWays& found) const;
  void add_flat(const MeshFacet& facet, double eta, DVec3 x, DVec3 y, MeshWays& found) const;
};

}  // namespace woodcock
