#include "renderer/transport/transmittance.h"

#include <cmath>

#include "renderer/transport/tentative_collisions.h"

namespace woodcock {
namespace {

/// A hit on the target's own primitive this close to the sampled point is the sampled point; in parts of the whole way,
/// since behind a boundary next to the target next to nothing of it is left.
constexpr double kTargetTolerance = 1e-3;

/// Below this estimate roulette decides whether a tracking goes on.
constexpr float kRouletteThreshold = 0.1f;
constexpr float kRouletteSurvival = 0.25f;

}  // namespace

Rgb attenuation(Rgb sigma, double t) {
  Rgb result;
  for (int c = 0; c < 3; ++c) result[c] = sigma[c] == 0 ? 1.0f : static_cast<float>(std::exp(-static_cast<double>(sigma[c]) * t));
  return result;
}

Rgb estimate_transmittance(const Medium& medium, const Ray& ray, float t_max, Stream& random, PathCounters& count) {
  if (medium.is_homogeneous()) return attenuation(medium.homogeneous().sigma_t, t_max);
  Rgb estimate{1};
  TentativeCollisions collisions(medium, ray, t_max, random);
  while (collisions.next()) {
    ++count.medium_lookups;
    const Vec3 p = ray.at(collisions.t());
    const float inverse = 1 / collisions.majorant();
    if (medium.is_grey()) {
      estimate *= 1 - medium.grey_sigma_t(p) * inverse;
    } else {
      estimate *= Rgb(1) - medium.sigma_t(p) * inverse;
    }
    const float largest = max_component(glm::abs(estimate));
    if (largest < kRouletteThreshold) {
      if (largest == 0 || random.uniform() >= kRouletteSurvival) return Rgb(0);
      estimate *= 1 / kRouletteSurvival;
    }
  }
  return estimate;
}

Rgb shadow_transmittance(const World& world, Ray ray, float t_max, int medium, TargetPrimitive target, Stream& random,
                         PathCounters& count) {
  ++count.shadow_rays;
  const auto through_medium = [&](Rgb estimate, float length) {
    if (medium == kNone) return estimate;
    return estimate * estimate_transmittance(world.media[medium], ray, length, random, count);
  };
  if (!world.has_passable_surfaces) {
    if (world.geometry.occluded(ray, t_max, target)) return Rgb(0);
    return through_medium(Rgb(1), t_max);
  }
  Rgb estimate{1};
  double left = t_max;
  for (int crossing = 0; crossing < kMaxCrossings; ++crossing) {
    const auto hit = world.geometry.intersect(ray, left);
    if (!hit) return through_medium(estimate, static_cast<float>(left));
    if (hit->shape == target.shape && hit->primitive == target.primitive && left - hit->t < kTargetTolerance * static_cast<double>(t_max)) {
      return through_medium(estimate, static_cast<float>(hit->t));
    }
    const SurfaceInfo& info = world.surfaces[static_cast<size_t>(hit->shape)];
    if (!info.passes_shadows) return Rgb(0);
    const SurfacePoint s = world.geometry.surface(*hit, ray);
    const TextureContext context{s.uv, s.p};
    const bool missed = info.has_alpha && random.uniform() >= world.textures.eval(info.alpha, context);
    // A mix may choose its interface here.
    if (!missed && !info.is_interface && world.materials.bsdf(info.material, context, random)) return Rgb(0);
    estimate = through_medium(estimate, static_cast<float>(hit->t));
    if (is_black(estimate)) return estimate;
    if (!missed) medium = world.medium_after(info, s.ng, ray.d, medium);
    ray.o = offset_origin(s, ray.d);
    left -= hit->t;
    if (left <= 0) return estimate;
  }
  ++count.truncated;
  return Rgb(0);
}

}  // namespace woodcock
