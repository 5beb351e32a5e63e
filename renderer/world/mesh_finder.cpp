// Finds the closed meshes of smooth glass in a scene.
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <tuple>

#include "renderer/core/transform.h"
#include "renderer/geometry/patch.h"
#include "renderer/world/dielectric_facets.h"
#include "renderer/world/glass_shapes.h"

namespace woodcock {
namespace {

/// Of the medium inside, after which a hundredth of the light is left or less.
constexpr double kFreePaths = 5;

/// More triangles than this in shapes that are alike are left to chance: they would be kept twice.
constexpr size_t kMaxTriangles = size_t{1} << 21;

bool is_apart(const Box3& a, DVec3 lower, DVec3 upper) {
  const double margin = 1e-6 * glm::length(upper - lower);
  return glm::any(glm::lessThan(DVec3(a.upper), lower + margin)) || glm::any(glm::greaterThan(DVec3(a.lower), upper - margin));
}

/// Whether no corner lies before the plane of a facet. Large bodies are not asked.
bool is_convex(std::span<const MeshFacet> facets, double size) {
  constexpr size_t kMax = 4096;
  if (facets.size() > kMax) return false;
  return std::all_of(facets.begin(), facets.end(), [&](const MeshFacet& f) {
    return std::all_of(facets.begin(), facets.end(), [&](const MeshFacet& g) {
      return std::all_of(g.p.begin(), g.p.end(), [&](DVec3 p) { return glm::dot(p - f.p[0], f.n) <= 1e-12 * size; });
    });
  });
}

/// Disjoint sets of numbers.
class Sets {
 public:
  explicit Sets(size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), uint32_t{0}); }
  uint32_t find(uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(uint32_t a, uint32_t b) {
    a = find(a);
    b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<uint32_t> parent_;
};

}  // namespace

class MeshFinder {
 public:
  explicit MeshFinder(const GlassScene& glass) : glass_(glass), placed_(glass.geometry.placed_shapes()) {}

  void add(int shape, int instance, const DMat4& render_from_space) {
    const SurfaceInfo& info = glass_.surfaces[static_cast<size_t>(shape)];
    const Shape& geometric = glass_.geometry.shapes()[static_cast<size_t>(shape)];
    const float eta = smooth_glass_index(glass_.scene, info);
    if (eta == 1 || std::holds_alternative<Quadric>(geometric.geometry)) return;
    Alike& alike = alike_[std::tuple(eta, info.is_boundary, info.inside, info.outside)];
    alike.info = &info;
    alike.eta = eta;
    const DMat4 inverse = glm::inverse(render_from_space);
    using Normals = std::array<DVec3, 3>;
    const auto facet = [&](DVec3 p0, DVec3 p1, DVec3 p2, const Normals* normals, uint32_t primitive, MeshFacet::Part part) {
      // As Geometry::surface has it.
      DVec3 ng = glm::cross(p1 - p0, p2 - p0);
      if (geometric.flip) ng = -ng;
      if (normals != nullptr && glm::dot((*normals)[0], ng) < 0) ng = -ng;
      Normals shading{};
      for (size_t k = 0; k < 3 && normals != nullptr; ++k) shading[k] = transform_normal(inverse, (*normals)[k]);
      const auto placed = [&](DVec3 q) { return transform_point(render_from_space, q); };
      alike.facets.push_back({{placed(p0), placed(p1), placed(p2)},
                              glm::normalize(transform_normal(inverse, ng)),
                              shape,
                              instance,
                              primitive,
                              part,
                              shading,
                              normals == nullptr,
                              {}});
    };
    if (const auto* mesh = std::get_if<Mesh>(&geometric.geometry)) {
      for (uint32_t i = 0; i < mesh->triangles.size(); ++i) {
        const auto& t = mesh->triangles[i];
        Normals normals{};
        for (size_t k = 0; k < 3 && !mesh->normals.empty(); ++k) normals[k] = DVec3(mesh->normals[t[k]]);
        facet(mesh->positions[t[0]], mesh->positions[t[1]], mesh->positions[t[2]], mesh->normals.empty() ? nullptr : &normals, i,
              MeshFacet::Part::kTriangle);
      }
    } else {
      const auto& patches = std::get<PatchMesh>(geometric.geometry);
      if (!patches.normals.empty()) return;
      for (uint32_t i = 0; i < patches.patches.size(); ++i) {
        const auto& q = patches.patches[i];
        const PatchCorners c{patches.positions[q[0]], patches.positions[q[1]], patches.positions[q[2]], patches.positions[q[3]]};
        // A hole, through which nothing counts as closed.
        if (glm::distance(c[1] - c[0], c[3] - c[2]) > 1e-12 * (glm::distance(c[1], c[2]) + glm::distance(c[0], c[3]))) continue;
        facet(c[0], c[1], c[3], nullptr, i, MeshFacet::Part::kLowerHalf);
        facet(c[0], c[3], c[2], nullptr, i, MeshFacet::Part::kUpperHalf);
      }
    }
  }

