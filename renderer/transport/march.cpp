#include "renderer/transport/march.h"

#include <cmath>

#include "renderer/transport/paper_path.h"
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

class MarchedPath : public PaperPath<MarchedPath> {
 public:
  MarchedPath(PathSample& sample, Ray ray, PathKey key, ScatterDirections directions) : PaperPath(sample, ray, key, directions) {}

  FlightEnd cross_medium(const std::optional<Hit>& hit) {
    const Medium& medium = world_.media[medium_];
    const double z = hit ? hit->t : static_cast<double>(kInf);
    const bool scatters = medium.scatters() && may_scatter();
    const std::optional<UnboundedPart> unbounded = unbounded_part(medium, ray_, z);
    if (unbounded && is_infinite(*unbounded, scatters)) return add_infinite_radiance();
    if (!medium.attenuates() && !medium.emits() && !scatters) return FlightEnd::kThrough;
    // The channels that end a march by dying out: on an unbounded segment only those with extinction do.
    Rgb fading(1);
    if (unbounded) fading = Rgb(glm::greaterThan(unbounded->point.sigma_t, Rgb(0)));
    const double reach = unbounded && is_black(fading * beta_) ? unbounded->from : z;

    RaySteps steps(sample_, medium, ray_, reach, plan_.paper.step, flight_.uniform());
    Choice choice;
    std::optional<double> chosen_t;
    Rgb chosen(0);
    float boost = 1;  // 1/probability that the march came here
    bool lost = false;
    while (steps.next()) {
      const bool may_end = !unbounded || steps.begin() >= unbounded->from;
      if (may_end && static_cast<double>(boost) * static_cast<double>(max_component(fading * transmittance_of(steps.begin_depth()))) <
                         static_cast<double>(kTransmittanceRoulette)) {
        lost = !(flight_.uniform() < kRouletteSurvival);
        if (lost) break;
        boost /= kRouletteSurvival;
      }
      const MediumPoint& m = steps.point();
      const double t = steps.t();
      // Δ T(yᵢ)
      const Rgb delta_t = transmittance_of(steps.depth()) * (static_cast<float>(steps.length()) * boost);
      add(delta_t * m.emission);
      see(aov_weight_ * average(delta_t * m.sigma_t), albedo(m), Vec3(0), steps.t());
      if (!scatters || is_black(m.sigma_s)) continue;
      const Rgb weight = delta_t * m.sigma_s;
      if (first_) {
        scatter_all(medium, weight, point_before(world_, ray_, t, hit));
      } else if (choice.offer(glm::dot(beta_, weight), flight_)) {
        chosen_t = t;
        chosen = weight;
      }
    }
    if (sample_.stopped) return FlightEnd::kOver;
    // T(z); where the march was lost, of the channels that nothing dims.
    const Rgb through = transmittance_of(steps.end_depth()) * (lost ? Rgb(1) - fading : Rgb(boost));
    if (choice.offer(glm::dot(beta_, through), flight_))
      chosen_t.reset();
    else if (!chosen_t)
      return FlightEnd::kOver;
    beta_ *= (chosen_t ? chosen : through) * choice.inverse_probability();
    aov_weight_ *= average(through);
    if (!chosen_t) return FlightEnd::kThrough;
    return scatter_in_medium(medium, point_before(world_, ray_, *chosen_t, hit)) ? FlightEnd::kScattered : FlightEnd::kOver;
  }

 private:
  /// N directions of one step of the first ray that scatters.
  void scatter_all(const Medium& medium, Rgb weight, DVec3 p) {
    const int n = plan_.paper.directions;
    for (int j = 0; j < n && !sample_.stopped; ++j) {
      MarchedPath other = branch(weight / static_cast<float>(n));
      if (other.scatter_in_medium(medium, p)) other.follow();
    }
  }
};

}  // namespace

PathResult trace_march(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count) {
  return trace_paper_path<MarchedPath>(world, plan, ray, key, count, ScatterDirections::kUniform);
}

PathResult trace_march_phase(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count) {
  return trace_paper_path<MarchedPath>(world, plan, ray, key, count, ScatterDirections::kPhase);
}

}  // namespace woodcock
