#include "renderer/transport/line.h"

#include <cmath>

#include "renderer/transport/paper_path.h"
#include "renderer/transport/ray_steps.h"

namespace woodcock {
namespace {

/// The numbers of one ray: they go on across boundaries and specular surfaces.
class Targets {
 public:
  explicit Targets(int n) : n_(n) {}

  int left() const { return n_ - taken_; }
  /// The depth at which the next distance lies, −ln(1 − ξ), from the start of the ray.
  double next_depth(Stream& random) {
    if (!drawn_) {
      depth_ = -std::log1p(-(taken_ + random.uniform_double()) / n_);
      drawn_ = true;
    }
    return depth_;
  }
  void take() {
    ++taken_;
    drawn_ = false;
  }

 private:
  int n_, taken_ = 0;
  bool drawn_ = false;
  double depth_ = 0;
};

/// What one ray carries from segment to segment.
struct LineRay {
  uint32_t vertex;  ///< where it began; another one means another ray
  Targets targets;
  int channel;        ///< whose depth is inverted
  DVec3 share;        ///< of the channels in the mixture, given that the ray came here
  double passed = 0;  ///< depth in that channel up to the current segment
};

class LinePath : public PaperPath<LinePath> {
 public:
  LinePath(PathSample& sample, Ray ray, PathKey key)
      : PaperPath(sample, ray, key, ScatterDirections::kPhase), line_(begin(sample.plan.paper.directions)) {}

  FlightEnd cross_medium(const std::optional<Hit>& hit) {
    if (vertex_ != line_.vertex && !first_) line_ = begin(1);
    return sample_distance(hit, line_);
  }

 private:
  LineRay begin(int n) const {
    const DVec3 share = DVec3(beta_) / (static_cast<double>(beta_.r) + static_cast<double>(beta_.g) + static_cast<double>(beta_.b));
    const double u = stream(key_, vertex_, Purpose::kHeroChannel).uniform_double();
    const int channel = u < share.r ? 0 : (u < share.r + share.g || !(share.b > 0) ? 1 : 2);
    return {vertex_, Targets(n), channel, share};
  }

  /// What is added to σt so that distances are found wherever there are sources: 0 but for terms that are left out.
  double added_extinction(const Medium& medium, bool scatters) const {
    const TransferTerms& terms = plan_.terms;
    const bool hidden = (medium.emits() && !terms.absorption) || (scatters && !terms.out_scattering);
    return hidden ? static_cast<double>(medium.maximum_sigma_t()) : 0;
  }

  FlightEnd sample_distance(const std::optional<Hit>& hit, LineRay& ray) {
    const Medium& medium = world_.media[medium_];
    const double z = hit ? hit->t : static_cast<double>(kInf);
    const bool scatters = medium.scatters() && may_scatter();
    const std::optional<UnboundedPart> unbounded = unbounded_part(medium, ray_, z);
    if (unbounded && is_infinite(*unbounded, scatters)) return add_infinite_radiance();
    if (!medium.attenuates() && !medium.emits() && !scatters) return FlightEnd::kThrough;
    const double added = added_extinction(medium, scatters);
    const int h = ray.channel, n = ray.targets.left();
    const Rgb beta = beta_;
    // Where this channel is not dimmed for ever its depth grows no more, and at infinity other channels that are not remain, too.
    const bool grows = !unbounded || unbounded->point.sigma_t[h] > 0 || added > 0;
    RaySteps steps(sample_, medium, ray_, grows ? z : unbounded->from, plan_.paper.step, flight_.uniform());
    double marched = 0;  // ∫ κ from the segment's start in channel h, κ = σt + added
    while (steps.next()) {
      const double kappa = static_cast<double>(steps.point().sigma_t[h]) + added;
      const double end = marched + kappa * steps.length();
      while (ray.passed + end > ray.targets.next_depth(flight_)) {
        // One step back: (T − T₁)/σt.
        const double back = (ray.passed + end - ray.targets.next_depth(flight_)) / kappa;
        const double in_cell = std::clamp(steps.length() - back, 0.0, steps.length()), s = steps.begin() + in_cell;
        ray.targets.take();
        const MediumPoint m = sample_.look_up(medium, ray_.at(s));
        const Rgb relative = relative_transmittance(steps.begin_depth() + DVec3(steps.point().sigma_t) * in_cell, h);
        const double density = n * glm::dot(ray.share, DVec3(relative) * (DVec3(m.sigma_t) + added));
        const Rgb weight = density > 0 ? relative * static_cast<float>(std::exp(added * (s - steps.entry())) / density) : Rgb(0);
        beta_ = beta;
        see(aov_weight_ / static_cast<float>(n), albedo(m), Vec3(0), s);
        add(weight * m.emission);
        const bool last = ray.targets.left() == 0;
        const bool goes_on = scatters && scatter(medium, weight * m.sigma_s, point_before(world_, ray_, s, hit), last);
        if (last) return goes_on ? FlightEnd::kScattered : FlightEnd::kOver;
      }
      marched = end;
    }
    if (sample_.stopped) return FlightEnd::kOver;
    // (n − inside)/n L₀, by the mixture of the channels' probabilities to get through.
    Rgb relative = relative_transmittance(steps.end_depth(), h);
    if (!grows) relative *= Rgb(glm::equal(unbounded->point.sigma_t, Rgb(0)));
    const DVec3 density = ray.share * DVec3(relative);
    const double mixture = density.x + density.y + density.z, left = static_cast<double>(ray.targets.left()) / n;
    ray.share = density / mixture;
    ray.passed += marched;
    beta_ = beta * relative * static_cast<float>(std::exp(added * (steps.begin() - steps.entry())) * left / mixture);
    aov_weight_ *= static_cast<float>(left);
    return is_black(beta_) ? FlightEnd::kOver : FlightEnd::kThrough;
  }

  /// exp(−τ_c)/exp(−τ_h): where each is too small for a float, the quotient is right.
  static Rgb relative_transmittance(DVec3 depth, int h) { return Rgb(glm::exp(DVec3(depth[h]) - depth)); }

  /// The last distance of a ray is followed by the path itself, the others by branches. True where the path goes on.
  bool scatter(const Medium& medium, Rgb weight, DVec3 p, bool last) {
    if (is_black(weight)) return false;
    if (last) {
      beta_ *= weight;
      return scatter_in_medium(medium, p);
    }
    LinePath other = branch(weight);
    if (other.scatter_in_medium(medium, p)) {
      other.line_ = other.begin(1);
      other.follow();
    }
    return false;
  }

  LineRay line_;
};

}  // namespace

PathResult trace_line(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count) {
  return trace_paper_path<LinePath>(world, plan, ray, key, count);
}

}  // namespace woodcock
