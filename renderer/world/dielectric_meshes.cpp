#include "renderer/world/dielectric_meshes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <tuple>

#include "renderer/core/transform.h"
#include "renderer/geometry/patch.h"
#include "renderer/geometry/refraction_triangle.h"
#include "renderer/world/glass_shapes.h"

namespace woodcock {
namespace {

/// A triangle of a shape, or half of a quadrilateral.
struct Facet {
  std::array<DVec3, 3> p;
  DVec3 n;  ///< unit, out of the body
  int shape, instance;
  uint32_t primitive;
  enum class Part : uint8_t { kTriangle, kLowerHalf, kUpperHalf } part;
  /// What the shading normal is interpolated from; of a flat facet the means of the facets around each corner, by which it is found but not
  /// refracted.
  std::array<DVec3, 3> normals;
  bool is_flat;
  std::array<uint32_t, 3> corners;  ///< numbers, equal where positions are; in the end where `around` has the facets that meet there
  std::array<bool, 3> corners_named{};

  /// At these barycentric coordinates of the second and third corner.
  Hit hit(DVec2 b) const {
    if (part == Part::kLowerHalf) b = {b.x + b.y, b.y};
    if (part == Part::kUpperHalf) b = {b.x, b.x + b.y};
    return {0, b, shape, primitive, instance};
  }

