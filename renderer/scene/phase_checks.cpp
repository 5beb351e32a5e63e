#include "renderer/scene/phase_checks.h"

#include <fmt/format.h>

#include <cmath>

namespace woodcock {
namespace {

using Fault = std::optional<std::string>;

struct Check {
  static Fault mean_cosine(float g, const char* name) {
    if (std::abs(g) <= static_cast<float>(kMaxMeanCosine)) return std::nullopt;
    return fmt::format("{} = {}, expected a mean cosine from -0.9999 to 0.9999", name, g);
  }
  static Fault within(float value, double lowest, double highest, const char* name) {
    if (static_cast<double>(value) >= lowest && static_cast<double>(value) <= highest) return std::nullopt;
    return fmt::format("{} = {}, expected a value from {} to {}", name, value, lowest, highest);
  }

  Fault operator()(const HenyeyGreensteinDescription& d) const { return mean_cosine(d.g, "g"); }
  Fault operator()(const TwoLobeDescription& d) const {
    if (const Fault fault = mean_cosine(d.g, "g")) return fault;
    if (const Fault fault = mean_cosine(d.g2, "g2")) return fault;
    return within(d.weight, 0, 1, "lobeweight");
  }
  Fault operator()(const DraineDescription& d) const {
    if (const Fault fault = mean_cosine(d.g, "g")) return fault;
    return within(d.alpha, 0, 1e6, "alpha");
  }
  Fault operator()(const MieDescription& d) const { return within(d.droplet_diameter, kMinDroplet, kMaxDroplet, "dropletdiameter"); }
  Fault operator()(const TabulatedPhaseDescription& d) const {
    if (d.angles.size() < 2 || d.angles.size() != d.values.size())
      return fmt::format("{} phaseangles and {} phasevalues, expected as many of one as of the other, and at least two", d.angles.size(),
                         d.values.size());
    if (d.angles.front() != 0 || d.angles.back() != 180)
      return fmt::format("phaseangles from {} to {}, expected degrees of deflection from 0 (straight ahead) to 180", d.angles.front(),
                         d.angles.back());
    bool positive = false;
    for (size_t i = 0; i < d.angles.size(); ++i) {
      if (i > 0 && !(d.angles[i] > d.angles[i - 1]))
        return fmt::format("the phaseangle {} after {}, expected angles that increase", d.angles[i], d.angles[i - 1]);
      if (!(d.values[i] >= 0) || !std::isfinite(d.values[i]))
        return fmt::format("the phasevalue {}, expected finite values that are not negative", d.values[i]);
      positive = positive || d.values[i] > 0;
    }
    if (!positive) return "only zeros for phasevalues, expected a phase function that is positive somewhere";
    return std::nullopt;
  }
};

}  // namespace

std::optional<std::string> phase_fault(const PhaseDescription& phase) { return std::visit(Check{}, phase); }

}  // namespace woodcock
