#include "renderer/media/tabulated_phase.h"

#include <algorithm>
#include <cmath>

namespace woodcock {

TabulatedPhase::TabulatedPhase(const TabulatedPhaseDescription& table) {
  for (const float angle : table.angles) {
    const double half_sine = std::sin(static_cast<double>(angle) / 360 * 3.14159265358979323846);
    x_.push_back(2 * half_sine * half_sine);
  }
  values_.assign(table.values.begin(), table.values.end());
  std::vector<double> weights;
  for (size_t i = 0; i + 1 < x_.size(); ++i) weights.push_back(0.5 * (values_[i] + values_[i + 1]) * (x_[i + 1] - x_[i]));
  intervals_ = DiscreteDistribution(weights);
  given_integral_ = 2 * 3.14159265358979323846 * intervals_.total();
  for (double& value : values_) value /= given_integral_;
}

float TabulatedPhase::eval(const Deflection& c) const {
  const double x = c.one_minus_cos < c.one_plus_cos ? static_cast<double>(c.one_minus_cos) : 2 - static_cast<double>(c.one_plus_cos);
  const auto upper = std::upper_bound(x_.begin() + 1, x_.end() - 1, x);
  const auto i = static_cast<size_t>(upper - x_.begin()) - 1;
  const double t = std::clamp((x - x_[i]) / (x_[i + 1] - x_[i]), 0.0, 1.0);
  return static_cast<float>((1 - t) * values_[i] + t * values_[i + 1]);
}

Deflection TabulatedPhase::sample(float u) const {
  const auto [i, r] = intervals_.sample(static_cast<double>(u));
  const double f0 = values_[i], f1 = values_[i + 1];
  // f0 t + (f1 − f0) t²/2 = r (f0 + f1)/2, by the root that does not cancel. An interval that is chosen has f0 + f1 > 0.
  const double t = r == 0 ? 0 : r * (f0 + f1) / (f0 + std::sqrt((1 - r) * f0 * f0 + r * f1 * f1));
  const double x = std::clamp(x_[i] + t * (x_[i + 1] - x_[i]), 0.0, 2.0);
  return Deflection::of_complements(static_cast<float>(x), static_cast<float>(2 - x));
}

}  // namespace woodcock
