// What the paths of all estimators do alike: rays, surfaces met, coincident hits, boundaries of media, roulette, and the AOVs of the
// first event. Estimators differ in how they cross media and how they scatter.
#pragma once

#include <optional>

#include "renderer/transport/path_sample.h"
#include "renderer/transport/roulette.h"
#include "renderer/transport/vertex.h"
#include "renderer/world/coincident_hits.h"
#include "renderer/world/effects.h"

namespace woodcock {

/// How a path leaves a medium.
enum class FlightEnd {
  kThrough,    ///< at the end of the segment
  kScattered,  ///< in a new direction, from a point before that
  kOver,       ///< not at all
};

/// A surface at which a path may scatter.
struct SurfaceVertex {
  const SurfacePoint& s;
  const SurfaceInfo& info;
  int material;
  Vec3 ns;           ///< shading normal
  int hit = kNone;   ///< index in the set of coincident hits, if others coincide with it
  int next = kNone;  ///< in the same set, a hit that a transmission crosses, too: the dielectric body that begins where this one ends
  const Hit& met;
};

/// One path, or one branch of it. Members carry what the next event needs; a copy is a branch that starts here.
///
/// `kMask` are the effects that are compiled in. Which of them run is up to `effects`, so that a machine for more effects than the scene
/// has does the same arithmetic as one made to measure.
///
/// `Estimator` derives from this and gives
///   FlightEnd cross_medium(const std::optional<Hit>& hit)   through the medium of the path, to the hit that ends the segment
///   std::optional<Hit> find_hit()                           that hit; one that the path scatters before need not be found
///   bool scatter_at_surface(const SurfaceVertex&, Model)    false where the path ends; `Model` is Bsdf, or DiffuseBsdf where the effects
///                                                           have nothing else
///   void add_emission(const Hit&, const SurfacePoint&, int light)
///   void add_environment()                                  where the path leaves the scene
template <uint32_t kMask, typename Estimator>
class PathMachine {
 protected:
  PathMachine(PathSample& sample, uint32_t effects, Ray ray, PathKey key)
      : sample_(sample),
        world_(sample.world),
        plan_(sample.plan),
        effects_(effects),
        count_(sample.count),
        result_(sample.result),
        key_(key),
        ray_(ray),
        medium_(uses(kMedia) ? sample.world.camera_medium : kNone),
        flight_(0),
        crossing_(0) {}

  /// Follows the path to its end.
  void follow() {
    int crossings = 0;
    while (!sample_.stopped) {
      if (++crossings > kMaxCrossings) {
        ++count_.truncated;
        return;
      }
      const uint32_t vertex_before = vertex_;
      if (uses(kTouching) && coincident_) {
        // What coincides with the surface just met comes before anything else, at no distance.
        if (const int next = coincident_->next(ray_.d, medium_); next != kNone) {
          if (!meet_surface((*coincident_)[next].hit, (*coincident_)[next].s, next)) return;
          if (vertex_ != vertex_before) crossings = 0;
          continue;
        }
        if (uses(kMedia)) medium_ = coincident_->medium_behind(world_, ray_, medium_);
        coincident_.reset();
      }
      ++count_.rays;
      const auto hit = estimator().find_hit();
      if (uses(kMedia) && medium_ != kNone) {
        const FlightEnd end = estimator().cross_medium(hit);
        if (end == FlightEnd::kOver) return;
        if (end == FlightEnd::kScattered) {
          crossings = 0;
          continue;
        }
      }
      if (!hit) {
        estimator().add_environment();
        return;
      }
      travelled_ += hit->t;
      if (!arrive(*hit)) return;
      if (vertex_ != vertex_before) crossings = 0;
    }
  }

  std::optional<Hit> find_hit() { return world_.geometry.intersect(ray_, kInf); }

  static constexpr uint32_t kMedia = kHomogeneousMedia | kHeterogeneousMedia;
  /// Surfaces that something may pass; coincident hits matter only for these.
  static constexpr uint32_t kTouching = kTransparentSurfaces | kGeneralSurfaces;

  /// Whether any of these effects is compiled in and planned.
  bool uses(uint32_t effects) const { return (kMask & effects) != 0 && (effects_ & effects) != 0; }

  bool may_scatter() const { return depth_ < plan_.max_depth; }

  /// New numbers for the segment from the current vertex; they go on across boundaries.
  void begin_segment() {
    if constexpr ((kMask & kMedia) != 0) flight_ = stream(key_, vertex_, Purpose::kFreeFlight);
    if constexpr ((kMask & kTouching) != 0) crossing_ = stream(key_, vertex_, Purpose::kMaterial);
  }

  /// Counts a scattering.
  void next_vertex() {
    ++vertex_;
    ++depth_;
    if ((++count_.vertices & (kReportEvery - 1)) == 0 && plan_.watch != nullptr) sample_.report();
  }

  /// Russian roulette from the second scattering on: the probability with which the path went on, 0 where it ends.
  float roulette() {
    if (sample_.stopped || is_black(beta_)) return 0;
    if (depth_ < 2 || !plan_.roulette) return 1;
    const float q = roulette_survival(beta_, eta_scale_, start_weight_);
    if (q >= 1) return 1;
    if (!(q > 0) || stream(key_, vertex_, Purpose::kRoulette).uniform_double() >= static_cast<double>(q)) return 0;
    beta_ /= q;
    return q;
  }

