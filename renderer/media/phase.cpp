#include "renderer/media/phase.h"

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

}  // namespace woodcock
