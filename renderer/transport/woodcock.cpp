#include "renderer/transport/woodcock.h"

#include "renderer/media/extent.h"
#include "renderer/transport/walk.h"

namespace woodcock {
namespace {

/// σ̄ − σt, cut at 0. Rounding of the interpolation is no violation; the bound carries an allowance for it.
Rgb null_extinction(float majorant, Rgb sigma_t, PathCounters& count) {
  const Rgb sigma_n = Rgb(majorant) - sigma_t;
  for (int c = 0; c < 3; ++c)
    if (sigma_n[c] < -1e-4f * majorant) ++count.majorant_violations;
  return glm::max(sigma_n, Rgb(0));
}

/// In an endless part some channels may be dimmed for ever and others not at all, and tracking both would never end: the weight
/// of the first would only shrink. One of the two groups is kept, chosen by its share of the throughput.
void keep_one_group(Walk& w, const EndlessPart& endless) {
  const Rgb fading(glm::greaterThan(endless.point.sigma_t, Rgb(0)));
  const float dimmed = glm::dot(w.beta, fading), all = w.beta.r + w.beta.g + w.beta.b;
  if (!(dimmed > 0 && dimmed < all)) return;
  const float share = dimmed / all;
  w.beta *= w.flight.uniform() < share ? fading / share : (Rgb(1) - fading) / (1 - share);
}

/// A collision that stops the ray, or nothing where it gets through.
Flight fly(WalkSample& sample, Walk& w, const std::optional<Hit>& hit, ScatterFunction scatter) {
  const Medium& medium = sample.world.media[w.medium];
  const double z = hit ? hit->t : static_cast<double>(kInf);
  const bool scatters = medium.scatters() && sample.may_scatter(w);
  const std::optional<EndlessPart> endless = endless_part(medium, w.ray, z);
  if (endless && diverges(*endless, w, scatters)) return sample.diverge();
  const float majorant = medium.maximum_sigma_t();
  if (!(majorant > 0)) return Flight::kThrough;
  const Extent extent = extent_of(medium, w.ray, z);
  for (double t = extent.begin;;) {
    t += static_cast<double>(w.flight.exponential()) / static_cast<double>(majorant);
    if (!(t < extent.end)) return Flight::kThrough;
    const MediumPoint m = sample.look_up(medium, w.ray.at(t));
    if (sample.stopped) return Flight::kOver;
    if (endless && t >= endless->from) keep_one_group(w, *endless);
    const Rgb sigma_s = scatters ? m.sigma_s : Rgb(0), kappa = glm::max(m.sigma_t, sigma_s);
    const Rgb sigma_n = null_extinction(majorant, m.sigma_t, sample.count);
    const float real = glm::dot(w.beta, kappa), all = glm::dot(w.beta, kappa + sigma_n);
    if (!(all > 0)) return Flight::kOver;
    if (!(real > 0)) {
      // Nothing dims the ray here. Emission without extinction is gathered at every tentative collision.
      if ((medium.is_homogeneous() || (endless && t >= endless->from)) && is_black(m.emission)) return Flight::kThrough;
      sample.add(w, m.emission / majorant);
      w.beta *= sigma_n / majorant;
      continue;
    }
    const float q = real / all;
    // In double: see PathKernel::track.
    if (!(w.flight.uniform_double() < static_cast<double>(q))) {
      w.beta *= sigma_n / (majorant * (1 - q));
      continue;
    }
    const float density = majorant * q;
    sample.see(w, w.unseen, albedo(m), Vec3(0), t);
    w.unseen = 0;
    sample.add(w, m.emission / density);
    if (is_black(sigma_s)) return Flight::kOver;
    w.beta *= sigma_s / density;
    return scatter(sample, w, medium, point_before(sample.world, w.ray, t, hit)) ? Flight::kScattered : Flight::kOver;
  }
}

PathResult trace(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count, ScatterFunction scatter) {
  ++count.paths;
  WalkSample sample{world, plan, count};
  follow(sample, Walk(ray, world.camera_medium, key), 1,
         [&](Walk& w, const std::optional<Hit>& hit) { return fly(sample, w, hit, scatter); });
  return sample.result;
}

}  // namespace

PathResult trace_woodcock(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count) {
  return trace(world, plan, ray, key, count, scatter_uniformly);
}

PathResult trace_woodcock_phase(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count) {
  return trace(world, plan, ray, key, count, scatter_by_phase);
}

}  // namespace woodcock
