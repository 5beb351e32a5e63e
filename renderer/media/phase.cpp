#include "renderer/media/phase.h"

#include <algorithm>

namespace woodcock {

PhaseFunction make_phase_function(const PhaseDescription& description) {
  struct Make {
    PhaseFunction operator()(const HenyeyGreensteinDescription& d) const { return HenyeyGreenstein{d.g}; }
    PhaseFunction operator()(const TwoLobeDescription& d) const { return TwoLobe{{d.g}, {d.g2, 0}, d.weight}; }
    PhaseFunction operator()(const DraineDescription& d) const { return Draine{d.g, d.alpha}; }
    PhaseFunction operator()(const MieDescription& d) const { return mie_fit(d.droplet_diameter); }
    PhaseFunction operator()(const TabulatedPhaseDescription& d) const { return TabulatedPhase(d); }
  };
  return std::visit(Make{}, description);
}

float eval_other(const PhaseFunction& phase, const Deflection& c) {
  return std::visit([&](const auto& model) { return model.eval(c); }, phase);
}

Deflection sample_other(const PhaseFunction& phase, float u, float u_choice) {
  struct Sample {
    float u, u_choice;
    Deflection operator()(const HenyeyGreenstein& hg) const { return hg.sample(u); }
    Deflection operator()(const Draine& draine) const { return draine.sample(u); }
    Deflection operator()(const TwoLobe& lobes) const { return lobes.sample(u, u_choice); }
    Deflection operator()(const TabulatedPhase& table) const { return table.sample(u); }
  };
  return std::visit(Sample{u, u_choice}, phase);
}

PhaseMix::PhaseMix(std::span<const PhaseFunction* const> phases, std::span<const Rgb> sigma_s) : count_(static_cast<int>(phases.size())) {
  Rgb total{0};
  for (const Rgb s : sigma_s) total += s;
  const float mean = average(total);
  for (size_t i = 0; i < phases.size(); ++i) {
    phases_[i] = phases[i];
    for (int c = 0; c < 3; ++c) shares_[i][c] = total[c] > 0 ? sigma_s[i][c] / total[c] : 0;
    choices_[i] = average(sigma_s[i]) / mean;
  }
}

PhaseMix::Mixed PhaseMix::mixed(Vec3 wo, Vec3 wi) const {
  Mixed sum{Rgb(0), 0};
  for (int i = 0; i < count_; ++i) {
    const float p = woodcock::eval(*phases_[i], wo, wi);
    sum.value += shares_[i] * p;
    sum.pdf += choices_[i] * p;
  }
  return sum;
}

PhaseMix::Sample PhaseMix::sample_mixed(Vec3 wo, Vec2 u, float u_choice) const {
  // What is left of the number after the choice is uniform again, for a component with lobes of its own.
  int i = 0;
  while (i + 1 < count_ && u_choice >= choices_[i]) u_choice -= choices_[i++];
  const PhaseSample s = woodcock::sample(*phases_[i], wo, u, std::clamp(u_choice / choices_[i], 0.0f, kOneMinusEpsilon));
  const Mixed sum = mixed(wo, s.wi);
  return {s.wi, sum.pdf, sum.value / sum.pdf};
}

}  // namespace woodcock