  void find(DielectricMeshes& found) {
    for (auto& [key, alike] : alike_)
      if (alike.facets.size() <= kMaxTriangles) find_closed(alike, found);
    if (found.bodies_.empty()) return;
    std::vector<Shape> shapes;
    for (const auto& [first, count] : facets_.range) {
      Mesh mesh;
      for (uint32_t i = 0; i < count; ++i) {
        const MeshFacet& f = facets_.all[first + i];
        mesh.positions.insert(mesh.positions.end(), f.p.begin(), f.p.end());
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
      }
      shapes.push_back({std::move(mesh), false});
    }
    const int count = static_cast<int>(shapes.size());
    facets_.geometry = std::make_unique<const Geometry>(std::move(shapes), count, std::vector<Geometry::Object>{},
                                                        std::vector<Geometry::Instance>{}, Geometry::Starts::kAnywhere);
    found.facets_ = std::make_shared<const DielectricMeshes::Facets>(std::move(facets_));
  }

 private:
  using Body = DielectricMeshes::Body;
  struct Alike {
    const SurfaceInfo* info = nullptr;
    float eta = 1;
    std::vector<MeshFacet> facets;
  };

  static void weld(std::vector<MeshFacet>& facets) {
    std::vector<DVec3> at;
    for (const MeshFacet& f : facets) at.insert(at.end(), f.p.begin(), f.p.end());
    std::vector<uint32_t> order(at.size());
    std::iota(order.begin(), order.end(), uint32_t{0});
    const auto less = [&](uint32_t a, uint32_t b) {
      return std::tie(at[a].x, at[a].y, at[a].z, a) < std::tie(at[b].x, at[b].y, at[b].z, b);
    };
    std::sort(order.begin(), order.end(), less);
    uint32_t name = 0;
    for (size_t i = 0; i < order.size(); ++i) {
      if (i == 0 || at[order[i]] != at[order[i - 1]]) name = order[i];
      facets[order[i] / 3].corners[order[i] % 3] = name;
    }
  }