  ShadedTriangle shaded() const { return {p[0], p[1] - p[0], p[2] - p[0], n, normals}; }
};

/// Ends a list of facets.
constexpr uint32_t kLast = 0xffffffff;

/// Of the medium inside, after which a hundredth of the light is left or less.
constexpr double kFreePaths = 5;

/// More triangles than this in shapes that are alike are left to chance: they would be kept twice.
constexpr size_t kMostTriangles = size_t{1} << 21;

bool is_apart(const Box3& a, DVec3 lower, DVec3 upper) {
  const double margin = 1e-6 * glm::length(upper - lower);
  return glm::any(glm::lessThan(DVec3(a.upper), lower + margin)) || glm::any(glm::greaterThan(DVec3(a.lower), upper - margin));
}

/// Barycentric coordinates of the second and third corner.
DVec2 coordinates(const std::array<DVec3, 3>& p, DVec3 v) {
  const DVec3 e1 = p[1] - p[0], e2 = p[2] - p[0], r = v - p[0];
  const double g11 = glm::dot(e1, e1), g12 = glm::dot(e1, e2), g22 = glm::dot(e2, e2), det = g11 * g22 - g12 * g12;
  const double r1 = glm::dot(r, e1), r2 = glm::dot(r, e2);
  return {(g22 * r1 - g12 * r2) / det, (g11 * r2 - g12 * r1) / det};
}

/// Lower bounds of the distance to the triangles of a body, cell by cell of a grid over its box; 0 outside of the body.
class DepthGrid {
 public:
  DepthGrid() = default;
  DepthGrid(DVec3 lower, DVec3 upper, std::span<const Facet> facets) : lower_(lower) {
    const DVec3 extent = upper - lower;
    cell_ = std::max({extent.x, extent.y, extent.z}) / kCells;
    for (int i = 0; i < 3; ++i) size_[i] = std::clamp(static_cast<int>(std::ceil(extent[i] / cell_)), 1, kCells);
    // Squares of distances in cells; those of cells that the box of a triangle meets are 0.
    constexpr float kFar = 1e9f;
    depth_.assign(static_cast<size_t>(size_.x) * static_cast<size_t>(size_.y) * static_cast<size_t>(size_.z), kFar);
    for (const Facet& f : facets) {
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

  double at(DVec3 p) const {
    if (depth_.empty()) return 0;
    const DVec3 q = (p - lower_) / cell_;
    if (!glm::all(glm::greaterThanEqual(q, DVec3(0))) || !glm::all(glm::lessThan(q, DVec3(size_)))) return 0;
    return static_cast<double>(depth_[index(IVec3(q))]);
  }

 private:
  static constexpr int kCells = 48;

  size_t index(IVec3 c) const {
    return (static_cast<size_t>(c.z) * static_cast<size_t>(size_.y) + static_cast<size_t>(c.y)) * static_cast<size_t>(size_.x) +
           static_cast<size_t>(c.x);
  }
  IVec3 cell_at(DVec3 p) const { return glm::clamp(IVec3(glm::floor((p - lower_) / cell_)), IVec3(0), size_ - 1); }

  /// Whether the plane of the triangle passes the cell, or next to it.
  bool may_meet(const Facet& f, IVec3 c) const {
    const DVec3 middle = lower_ + cell_ * (DVec3(c) + 0.5), n = glm::abs(f.n);
    return std::abs(glm::dot(middle - f.p[0], f.n)) <= 0.501 * cell_ * (n.x + n.y + n.z);
  }

  /// Which cells lie outside, or are not known to lie inside: cells that meet each other apart from the surface lie on one side of it.
  std::vector<char> find_outside(std::span<const Facet> facets, float far) const {
    constexpr int kMostRooms = 16;
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
          if (room.empty() || ++rooms > kMostRooms) continue;
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

  /// By the solid angle under which p sees the body from its inner side (Van Oosterom & Strackee 1983): 4π inside, 0 outside.
  static bool is_inside(std::span<const Facet> facets, DVec3 p) {
    double sum = 0;
    for (const Facet& f : facets) {
      const DVec3 a = f.p[0] - p, b = f.p[1] - p, c = f.p[2] - p;
      const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
      const double half = std::atan2(std::abs(glm::dot(a, glm::cross(b, c))),
                                     la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb);
      sum += glm::dot(a, f.n) > 0 ? half : -half;
    }
    return sum > 3.14159265358979323846;
  }

  /// min over the cells of a line of their value and the square of the room between the two cells.
  void spread(int axis) {
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

  DVec3 lower_{0};
  double cell_ = 1;
  IVec3 size_{0};
  std::vector<float> depth_;
};

/// Whether no corner lies before the plane of a facet. Large bodies are not asked.
bool is_convex(std::span<const Facet> facets, double size) {
  constexpr size_t kMost = 4096;
  if (facets.size() > kMost) return false;
  return std::all_of(facets.begin(), facets.end(), [&](const Facet& f) {
    return std::all_of(facets.begin(), facets.end(), [&](const Facet& g) {
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

struct DielectricMeshes::Facets {
  std::vector<Facet> all;
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
  void add_flat(const Facet& facet, double eta, DVec3 x, DVec3 y, MeshWays& found) const;
};

class MeshFinder {
 public:
  MeshFinder(const SceneDescription& scene, const Geometry& geometry, const std::vector<SurfaceInfo>& surfaces, const Media& media,
             std::span<const DVec3> lamps)
      : scene_(scene), geometry_(geometry), surfaces_(surfaces), media_(media), lamps_(lamps), placed_(geometry.placed_shapes()) {}

  void add(int shape, int instance, const DMat4& render_from_space) {
    const SurfaceInfo& info = surfaces_[static_cast<size_t>(shape)];
    const Shape& geometric = geometry_.shapes()[static_cast<size_t>(shape)];
    const float eta = smooth_glass_index(scene_, info);
    if (eta == 1 || std::holds_alternative<Quadric>(geometric.geometry)) return;
    Alike& alike = alike_[std::tuple(eta, info.is_boundary, info.inside, info.outside)];
    alike.info = &info;
    alike.eta = eta;
    const DMat4 inverse = glm::inverse(render_from_space);
    using Normals = std::array<DVec3, 3>;
    const auto facet = [&](DVec3 p0, DVec3 p1, DVec3 p2, const Normals* normals, uint32_t primitive, Facet::Part part) {
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
              Facet::Part::kTriangle);
      }
    } else {
      const auto& patches = std::get<PatchMesh>(geometric.geometry);
      if (!patches.normals.empty()) return;
      for (uint32_t i = 0; i < patches.patches.size(); ++i) {
        const auto& q = patches.patches[i];
        const PatchCorners c{patches.positions[q[0]], patches.positions[q[1]], patches.positions[q[2]], patches.positions[q[3]]};
        // A hole, through which nothing counts as closed.
        if (glm::distance(c[1] - c[0], c[3] - c[2]) > 1e-12 * (glm::distance(c[1], c[2]) + glm::distance(c[0], c[3]))) continue;
        facet(c[0], c[1], c[3], nullptr, i, Facet::Part::kLowerHalf);
        facet(c[0], c[3], c[2], nullptr, i, Facet::Part::kUpperHalf);
      }
    }
  }

  void find(DielectricMeshes& found) {
    for (auto& [key, alike] : alike_)
      if (alike.facets.size() <= kMostTriangles) find_closed(alike, found);
    if (found.bodies_.empty()) return;
    std::vector<Shape> shapes;
    for (const auto& [first, count] : facets_.range) {
      Mesh mesh;
      for (uint32_t i = 0; i < count; ++i) {
        const Facet& f = facets_.all[first + i];
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
    std::vector<Facet> facets;
  };

  static void weld(std::vector<Facet>& facets) {
    std::vector<DVec3> at;
    for (const Facet& f : facets) at.insert(at.end(), f.p.begin(), f.p.end());
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
    std::vector<Facet>& facets = alike.facets;
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
      const Facet& f = alike.facets[i];
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
    const bool scatters = inside != kNone && media_[inside].scatters();
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
      Facet f = alike.facets[i];
      if (!outwards) {
        f.n = -f.n;
        for (DVec3& normal : f.normals) normal = -normal;
      }
      facets_.all.push_back(f);
    }
    const std::span<Facet> facets = std::span(facets_.all).subspan(first, count);
    connect(facets, first);
    const bool is_empty = !has_shapes && std::none_of(lamps_.begin(), lamps_.end(), is_lamp_inside);
    body.is_clear = is_empty && is_convex(facets, body.size());
    if (inside != kNone && media_[inside].is_homogeneous()) {
      const double sigma = static_cast<double>(min_component(media_[inside].homogeneous().sigma_t));
      if (sigma > 0) body.longest = kFreePaths / sigma;
    }
    facets_.depths.push_back(is_empty ? DepthGrid(body.lower, body.upper, facets) : DepthGrid());
    found.bodies_.push_back(body);
  }

  /// Notes which facets meet at each corner, and gives flat ones the normals to be found by.
  void connect(std::span<Facet> body, uint32_t first) {
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
        Facet& f = body[at[k].second];
        for (size_t c = 0; c < 3; ++c) {
          if (f.corners[c] != at[i].first || f.corners_named[c]) continue;
          f.corners[c] = name;
          f.corners_named[c] = true;
          if (!f.is_flat) continue;
          DVec3 sum(0);
          for (size_t other = i; other < end; ++other) {
            const Facet& g = body[at[other].second];
            if (glm::dot(g.n, f.n) > kCrease) sum += glm::length(glm::cross(g.p[1] - g.p[0], g.p[2] - g.p[0])) * g.n;
          }
          f.normals[c] = glm::normalize(sum);
        }
      }
    }
  }

  const SceneDescription& scene_;
  const Geometry& geometry_;
  const std::vector<SurfaceInfo>& surfaces_;
  const Media& media_;
  std::span<const DVec3> lamps_;
  std::vector<PlacedShape> placed_;
  std::map<std::tuple<float, bool, int, int>, Alike> alike_;
  DielectricMeshes::Facets facets_;
};

DielectricMeshes::DielectricMeshes(const SceneDescription& scene, const Geometry& geometry, const std::vector<SurfaceInfo>& surfaces,
                                   const Media& media, std::span<const DVec3> lamps, int top_level,
                                   const std::vector<Geometry::Object>& objects, const std::vector<Geometry::Instance>& instances) {
  MeshFinder finder(scene, geometry, surfaces, media, lamps);
  for (int i = 0; i < top_level; ++i) finder.add(i, kNone, DMat4(1));
  for (size_t k = 0; k < instances.size(); ++k) {
    const Geometry::Object& object = objects[static_cast<size_t>(instances[k].object)];
    for (int i = 0; i < object.shape_count; ++i) finder.add(object.first_shape + i, static_cast<int>(k), instances[k].render_from_object);
  }
  finder.find(*this);
}

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

namespace {

bool is_within(DVec2 b) { return b.x >= 0 && b.y >= 0 && b.x + b.y <= 1; }

/// The way through a flat facet's plane, and where.
struct PlaneWay {
  RefractedWay way;
  DVec2 b;
};
std::optional<PlaneWay> plane_way(const Facet& f, double eta, DVec3 x, DVec3 y, double larger_sine = 0) {
  const auto way = way_through_plane(f.p[0], f.n, eta, x, y, larger_sine);
  if (!way) return std::nullopt;
  return PlaneWay{*way, coordinates(f.p, way->v)};
}

}  // namespace

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
    const Facet& f = all[place.facet];
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

void DielectricMeshes::Facets::add_flat(const Facet& facet, double eta, DVec3 x, DVec3 y, MeshWays& found) const {
  const auto plane = plane_way(facet, eta, x, y);
  if (plane && is_within(plane->b)) found.add({plane->way, facet.hit(plane->b), true});
}

/// All flat facets around one, as far as the ways through their planes pass near by them.
void DielectricMeshes::Facets::search_around(const WalkEnd& near, double eta, DVec3 x, DVec3 y, MeshWays& found) const {
  constexpr size_t kMost = 48;
  constexpr double kReach = 0.5;
  const double cosine = eta > 1 ? near.way.cos_t : near.way.cos_i, sine = std::sqrt(std::max(0.0, (1 - cosine) * (1 + cosine)));
  std::array<uint32_t, kMost> queue{near.place.facet};
  size_t count = 1;
  for (size_t i = 0; i < count; ++i) {
    const Facet& f = all[queue[i]];
    if (!f.is_flat) continue;
    const auto plane = plane_way(f, eta, x, y, sine);
    if (plane && is_within(plane->b)) found.add({plane->way, f.hit(plane->b), true});
    if (i > 0 && !(plane && std::min({plane->b.x, plane->b.y, 1 - plane->b.x - plane->b.y}) > -kReach)) continue;
    for (const uint32_t corner : f.corners)
      for (uint32_t k = corner; around[k] != kLast; ++k)
        if (count < kMost && std::find(queue.begin(), queue.begin() + static_cast<ptrdiff_t>(count), around[k]) ==
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
  const bool is_small = count <= kMostSearched;
  if (is_small)
    for (uint32_t i = first; i < first + count; ++i)
      if (all[i].is_flat) facets_->add_flat(all[i], eta, x, y, found);
  if (is_small && all[first].is_flat) return found;
  if (exit.distance > exit.body->longest) return found;
  const DVec3 v = x + exit.distance / glm::distance(x, y) * (y - x);
  const auto end = facets_->walk(body, {exit.facet, coordinates(all[exit.facet].p, v)}, eta, x, y, exit.body->longest);
  if (!end) return found;
  const Facet& f = all[end->place.facet];
  if (!f.is_flat) {
    found.add({end->way, f.hit(end->place.b), false});
  } else if (!is_small) {
    facets_->search_around(*end, eta, x, y, found);
  }
  return found;
}

}  // namespace woodcock
