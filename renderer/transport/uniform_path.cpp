#include "renderer/transport/uniform_path.h"

#include <cmath>

#include "renderer/transport/tentative_collisions.h"
#include "renderer/transport/walk.h"

namespace woodcock {
namespace {

/// j ∫₀ᵗ e^(−σ s) ds = j (1 − e^(−σ t))/σ per channel; j t where σ = 0.
Rgb gathered(Rgb j, Rgb sigma, double t) {
  Rgb sum{0};
  for (int c = 0; c < 3; ++c) {
    if (!(j[c] > 0)) continue;
    const double s = static_cast<double>(sigma[c]), length = s > 0 ? -std::expm1(-s * t) / s : t;
    sum[c] = static_cast<float>(static_cast<double>(j[c]) * length);
  }
  return sum;
}

/// At each tentative collision under the majorant σ̄ the path gains σa Le/σ̄ and keeps 1 − σt/σ̄ of its weight.
Flight pass(WalkSample& sample, Walk& w, const std::optional<Hit>& hit) {
  const Medium& medium = sample.world.media[w.medium];
  const double z = hit ? hit->t : static_cast<double>(kInf);
  const std::optional<EndlessPart> endless = endless_part(medium, w.ray, z);
  if (endless && diverges(*endless, w, false)) return sample.diverge();
  if (medium.is_homogeneous()) {
    const MediumPoint& m = medium.homogeneous();
    if (medium.emits()) sample.add(w, gathered(m.emission, m.sigma_t, z));
    w.beta *= attenuation(m.sigma_t, z);
  } else if (const double reach = endless ? endless->from : z; medium.emits()) {
    TentativeCollisions collisions(medium, w.ray, reach, w.flight);
    while (collisions.next() && !sample.stopped) {
      const MediumPoint m = sample.look_up(medium, w.ray.at(collisions.t()));
      sample.add(w, m.emission / collisions.majorant());
      w.beta *= glm::max(Rgb(0), Rgb(1) - m.sigma_t / collisions.majorant());
    }
  } else if (medium.attenuates()) {
    w.beta *= estimate_transmittance(medium, w.ray, reach, w.flight, sample.count);
  }
  if (endless && !medium.is_homogeneous()) {
    sample.add(w, gathered(endless->point.emission, endless->point.sigma_t, static_cast<double>(kInf)));
    w.beta *= attenuation(endless->point.sigma_t, static_cast<double>(kInf));
  }
  return is_black(w.beta) ? Flight::kOver : Flight::kThrough;
}

}  // namespace

PathResult trace_uniform_path(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count) {
  ++count.paths;
  WalkSample sample{world, plan, count};
  follow(sample, Walk(ray, world.camera_medium, key), plan.paper.branching,
         [&](Walk& w, const std::optional<Hit>& hit) { return pass(sample, w, hit); });
  return sample.result;
}

}  // namespace woodcock