  void find_closed(Alike& alike, DielectricMeshes& found) {
    std::vector<MeshFacet>& facets = alike.facets;
    weld(facets);
    struct Edge {
      uint32_t low, high, facet;
      bool forwards;
    };
    std::vector<Edge> edges;
    for (uint32_t i = 0; i < facets.size(); ++i) {
      const auto& p = facets[i].p;
      const bool turned = glm::dot(glm::cross(p[1] - p[0], p[2] - p[0]), facets[i].n) < 0;
      for (size_t k = 0; k < 3; ++k) {
        const uint32_t a = facets[i].corners[k], b = facets[i].corners[(k + 1) % 3];
        edges.push_back({std::min(a, b), std::max(a, b), i, (a < b) != turned});
      }
    }
    std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
      return std::tie(a.low, a.high, a.facet, a.forwards) < std::tie(b.low, b.high, b.facet, b.forwards);
    });
    Sets sets(facets.size());
    std::vector<uint32_t> open;
    for (size_t i = 0, end = 0; i < edges.size(); i = end) {
      while (end < edges.size() && edges[end].low == edges[i].low && edges[end].high == edges[i].high) ++end;
      if (end - i == 2 && edges[i].forwards != edges[i + 1].forwards && edges[i].low != edges[i].high)
        sets.join(edges[i].facet, edges[i + 1].facet);
      else
        for (size_t k = i; k < end; ++k) open.push_back(edges[k].facet);
    }
    std::vector<bool> is_open(facets.size());
    for (const uint32_t i : open) is_open[sets.find(i)] = true;
    std::map<uint32_t, std::vector<uint32_t>> closed;
    for (uint32_t i = 0; i < facets.size(); ++i)
      if (!is_open[sets.find(i)]) closed[sets.find(i)].push_back(i);
    for (const auto& [first, members] : closed) add_body(alike, members, found);
  }

  void add_body(const Alike& alike, const std::vector<uint32_t>& members, DielectricMeshes& found) {
    Body body;
    body.lower = body.upper = alike.facets[members.front()].p[0];
    const DVec3 origin = body.lower;
    double volume = 0;
    std::vector<int> own;
    for (const uint32_t i : members) {
      const MeshFacet& f = alike.facets[i];
      for (const DVec3 p : f.p) {
        body.lower = glm::min(body.lower, p);
        body.upper = glm::max(body.upper, p);
      }
      volume += glm::dot(f.p[0] - origin, f.n) * glm::length(glm::cross(f.p[1] - f.p[0], f.p[2] - f.p[0]));
      if (own.empty() || own.back() != f.shape) own.push_back(f.shape);
    }
    const SurfaceInfo& info = *alike.info;
    const bool outwards = volume > 0;
    const int inside = info.is_boundary ? (outwards ? info.inside : info.outside) : kNone;
    const bool scatters = inside != kNone && glass_.media[inside].scatters();
    const double rim = 1e-6 * body.size();
    const auto is_lamp_inside = [&](DVec3 p) {
      return glm::all(glm::greaterThan(p, body.lower - rim)) && glm::all(glm::lessThan(p, body.upper + rim));
    };
    const auto is_inside = [&](const PlacedShape& other) {
      return std::find(own.begin(), own.end(), other.shape) == own.end() && !is_apart(other.bounds, body.lower, body.upper);
    };
    const bool has_shapes = std::any_of(placed_.begin(), placed_.end(), is_inside);
    if (volume == 0 || (!scatters && !has_shapes)) return;
    body.eta = outwards ? alike.eta : 1 / alike.eta;
    const auto first = static_cast<uint32_t>(facets_.all.size()), count = static_cast<uint32_t>(members.size());
    facets_.range.emplace_back(first, count);
    for (const uint32_t i : members) {
      MeshFacet f = alike.facets[i];
      if (!outwards) {
        f.n = -f.n;
        for (DVec3& normal : f.normals) normal = -normal;
      }
      facets_.all.push_back(f);
    }
    const std::span<MeshFacet> facets = std::span(facets_.all).subspan(first, count);
    connect(facets, first);
    const bool is_empty = !has_shapes && std::none_of(glass_.light_positions.begin(), glass_.light_positions.end(), is_lamp_inside);
    body.is_clear = is_empty && is_convex(facets, body.size());
    if (inside != kNone && glass_.media[inside].is_homogeneous()) {
      const double sigma = static_cast<double>(min_component(glass_.media[inside].homogeneous().sigma_t));
      if (sigma > 0) body.longest = kFreePaths / sigma;
    }
    facets_.depths.push_back(is_empty ? DepthGrid(body.lower, body.upper, facets) : DepthGrid());
    found.bodies_.push_back(body);
  }

  /// Notes which facets meet at each corner, and gives flat ones the normals to be found by.
  void connect(std::span<MeshFacet> body, uint32_t first) {
    /// Facets that meet at a sharper edge than this do not count as one curved surface.
    constexpr double kCrease = 0.7;
    std::vector<std::pair<uint32_t, uint32_t>> at;
    for (uint32_t i = 0; i < body.size(); ++i)
      for (const uint32_t corner : body[i].corners) at.emplace_back(corner, i);
    std::sort(at.begin(), at.end());
    for (size_t i = 0, end = 0; i < at.size(); i = end) {
      const auto name = static_cast<uint32_t>(facets_.around.size());
      while (end < at.size() && at[end].first == at[i].first) facets_.around.push_back(first + at[end++].second);
      facets_.around.push_back(kLast);
      for (size_t k = i; k < end; ++k) {
        MeshFacet& f = body[at[k].second];
        for (size_t c = 0; c < 3; ++c) {
          if (f.corners[c] != at[i].first || f.corners_named[c]) continue;
          f.corners[c] = name;
          f.corners_named[c] = true;
          if (!f.is_flat) continue;
          DVec3 sum(0);
          for (size_t other = i; other < end; ++other) {
            const MeshFacet& g = body[at[other].second];
            if (glm::dot(g.n, f.n) > kCrease) sum += glm::length(glm::cross(g.p[1] - g.p[0], g.p[2] - g.p[0])) * g.n;
          }
          f.normals[c] = glm::normalize(sum);
        }
      }
    }
  }

  const GlassScene& glass_;
  std::vector<PlacedShape> placed_;
  std::map<std::tuple<float, bool, int, int>, Alike> alike_;
  DielectricMeshes::Facets facets_;
};

DielectricMeshes::DielectricMeshes(const GlassScene& glass) {
  MeshFinder finder(glass);
  glass.for_each_shape([&](const ShapeDescription&, int shape, int instance, const DMat4& render_from_space) {
    finder.add(shape, instance, render_from_space);
  });
  finder.find(*this);
}

}  // namespace woodcock
