// Closed meshes of smooth glass with something inside that scatters: light is sampled through their triangles
// (transport/path_kernel_refraction.h).
#pragma once

#include <array>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "renderer/geometry/geometry.h"
#include "renderer/geometry/refraction.h"

namespace woodcock {

struct GlassScene;

/// A way through one triangle.
struct MeshWay {
  RefractedWay way;
  Hit hit;              ///< where it passes the scene's own geometry
  bool is_flat = true;  ///< no other way passes this triangle
};

/// Those that are found from one point to another.
struct MeshWays {
  static constexpr size_t kCapacity = 8;
  std::array<MeshWay, kCapacity> ways;
  size_t count = 0;
  std::span<const MeshWay> all() const& { return {ways.data(), count}; }
  void all() const&& = delete;  ///< a span must not outlive its ways
  void add(const MeshWay& way) {
    if (count < kCapacity) ways[count++] = way;
  }
};

class DielectricMeshes {
 public:
  /// A closed surface.
  struct Body {
    float eta = 1;  ///< index inside over that outside
    DVec3 lower{0}, upper{0};
    bool is_clear = false;  ///< it is convex, and nothing but a medium is inside
    /// Ways that are longer inside are left to chance, since the medium lets next to nothing through.
    double longest = std::numeric_limits<double>::infinity();
    double size() const { return glm::length(upper - lower); }
  };

  /// Where the straight way from a point inside leaves a body.
  struct Exit {
    const Body* body;
    uint32_t facet;  ///< among all that this class has
    double distance;
  };

  DielectricMeshes() = default;

  /// The connected meshes, of one shape or of several that are alike (triangles, or flat quadrilaterals without vertex normals), that have
  /// no edge but those that two triangles share, whose material is a dielectric of index other than one without roughness, normal map,
  /// opacity below one or emission, and which hold a medium that scatters or other shapes.
  explicit DielectricMeshes(const GlassScene& glass);

  bool empty() const { return bodies_.empty(); }
  std::span<const Body> bodies() const { return bodies_; }

  /// Where p surely lies in a body with nothing but a medium inside: no more than the distance to its surface. Else 0.
  double depth(DVec3 p) const;

  /// Where a straight way along the unit vector d leaves the first body that it meets, before `distance`; nothing where it enters one or
  /// meets none.
  std::optional<Exit> exit_towards(DVec3 from, DVec3 d, double distance) const;

  /// Ways by one refraction from x to y, whose straight way leaves by `exit`: a function of x and y alone. For bodies of no more than
  /// kMaxSearched triangles without vertex normals of their own all that are not too long.
  MeshWays ways(const Exit& exit, DVec3 x, DVec3 y) const;

  static constexpr uint32_t kMaxSearched = 32;

 private:
  struct Facets;
  friend class MeshFinder;

  std::vector<Body> bodies_;
  std::shared_ptr<const Facets> facets_;
};

}  // namespace woodcock
