#include "renderer/transport/march.h"

#include <cmath>

#include "renderer/transport/ray_steps.h"

namespace woodcock {
namespace {

/// The term of a ray's sum that is followed: each one offered replaces the one before with probability weight/total, so that
/// in the end each is chosen in proportion to its weight (reservoir sampling, Chao 1982).
class Choice {
 public:
  bool offer(float weight, Stream& random) {
    if (!(weight > 0)) return false;
    total_ += weight;
    if (!(random.uniform() * total_ < weight)) return false;
    weight_ = weight;
    return true;
  }
  /// 1/probability of the term that was chosen.
  float inverse_probability() const { return total_ / weight_; }

 private:
  float total_ = 0, weight_ = 0;
};

class Marching {
 public:
  Marching(WalkSample& sample, ScatterFunction scatter) : sample_(sample), scatter_(scatter) {}

  void follow_all(const Walk& w) {
    follow(sample_, w, 1, [this](Walk& walk, const std::optional<Hit>& hit) { return fly(walk, hit); });
  }

 private:
  Flight fly(Walk& w, const std::optional<Hit>& hit) {
    const Medium& medium = sample_.world.media[w.medium];
    const double z = hit ? hit->t : static_cast<double>(kInf);
    const bool scatters = medium.scatters() && sample_.may_scatter(w);
    const std::optional<EndlessPart> endless = endless_part(medium, w.ray, z);
    if (endless && diverges(*endless, w, scatters)) return sample_.diverge();
    if (!medium.attenuates() && !medium.emits() && !scatters) return Flight::kThrough;
    // The channels that end a march by dying out: on an endless segment only those with extinction do.
    Rgb fading(1);
    if (endless) fading = Rgb(glm::greaterThan(endless->point.sigma_t, Rgb(0)));
    const double reach = endless && is_black(fading * w.beta) ? endless->from : z;

    RaySteps steps(sample_, medium, w.ray, reach, sample_.plan.paper.step, w.flight.uniform());
    Choice choice;
    std::optional<double> chosen_t;
    Rgb chosen(0);
    float boost = 1;  // 1/probability that the march came here
    bool lost = false;
    while (steps.next()) {
      const bool may_end = !endless || steps.begin() >= endless->from;
      if (may_end && static_cast<double>(boost) * static_cast<double>(max_component(fading * transmittance_of(steps.begin_depth()))) <
                         static_cast<double>(kTransmittanceRoulette)) {
        lost = !(w.flight.uniform() < kRouletteSurvival);
        if (lost) break;
        boost /= kRouletteSurvival;
      }
      const MediumPoint& m = steps.point();
      const double t = steps.t();
      // Δ T(yᵢ)
      const Rgb delta_t = transmittance_of(steps.depth()) * (static_cast<float>(steps.length()) * boost);
      sample_.add(w, delta_t * m.emission);
      sample_.see(w, w.unseen * average(delta_t * m.sigma_t), albedo(m), Vec3(0), steps.t());
      if (!scatters || is_black(m.sigma_s)) continue;
      const Rgb weight = delta_t * m.sigma_s;
      if (w.first) {
        scatter_all(w, medium, weight, point_before(sample_.world, w.ray, t, hit));
      } else if (choice.offer(glm::dot(w.beta, weight), w.flight)) {
        chosen_t = t;
        chosen = weight;
      }
    }
    if (sample_.stopped) return Flight::kOver;
    // T(z); where the march was lost, of the channels that nothing dims.
    const Rgb through = transmittance_of(steps.end_depth()) * (lost ? Rgb(1) - fading : Rgb(boost));
    if (choice.offer(glm::dot(w.beta, through), w.flight))
      chosen_t.reset();
    else if (!chosen_t)
      return Flight::kOver;
    w.beta *= (chosen_t ? chosen : through) * choice.inverse_probability();
    w.unseen *= average(through);
    if (!chosen_t) return Flight::kThrough;
    return scatter_(sample_, w, medium, point_before(sample_.world, w.ray, *chosen_t, hit)) ? Flight::kScattered : Flight::kOver;
  }

  /// N directions of one step of the first ray that scatters.
  void scatter_all(const Walk& w, const Medium& medium, Rgb weight, DVec3 p) {
    const int n = sample_.plan.paper.directions;
    for (int j = 0; j < n && !sample_.stopped; ++j) {
      Walk branch = sample_.branch(w, weight / static_cast<float>(n));
      if (scatter_(sample_, branch, medium, p)) follow_all(branch);
    }
  }

  WalkSample& sample_;
  const ScatterFunction scatter_;
};

PathResult trace(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count, ScatterFunction scatter) {
  ++count.paths;
  WalkSample sample{world, plan, count};
  Marching(sample, scatter).follow_all(Walk(ray, world.camera_medium, key));
  return sample.result;
}

}  // namespace

PathResult trace_march(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count) {
  return trace(world, plan, ray, key, count, scatter_uniformly);
}

PathResult trace_march_phase(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count) {
  return trace(world, plan, ray, key, count, scatter_by_phase);
}

}  // namespace woodcock
