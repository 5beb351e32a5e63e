#include "renderer/transport/transmittance.h"

#include <cmath>

#include "renderer/media/extent.h"
#include "renderer/transport/ray_marching.h"
#include "renderer/transport/tentative_collisions.h"

namespace woodcock {
namespace {

/// Between these optical depths (of what the bounds leave open) ray marching without bias is worth its look-ups: in smoke that
/// only absorbs it was measured 3 times as efficient as tracking, below and above it is a loss of some percent. In media that
/// scatter, where most shadow rays do not matter much, it loses up to a fifth, so they are tracked.
constexpr double kShallow = 1, kDeep = 20;

const SurfaceInfo& surface_of(const World& world, int shape) { return world.surfaces[static_cast<size_t>(shape)]; }

/// Passes a surface in direction w, which may change the medium. False where it is in the way.
bool pass_surface(const World& world, const Hit& hit, const SurfacePoint& s, DVec3 w, int& medium, Stream& random) {
  const SurfaceInfo& info = surface_of(world, hit.shape);
  if (!info.transparent_to_shadows) return false;
  const TextureContext context{s.uv, s.p};
  if (info.has_alpha && random.uniform() >= world.textures.eval(info.alpha, context)) return true;
  // A mix may choose its interface here.
  if (!info.is_interface && world.materials.bsdf(info.material, context, random)) return false;
  medium = world.medium_after(info, s.ng, w, medium);
  return true;
}

/// Passes all that is left to cross of a place, up to the surface that `is_end` names. False where something is in the way
/// or the end is reached.
template <typename IsEnd>
bool pass_coincident_hits(const World& world, CoincidentHits& coincident, DVec3 w, int& medium, Stream& random, IsEnd&& is_end) {
  for (int index = coincident.next(w, medium); index != kNone; index = coincident.next(w, medium)) {
    const CoincidentHits::Element& m = coincident[index];
    if (is_end(m.hit) || !pass_surface(world, m.hit, m.s, w, medium, random)) return false;
    coincident.leave(index, w);
  }
  return true;
}

}  // namespace

Rgb attenuation(Rgb sigma, double t) {
  Rgb result;
  for (int c = 0; c < 3; ++c) result[c] = sigma[c] == 0 ? 1.0f : static_cast<float>(std::exp(-static_cast<double>(sigma[c]) * t));
  return result;
}

Rgb estimate_transmittance(const Medium& medium, const Ray& ray, double t_max, Stream& random, PathCounters& count,
                           const TransmittanceOptions& options) {
  // An unbounded way is left to the closed form: where a channel has no extinction a tracking would never end.
  if (medium.is_homogeneous() && (options.closed_forms || !std::isfinite(t_max))) return attenuation(medium.homogeneous().sigma_t, t_max);
  if (const auto unbounded = unbounded_part(medium, ray, t_max)) {
    const Rgb beyond = attenuation(unbounded->point.sigma_t, kInf);
    if (is_black(beyond)) return beyond;
    return beyond * estimate_transmittance(medium, ray, unbounded->from, random, count, options);
  }
  const bool grey = options.grey && medium.is_grey();
  if (options.ray_marching && !medium.scatters()) {
    const MarchedSegments segments(medium, ray, t_max, options.bricks);
    if (!segments.overflows() && segments.depth() > kShallow && segments.depth() < kDeep) {
      return march_transmittance(medium, ray, segments, grey, random, count.medium_lookups) *
             static_cast<float>(segments.lower_transmittance());
    }
  }
  // In double, so that a billion weak collisions dim.
  DVec3 estimate{1};
  TentativeCollisions collisions(medium, ray, t_max, random, options.bricks, 0,
                                 options.residual ? Collide::kAboveLowerBound : Collide::kMajorant);
  while (collisions.next()) {
    ++count.medium_lookups;
    if (flight_is_cancelled(options, count)) return Rgb(0);
    const DVec3 p = ray.at(collisions.t());
    const float inverse = 1 / collisions.rate(), lower = collisions.lower();
    if (grey) {
      estimate *= 1 - static_cast<double>((medium.grey_sigma_t(p) - lower) * inverse);
    } else {
      estimate *= DVec3(1) - DVec3((medium.sigma_t(p) - lower) * inverse);
    }
    const float largest = max_component(glm::abs(Rgb(estimate)));
    if (largest < kTransmittanceRoulette) {
      if (largest == 0 || random.uniform() >= kRouletteSurvival) return Rgb(0);
      estimate *= 1 / static_cast<double>(kRouletteSurvival);
    }
  }
  return Rgb(estimate) * collisions.lower_transmittance();
}

Shadow trace_shadow(const World& world, Ray ray, double t_max, int medium, TargetPrimitive target, Stream& random,
                    const TransmittanceOptions& options, bool transparent_surfaces, PathCounters& count, const CoincidentHits* from) {
  ++count.shadow_rays;
  const auto through_medium = [&](Rgb estimate, double length) {
    if (medium == kNone) return estimate;
    return estimate * estimate_transmittance(world.media[medium], ray, length, random, count, options);
  };
  if (from != nullptr) {
    CoincidentHits coincident = *from;
    if (!pass_coincident_hits(world, coincident, ray.d, medium, random, [](const Hit&) { return false; })) return {};
    medium = coincident.medium_behind(world, ray, medium);
  }
  // Any surface is in the way, unless it lets light pass or may coincide with the light.
  if (!transparent_surfaces && (target.shape == kNone || !surface_of(world, target.shape).may_overlap())) {
    if (world.geometry.occluded(ray, t_max, target)) return {};
    return {through_medium(Rgb(1), t_max), medium};
  }
  Rgb estimate{1};
  double left = t_max;
  for (int crossing = 0; crossing < kMaxCrossings; ++crossing) {
    const auto hit = world.geometry.intersect(ray, left);
    if (!hit) return {through_medium(estimate, left), medium};
    const auto is_end = [&](const Hit& h) { return world.geometry.is_target(h, ray, target); };
    const SurfaceInfo& info = surface_of(world, hit->shape);
    if (!info.transparent_to_shadows && !info.may_overlap() && !is_end(*hit)) return {};
    const SurfacePoint s = world.geometry.surface(*hit, ray, Geometry::Tangents::kNotWanted);
    int behind = medium;
    Ray next;
    bool ends = false;
    if (may_coincide(world, ray, *hit, s.p)) {
      CoincidentHits coincident(world, ray, *hit);
      if (coincident.overflowed()) break;
      if (!pass_coincident_hits(world, coincident, ray.d, behind, random, [&](const Hit& h) { return ends = is_end(h); }) && !ends)
        return {};
      next = coincident.ray_from(s.p, ray.d, ray.time);
      if (!ends) behind = coincident.medium_behind(world, next, behind);
    } else {
      ends = is_end(*hit);
      if (!ends && !pass_surface(world, *hit, s, ray.d, behind, random)) return {};
      next = ray_from(s, ray.d, ray.time);
    }
    estimate = through_medium(estimate, hit->t);
    if (is_black(estimate)) return {};
    if (ends) return {estimate, behind};
    medium = behind;
    ray = next;
    left -= hit->t;
    if (left <= 0) return {estimate, medium};
  }
  ++count.truncated;
  return {};
}

}  // namespace woodcock
