// Coincident hits: surfaces that a ray meets at one place, which of them a path crosses first, and on which side of each it goes on.
#pragma once

#include <array>
#include <span>

#include "renderer/world/world.h"

namespace woodcock {

/// The surfaces that a ray meets at one place, closer together than float vertices tell (Geometry::coincident), and on
/// which side of each the path stands.
///
/// A path that stands here and heads for w crosses every surface that w points across: after a transmission what is left
/// of them, after a reflection those it had crossed before. The order is that of the ray where surfaces can be told
/// apart; else next is
///   1. one whose near side is the path's medium, or that is no boundary and keeps it;
///   2. exits (towards the outside of the shape) before entries;
///   3. SurfaceInfo::stacking upwards for entries, downwards for exits, so that both ways see the same stack.
/// Nothing of it depends on the order in which shapes are defined.
///
/// Of several triangles of a shape that are met at an edge from the same side one is crossed. Whether a ray that passes an
/// edge by a rounding meets both sides of it, one or none is chance; media then are those that what lies ahead says
/// (`medium_behind`), so that no path takes the inside of a shape with it.
class CoincidentHits {
 public:
  struct Element {
    Hit hit;
    SurfacePoint s;
    ErrorBound error;
    bool outside;  ///< the path stands on the side of s.ng
    bool repeats;  ///< another triangle of a shape at an edge: bounds where rays may start, and is not crossed
  };
  /// More surfaces than this at one place mean a defect of the scene.
  static constexpr size_t kCapacity = 64;

  /// The place where `ray` met `hit`, before any of it is crossed.
  CoincidentHits(const Geometry& geometry, const std::vector<SurfaceInfo>& surfaces, const Ray& ray, const Hit& hit);
  CoincidentHits(const World& world, const Ray& ray, const Hit& hit) : CoincidentHits(world.geometry, world.surfaces, ray, hit) {}

  CoincidentHits(const CoincidentHits& other) { *this = other; }
  CoincidentHits& operator=(const CoincidentHits& other);

  /// The index of the next surface to cross on the way to w in `medium`; kNone when nothing is in the way any more.
  int next(DVec3 w, int medium) const;
  const Element& operator[](int index) const { return elements_[static_cast<size_t>(index)]; }

  /// After passing or scattering at a surface of the set the path heads for w.
  void leave(int index, DVec3 w) {
    Element& m = elements_[static_cast<size_t>(index)];
    m.outside = glm::dot(w, DVec3(m.s.ng)) > 0;
  }

  /// `from`, a point at this place, moved to where a ray to w starts on the right side of all of them.
  DVec3 origin(DVec3 from, DVec3 w) const;
  /// The ray that starts there. At an edge Embree's own rounding decides which primitives a ray meets, and what it left out here it may
  /// meet from the new origin: there the ray skips as much as it takes to be as far from all of them as float coordinates tell places
  /// apart. Lengths count from the origin all the same.
  Ray ray_from(DVec3 from, DVec3 w, float time) const;

  /// The medium of a ray that has left this place with nothing left to cross, `crossed` as its crossings tell. At an edge it
  /// is the near side of the first boundary ahead; where none is, the medium around the scene if that is the same everywhere.
  int medium_behind(const World& world, const Ray& ray, int crossed) const;

  /// The medium that the boundaries here say the ray comes from: the near side of one whose near side is not the far side
  /// of another, exits first. Nothing where there is no boundary. A ray that comes `from_outside` of everything meets the
  /// outer sides only: from far away the two faces of a thin sheet are one place.
  std::optional<int> medium_before(bool from_outside = false) const;

  /// Calls `use(medium, length)` for each way between two surfaces that one medium fills, by the nearer one's far side or the farther
  /// one's near side; `length` > 0 along the ray, in render units.
  template <typename Use>
  void for_each_gap(Use&& use) const;

  /// Some found no room.
  bool overflowed() const { return overflowed_; }

 private:
  std::span<const Element> elements() const& { return {elements_.data(), count_}; }
  void elements() const&& = delete;  ///< a span must not outlive its set
  const SurfaceInfo& info(const Element& m) const { return (*surfaces_)[static_cast<size_t>(m.hit.shape)]; }
  static bool is_crossed_by(const Element& m, DVec3 w) { return !m.repeats && (glm::dot(w, DVec3(m.s.ng)) > 0) != m.outside; }
  bool is_surely_before(const Element& a, const Element& b, DVec3 w) const;
  bool is_preferred(const Element& a, const Element& b, int medium) const;

  const std::vector<SurfaceInfo>* surfaces_;
  DVec3 d_;
  std::array<Element, kCapacity> elements_;
  size_t count_ = 0;
  bool overflowed_ = false;
};

template <typename Use>
void CoincidentHits::for_each_gap(Use&& use) const {
  for (const Element& near : elements()) {
    const Element* far = nullptr;
    for (const Element& other : elements())
      if (other.hit.t > near.hit.t && (far == nullptr || other.hit.t < far->hit.t)) far = &other;
    if (far == nullptr) continue;
    const auto beyond = [&](const Element& m) { return m.outside ? info(m).inside : info(m).outside; };
    const auto before = [&](const Element& m) { return m.outside ? info(m).outside : info(m).inside; };
    const int medium = info(near).is_boundary ? beyond(near) : info(*far).is_boundary ? before(*far) : kNone;
    if (medium != kNone) use(medium, far->hit.t - near.hit.t);
  }
}

/// Where one dielectric body ends and the next begins there is one boundary, whose index is relative: none at all between
/// equal bodies. If `exit`, an index of the set where the path stands, is such an end, on the way along d in `medium`, turns `bsdf`, its
/// model, into that boundary and returns the entry that belongs to it; else kNone. `choice` decides mixes.
int join_dielectrics(const World& world, const CoincidentHits& coincident, int exit, DVec3 d, int medium, Stream& choice, Bsdf& bsdf);

/// Whether other surfaces may coincide with what `ray` meets at p: by the boxes of overlaps, and at the edges of a mesh that is convex.
inline bool may_coincide(const Geometry& geometry, const SurfaceInfo& surface, const Ray& ray, const Hit& hit, DVec3 exact) {
  const Vec3 p(exact);
  if (surface.edges_touch && geometry.is_at_edge(ray, hit)) return true;
  for (const Box3& box : surface.overlaps) {
    if (glm::all(glm::lessThanEqual(box.lower, p)) && glm::all(glm::lessThanEqual(p, box.upper))) return true;
  }
  return false;
}

inline bool may_coincide(const World& world, const Ray& ray, const Hit& hit, DVec3 p) {
  return may_coincide(world.geometry, world.surfaces[static_cast<size_t>(hit.shape)], ray, hit, p);
}

}  // namespace woodcock
