// The phase function of a medium.
#include <cmath>

#include "renderer/scene/phase_checks.h"
#include "renderer/scene/read_parts.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

float read_asymmetry(Parameters& parameters, const std::string& name) {
  const double g = parameters.number(name, 0);
  if (!(std::abs(g) <= kMaxMeanCosine))
    throw SceneError(
        parameters.place(name),
        "found " + name + " = " + std::to_string(g) + " for " + parameters.directive() +
            ", expected a mean cosine from -0.9999 to 0.9999: nearer to 1 scattering is not told from none; take the nearest of "
            "these and multiply sigma_s by (1 - g) over (1 - that), which keeps the effect of many scatterings");
  return static_cast<float>(g);
}

namespace {

TabulatedPhaseDescription read_table(Parameters& parameters) {
  TabulatedPhaseDescription table;
  for (const double angle : parameters.numbers("phaseangles")) table.angles.push_back(static_cast<float>(angle));
  for (const double value : parameters.numbers("phasevalues")) table.values.push_back(static_cast<float>(value));
  if (const auto fault = phase_fault(table))
    throw SceneError(parameters.place("phaseangles"), "found " + *fault + " in " + parameters.directive());
  return table;
}

}  // namespace

PhaseDescription read_phase(Parameters& parameters) {
  const std::string kind = parameters.choice("phase", "henyeygreenstein",
                                             {"isotropic", "henyeygreenstein", "twolobe", "rayleigh", "draine", "mie", "tabulated"});
  if (kind == "isotropic") return HenyeyGreensteinDescription{0};
  if (kind == "henyeygreenstein") return HenyeyGreensteinDescription{read_asymmetry(parameters)};
  if (kind == "twolobe")
    return TwoLobeDescription{read_asymmetry(parameters, "g"), read_asymmetry(parameters, "g2"),
                              static_cast<float>(parameters.number_within("lobeweight", 0.5, 0, 1))};
  if (kind == "rayleigh") return DraineDescription{0, 1};
  if (kind == "draine")
    return DraineDescription{read_asymmetry(parameters), static_cast<float>(parameters.number_within("alpha", 1, 0, 1e6))};
  if (kind == "mie") {
    if (!parameters.has("dropletdiameter"))
      throw SceneError(parameters.place("phase"), "found the phase function \"mie\" without \"float dropletdiameter\" for " +
                                                      parameters.directive() + ", expected a diameter from 5 to 50 micrometres");
    return MieDescription{static_cast<float>(parameters.number_within("dropletdiameter", 0, kMinDroplet, kMaxDroplet))};
  }
  return read_table(parameters);
}

}  // namespace woodcock
