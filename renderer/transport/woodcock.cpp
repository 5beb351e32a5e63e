#include "renderer/transport/woodcock.h"

#include "renderer/media/extent.h"
#include "renderer/transport/paper_path.h"

namespace woodcock {
namespace {

/// σ̄ − σt, cut at 0. Rounding of the interpolation is no violation; the bound carries an allowance for it.
Rgb null_extinction(float majorant, Rgb sigma_t, PathCounters& count) {
  const Rgb sigma_n = Rgb(majorant) - sigma_t;
  for (int c = 0; c < 3; ++c)
    if (sigma_n[c] < -1e-4f * majorant) ++count.majorant_violations;
  return glm::max(sigma_n, Rgb(0));
}

class WoodcockPath : public PaperPath<WoodcockPath> {
 public:
  WoodcockPath(PathSample& sample, Ray ray, PathKey key, ScatterDirections directions) : PaperPath(sample, ray, key, directions) {}

  /// To the collision that stops the ray, if there is one before the end.
  FlightEnd cross_medium(const std::optional<Hit>& hit) {
    const Medium& medium = world_.media[medium_];
    const double z = hit ? hit->t : static_cast<double>(kInf);
    const bool scatters = medium.scatters() && may_scatter();
    const std::optional<UnboundedPart> unbounded = unbounded_part(medium, ray_, z);
    if (unbounded && is_infinite(*unbounded, scatters)) return add_infinite_radiance();
    const float majorant = medium.maximum_sigma_t();
    if (!(majorant > 0)) return FlightEnd::kThrough;
    const Extent extent = extent_of(medium, ray_, z);
    for (double t = extent.begin;;) {
      t += static_cast<double>(flight_.exponential()) / static_cast<double>(majorant);
      if (!(t < extent.end)) return FlightEnd::kThrough;
      const MediumPoint m = sample_.look_up(medium, ray_.at(t));
      if (sample_.stopped) return FlightEnd::kOver;
      if (unbounded && t >= unbounded->from) keep_one_group(*unbounded);
      const Rgb sigma_s = scatters ? m.sigma_s : Rgb(0), kappa = glm::max(m.sigma_t, sigma_s);
      const Rgb sigma_n = null_extinction(majorant, m.sigma_t, count_);
      const float real = glm::dot(beta_, kappa), all = glm::dot(beta_, kappa + sigma_n);
      if (!(all > 0)) return FlightEnd::kOver;
      if (!(real > 0)) {
        // Nothing dims the ray here. Emission without extinction is gathered at every tentative collision.
        if ((medium.is_homogeneous() || (unbounded && t >= unbounded->from)) && is_black(m.emission)) return FlightEnd::kThrough;
        add(m.emission / majorant);
        beta_ *= sigma_n / majorant;
        continue;
      }
      const float q = real / all;
      // In double: see PathKernel::track.
      if (!(flight_.uniform_double() < static_cast<double>(q))) {
        beta_ *= sigma_n / (majorant * (1 - q));
        continue;
      }
      const float density = majorant * q;
      see(aov_weight_, albedo(m), Vec3(0), t);
      aov_weight_ = 0;
      add(m.emission / density);
      if (is_black(sigma_s)) return FlightEnd::kOver;
      beta_ *= sigma_s / density;
      return scatter_in_medium(medium, point_before(world_, ray_, t, hit)) ? FlightEnd::kScattered : FlightEnd::kOver;
    }
  }

 private:
  /// In an unbounded part some channels may be dimmed for ever and others not at all, and tracking both would never end: the weight
  /// of the first would only shrink. One of the two groups is kept, chosen by its share of the throughput.
  void keep_one_group(const UnboundedPart& unbounded) {
    const Rgb fading(glm::greaterThan(unbounded.point.sigma_t, Rgb(0)));
    const float dimmed = glm::dot(beta_, fading), all = beta_.r + beta_.g + beta_.b;
    if (!(dimmed > 0 && dimmed < all)) return;
    const float share = dimmed / all;
    beta_ *= flight_.uniform() < share ? fading / share : (Rgb(1) - fading) / (1 - share);
  }
};

}  // namespace

PathResult trace_woodcock(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count) {
  return trace_paper_path<WoodcockPath>(world, plan, ray, key, count, ScatterDirections::kUniform);
}

PathResult trace_woodcock_phase(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count) {
  return trace_paper_path<WoodcockPath>(world, plan, ray, key, count, ScatterDirections::kPhase);
}

}  // namespace woodcock