  /// The medium behind a surface for a path that leaves it for w.
  int medium_towards(const SurfaceInfo& info, Vec3 ng, DVec3 w) const {
    return uses(kMedia) ? world_.medium_after(info, ng, w, medium_) : kNone;
  }

  /// The medium that the path is in when it has left a surface for w.
  int medium_after_leaving(const SurfaceVertex& v, DVec3 w, bool transmission) const {
    const int behind = medium_towards(v.info, v.s.ng, w);
    if (!uses(kTouching) || v.next == kNone || !transmission) return behind;
    // The body that begins here may keep the medium behind the one that ends.
    const CoincidentHits::Element& entry = (*coincident_)[v.next];
    return uses(kMedia) ? world_.medium_after(world_.surfaces[static_cast<size_t>(entry.hit.shape)], entry.s.ng, w, behind) : kNone;
  }

  /// The ray from the surface that heads for w.
  Ray ray_towards(const SurfacePoint& s, DVec3 w) const {
    return uses(kTouching) && coincident_ ? coincident_->ray_from(s.p, w, ray_.time) : ray_from(s, w, ray_.time);
  }

  /// The path heads for w from a surface, which is `hit` of the coincident hits, or kNone. A transmission crosses the hit `next`, too;
  /// else the path stays on its outer side.
  void leave(int hit, DVec3 w, int next = kNone, bool transmission = false) {
    if (!uses(kTouching) || hit == kNone) return;
    coincident_->leave(hit, w);
    if (next != kNone) coincident_->leave(next, transmission ? w : DVec3((*coincident_)[next].s.ng));
  }

  PathSample& sample_;
  const World& world_;
  const RenderPlan& plan_;
  const uint32_t effects_;
  PathCounters& count_;
  PathResult& result_;
  PathKey key_;

  Ray ray_;
  int medium_;
  Stream flight_, crossing_;
  Rgb beta_{1};             ///< throughput
  uint32_t vertex_ = 0;     ///< scatterings of this branch and of what led to it
  int depth_ = 0;           ///< the same, as the depth limit counts
  float eta_scale_ = 1;     ///< η² of all refractions: what radiance changes by without loss
  float start_weight_ = 1;  ///< the largest channel of beta where this branch began
  float aov_weight_ = 1;    ///< the share of the sample whose first event is still to come
  double travelled_ = 0;    ///< render units from the camera, as long as `aov_weight_` is positive
  /// The surfaces where the path stands, if others may coincide with the one it met.
  std::optional<CoincidentHits> coincident_;

 private:
  using Tangents = Geometry::Tangents;

  Estimator& estimator() { return static_cast<Estimator&>(*this); }

  /// Meets the nearest hit, or notes what coincides with it. False ends the path.
  bool arrive(const Hit& hit) {
    const SurfacePoint s = world_.geometry.surface(hit, ray_, uses(kGeneralSurfaces) ? Tangents::kWanted : Tangents::kNotWanted);
    if (!uses(kTouching) || !may_coincide(world_, ray_, hit, s.p)) return meet_surface(hit, s, kNone);
    coincident_.emplace(world_, ray_, hit);
    if (coincident_->overflowed()) {
      ++count_.truncated;
      return false;
    }
    ray_ = coincident_->ray_from(s.p, ray_.d, ray_.time);
    return true;
  }

  /// Goes on behind a surface that is not there for this path, or is a boundary only.
  bool pass(const SurfacePoint& s, int index) {
    leave(index, ray_.d);
    ray_ = ray_towards(s, ray_.d);
    return true;
  }

  /// Handles a surface, which is `index` of the coincident hits or kNone. False ends the path.
  bool meet_surface(const Hit& hit, const SurfacePoint& s, int index) {
    const SurfaceInfo& info = world_.surfaces[static_cast<size_t>(hit.shape)];
    const TextureContext context{s.uv, s.p};
    if (uses(kTransparentSurfaces) && info.has_alpha && crossing_.uniform() >= world_.textures.eval(info.alpha, context))
      return pass(s, index);
    if (info.light != kNone) estimator().add_emission(hit, s, info.light);
    if (uses(kSurfaces) && !info.is_interface) {
      if (!uses(kGeneralSurfaces))
        return estimator().scatter_at_surface({s, info, info.material, s.ns, index, kNone, hit},
                                              world_.materials.diffuse(info.material, context));
      const int material = world_.materials.resolve(info.material, context, crossing_);
      if (auto bsdf = world_.materials.bsdf(material, context, crossing_)) {
        if (!plan_.layered_closed_forms) use_walks(*bsdf);
        const int next =
            uses(kTouching) && coincident_ ? join_dielectrics(world_, *coincident_, index, ray_.d, medium_, crossing_, *bsdf) : kNone;
        const Vec3 ns = world_.materials.shading_normal(material, context, {s.ns, s.dpdu, s.dpdv});
        return estimator().scatter_at_surface({s, info, material, ns, index, next, hit}, *bsdf);
      }
    }
    medium_ = medium_towards(info, s.ng, ray_.d);
    return pass(s, index);
  }
};

}  // namespace woodcock
