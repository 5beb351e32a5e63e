// A phase function given by values at angles.
#pragma once

#include <vector>

#include "renderer/core/distribution.h"
#include "renderer/media/deflection.h"
#include "renderer/scene/description.h"

namespace woodcock {

/// Interpolates linearly in the cosine between the angles of a table, scaled to integrate to 1 over the sphere.
///
/// Nodes lie at x = 1 − cos θ = 2 sin²(θ/2), in double, so that a table may resolve a peak at 0 or 180 degrees. The
/// distribution of x is piecewise quadratic, and its inversion needs no division by a slope.
class TabulatedPhase {
 public:
  /// A table without fault (`phase_fault`).
  explicit TabulatedPhase(const TabulatedPhaseDescription& table);

  /// Density per steradian.
  float eval(const Deflection& c) const;
  /// Inverts the distribution of the deflection at u in [0, 1): u = 0 is forward.
  Deflection sample(float u) const;
  /// What the table integrated to over the sphere before it was scaled.
  double given_integral() const { return given_integral_; }

 private:
  std::vector<double> x_, values_;
  DiscreteDistribution intervals_;
  double given_integral_ = 1;
};

}  // namespace woodcock
