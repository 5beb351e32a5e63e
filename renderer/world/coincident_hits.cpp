#include "renderer/world/coincident_hits.h"

#include <algorithm>
#include <tuple>

#include "renderer/world/medium_boundaries.h"

namespace woodcock {
CoincidentHits::CoincidentHits(const Geometry& geometry, const std::vector<SurfaceInfo>& surfaces, const Ray& ray, const Hit& hit)
    : surfaces_(&surfaces), d_(ray.d) {
  std::array<CoincidentHit, kCapacity> found;
  const size_t all = geometry.coincident(ray, hit, found);
  overflowed_ = all > kCapacity;
  count_ = std::min(all, kCapacity);
  for (size_t i = 0; i < count_; ++i) {
    Element& m = elements_[i];
    m.hit = found[i].hit;
    m.error = found[i].error;
    m.s = geometry.surface(m.hit, ray);
    m.outside = glm::dot(d_, DVec3(m.s.ng)) < 0;
    m.repeats = std::any_of(elements_.begin(), elements_.begin() + static_cast<ptrdiff_t>(i), [&](const Element& other) {
      return other.hit.shape == m.hit.shape && other.hit.instance == m.hit.instance && other.outside == m.outside;
    });
  }
}

// Only what is filled.
CoincidentHits& CoincidentHits::operator=(const CoincidentHits& other) {
  surfaces_ = other.surfaces_;
  d_ = other.d_;
  count_ = other.count_;
  overflowed_ = other.overflowed_;
  std::copy_n(other.elements_.begin(), count_, elements_.begin());
  return *this;
}

/// Whether a is met before b beyond their errors. Surfaces that are told apart by t on the way in have the same order on
/// the way to w, or the opposite one when w turns back through both. Of boundaries of media the media know better.
bool CoincidentHits::is_surely_before(const Element& a, const Element& b, DVec3 w) const {
  if (info(a).is_boundary && info(b).is_boundary) return false;
  const auto turns_back = [&](const Element& m) { return glm::dot(w, DVec3(m.s.ng)) * glm::dot(d_, DVec3(m.s.ng)) < 0; };
  const bool back_a = turns_back(a), back_b = turns_back(b);
  if (back_a != back_b) return false;
  const double ahead = back_a ? a.hit.t - b.hit.t : b.hit.t - a.hit.t;
  return ahead * std::max(a.error.cosine, b.error.cosine) > a.error.distance + b.error.distance;
}

bool CoincidentHits::is_preferred(const Element& a, const Element& b, int medium) const {
  const auto key = [&](const Element& m) {
    const SurfaceInfo& surface = info(m);
    const bool exit = !m.outside;
    const int near = !surface.is_boundary ? medium : exit ? surface.inside : surface.outside;
    // The instance and t tell apart what a shape alone does not.
    return std::tuple(near != medium, !exit, exit ? -surface.stacking : surface.stacking, m.hit.instance, m.hit.t);
  };
  return key(a) < key(b);
}

int CoincidentHits::next(DVec3 w, int medium) const {
  const Element* best = nullptr;
  for (const Element& m : elements()) {
    if (!is_crossed_by(m, w)) continue;
    const bool is_behind = std::any_of(elements().begin(), elements().end(),
                                       [&](const Element& other) { return is_crossed_by(other, w) && is_surely_before(other, m, w); });
    if (!is_behind && (best == nullptr || is_preferred(m, *best, medium))) best = &m;
  }
  return best != nullptr ? static_cast<int>(best - elements_.data()) : kNone;
}

std::optional<int> CoincidentHits::medium_before(bool from_outside) const {
  const auto counts = [&](const Element& m) {
    return info(m).is_boundary && !info(m).is_absent() && !m.repeats && (m.outside || !from_outside);
  };
  const auto near = [&](const Element& m) { return m.outside ? info(m).outside : info(m).inside; };
  const auto far = [&](const Element& m) { return m.outside ? info(m).inside : info(m).outside; };
  const auto key = [&](const Element& m) {
    const bool follows = std::any_of(elements().begin(), elements().end(),
                                     [&](const Element& other) { return &other != &m && counts(other) && far(other) == near(m); });
    return std::tuple(follows, m.outside, info(m).stacking);
  };
  const Element* first = nullptr;
  for (const Element& m : elements()) {
    if (counts(m) && (first == nullptr || key(m) < key(*first))) first = &m;
  }
  return first != nullptr ? std::optional(near(*first)) : std::nullopt;
}

int CoincidentHits::medium_behind(const World& world, const Ray& ray, int crossed) const {
  const auto at_edge = [&](const Element& m) { return m.error.at_edge && info(m).is_boundary; };
  if (std::none_of(elements().begin(), elements().end(), at_edge)) return crossed;
  if (const auto medium = first_near_side(world.geometry, world.surfaces, ray)) return *medium;
  return world.medium_around.value_or(crossed);
}

int join_dielectrics(const World& world, const CoincidentHits& coincident, int exit, DVec3 d, int medium, Stream& choice, Bsdf& bsdf) {
  auto* const left = std::get_if<DielectricBsdf>(&bsdf);
  if (left == nullptr || coincident[exit].outside) return kNone;
  const auto info = [&](const CoincidentHits::Element& m) -> const SurfaceInfo& {
    return world.surfaces[static_cast<size_t>(m.hit.shape)];
  };
  CoincidentHits behind = coincident;
  behind.leave(exit, d);
  const int entry = behind.next(d, world.medium_after(info(coincident[exit]), coincident[exit].s.ng, d, medium));
  if (entry == kNone || !coincident[entry].outside || info(coincident[entry]).is_interface || info(coincident[entry]).has_alpha)
    return kNone;
  const TextureContext context{coincident[entry].s.uv, coincident[entry].s.p};
  const auto next = world.materials.bsdf(world.materials.resolve(info(coincident[entry]).material, context, choice), context, choice);
  const auto* const entered = next ? std::get_if<DielectricBsdf>(&*next) : nullptr;
  if (entered == nullptr) return kNone;
  left->eta /= entered->eta;
  return entry;
}

namespace {

/// A ray that meets a surface at less than this cosine grazes it.
constexpr double kGrazing = 0.1;

/// How far from a surface float coordinates tell places apart.
double float_distance(const CoincidentHits::Element& m, DVec3 at) {
  return std::max(2 * m.error.distance,
                  1.25 * glm::dot(glm::abs(DVec3(m.s.ng)), (m.hit.instance < 0 ? 0x1.1p-23 : 0x1.1p-22) * glm::abs(at)));
}

}  // namespace

DVec3 CoincidentHits::origin(DVec3 from, DVec3 w) const {
  // Moved along each normal in turn as far as the error of the surface asks for. In a corner one move may undo another; w leads out of
  // it, so that the turns end.
  DVec3 o = from;
  for (int turn = 0; turn < 64; ++turn) {
    bool moved = false;
    for (const Element& m : elements()) {
      const DVec3 n = glm::dot(w, DVec3(m.s.ng)) > 0 ? DVec3(m.s.ng) : -DVec3(m.s.ng);
      // A ray that grazes a surface at an edge keeps clear of it in float: that costs no length.
      const bool keeps_clear = m.error.at_edge && glm::dot(w, n) < kGrazing;
      const double wanted = keeps_clear ? float_distance(m, from) : 2 * m.s.error;
      const double distance = glm::dot(o - m.s.p, n);
      if (distance >= wanted) continue;
      o += (wanted - distance) * n;
      moved = true;
    }
    if (!moved) break;
  }
  return o;
}

Ray CoincidentHits::ray_from(DVec3 from, DVec3 w, float time) const {
  Ray ray{origin(from, w), w, time};
  if (std::none_of(elements().begin(), elements().end(), [](const Element& m) { return m.error.at_edge; })) return ray;
  for (const Element& m : elements()) {
    const DVec3 n = glm::dot(w, DVec3(m.s.ng)) > 0 ? DVec3(m.s.ng) : -DVec3(m.s.ng);
    const double cosine = glm::dot(w, n), missing = float_distance(m, from) - glm::dot(ray.o - m.s.p, n);
    if (missing > 0) ray.skip = std::max(ray.skip, missing / std::max(cosine, kGrazing));
  }
  return ray;
}

}  // namespace woodcock
