#include "renderer/transport/uniform_path.h"

#include <cmath>

#include "renderer/transport/paper_path.h"
#include "renderer/transport/tentative_collisions.h"

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

class UniformPath : public PaperPath<UniformPath> {
 public:
  UniformPath(PathSample& sample, Ray ray, PathKey key)
      : PaperPath(sample, ray, key, ScatterDirections::kUniform, sample.plan.paper.branching) {}

  /// At each tentative collision under the majorant σ̄ the path gains σa Le/σ̄ and keeps 1 − σt/σ̄ of its weight.
  FlightEnd cross_medium(const std::optional<Hit>& hit) {
    const Medium& medium = world_.media[medium_];
    const double z = hit ? hit->t : static_cast<double>(kInf);
    const std::optional<UnboundedPart> unbounded = unbounded_part(medium, ray_, z);
    if (unbounded && is_infinite(*unbounded, false)) return add_infinite_radiance();
    if (medium.is_homogeneous()) {
      const MediumPoint& m = medium.homogeneous();
      if (medium.emits()) add(gathered(m.emission, m.sigma_t, z));
      beta_ *= attenuation(m.sigma_t, z);
    } else if (const double reach = unbounded ? unbounded->from : z; medium.emits()) {
      TentativeCollisions collisions(medium, ray_, reach, flight_);
      while (collisions.next() && !sample_.stopped) {
        const MediumPoint m = sample_.look_up(medium, ray_.at(collisions.t()));
        add(m.emission / collisions.majorant());
        beta_ *= glm::max(Rgb(0), Rgb(1) - m.sigma_t / collisions.majorant());
      }
    } else if (medium.attenuates()) {
      beta_ *= estimate_transmittance(medium, ray_, reach, flight_, count_);
    }
    if (unbounded && !medium.is_homogeneous()) {
      add(gathered(unbounded->point.emission, unbounded->point.sigma_t, static_cast<double>(kInf)));
      beta_ *= attenuation(unbounded->point.sigma_t, static_cast<double>(kInf));
    }
    return is_black(beta_) ? FlightEnd::kOver : FlightEnd::kThrough;
  }
};

}  // namespace

PathResult trace_uniform_path(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count) {
  return trace_paper_path<UniformPath>(world, plan, ray, key, count);
}

}  // namespace woodcock
