// The phase functions of media: the list of models, and their mixture at a point.
//
// A model gives its density for a deflection, normalised to 1 over the sphere, and samples deflections in proportion to
// it, so that sampled directions weigh exactly 1.
#pragma once

#include <span>
#include <variant>

#include "renderer/media/henyey_greenstein.h"
#include "renderer/media/tabulated_phase.h"
#include "renderer/media/two_lobe.h"
#include "renderer/scene/description.h"

namespace woodcock {

using PhaseFunction = std::variant<HenyeyGreenstein, Draine, TwoLobe, TabulatedPhase>;

/// A description without fault (`phase_fault`).
PhaseFunction make_phase_function(const PhaseDescription& description);

/// All models but Henyey-Greenstein, which stands by itself since most media have it.
float eval_other(const PhaseFunction& phase, const Deflection& c);
Deflection sample_other(const PhaseFunction& phase, float u, float u_choice);

/// Density per steradian; `wo` and `wi` as for `deflection`.
inline float eval(const PhaseFunction& phase, Vec3 wo, Vec3 wi) {
  const Deflection c = deflection(wo, wi);
  if (const auto* hg = std::get_if<HenyeyGreenstein>(&phase)) return hg->eval(c);
  return eval_other(phase, c);
}

/// Samples `wi` given `wo`, proportional to eval: u in [0,1)² for the direction, `u_choice` in [0,1) for the choice of a lobe.
inline PhaseSample sample(const PhaseFunction& phase, Vec3 wo, Vec2 u, float u_choice) {
  if (const auto* hg = std::get_if<HenyeyGreenstein>(&phase)) return hg->sample(wo, u);
  const Deflection c = sample_other(phase, u.x, u_choice);
  return {deflect(wo, c, u.y), eval_other(phase, c)};
}

/// The phase function at one point of a medium, as estimators see it: that of the medium, or of the parts of a sum, mixed in
/// each channel in proportion to their σs there.
class PhaseMix {
 public:
  struct Sample {
    Vec3 wi;
    float pdf;   ///< per steradian
    Rgb weight;  ///< eval / pdf per channel
  };

  explicit PhaseMix(const PhaseFunction& phase) : count_(1), phases_{&phase} {}
  /// At most kMaxSummedMedia, at least one, each with a σs that is not black.
  PhaseMix(std::span<const PhaseFunction* const> phases, std::span<const Rgb> sigma_s);

  /// Density per steradian and channel; directions as for `deflection`.
  Rgb eval(Vec3 wo, Vec3 wi) const {
    if (count_ == 1) return Rgb(woodcock::eval(*phases_[0], wo, wi));
    return mixed(wo, wi).value;
  }
  /// The density with which `sample` gives `wi`.
  float pdf(Vec3 wo, Vec3 wi) const {
    if (count_ == 1) return woodcock::eval(*phases_[0], wo, wi);
    return mixed(wo, wi).pdf;
  }
  /// u in [0,1)² for the direction, `u_choice` in [0,1) for the choice of a component.
  Sample sample(Vec3 wo, Vec2 u, float u_choice) const {
    if (count_ > 1) return sample_mixed(wo, u, u_choice);
    const PhaseSample s = woodcock::sample(*phases_[0], wo, u, u_choice);
    return {s.wi, s.pdf, Rgb(1)};
  }

 private:
  struct Mixed {
    Rgb value;
    float pdf;
  };
  Mixed mixed(Vec3 wo, Vec3 wi) const;
  Sample sample_mixed(Vec3 wo, Vec2 u, float u_choice) const;

  int count_;
  const PhaseFunction* phases_[kMaxSummedMedia];
  Rgb shares_[kMaxSummedMedia];     ///< σs over the sum of σs, per channel; unset for one component, as the next
  float choices_[kMaxSummedMedia];  ///< probability of each component: its share of the mean σs
};

}  // namespace woodcock
