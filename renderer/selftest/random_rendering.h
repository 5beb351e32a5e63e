// Ways to render a scene, of those that must give the same.
#pragma once

#include "renderer/selftest/measurement.h"
#include "renderer/selftest/random_draws.h"

namespace woodcock::selftest {

/// What a scene allows: not every way ends in time, or within bounds of the variance, in every scene.
struct Allowance {
  bool without_roulette = false;        ///< throughput falls at every scattering
  bool without_light_sampling = false;  ///< all light can be met
  bool without_mis = false;             ///< no light is near to what it lights
  bool uniform_directions = false;      ///< no phase function has a peak
  bool surfaces_only = false;           ///< no medium scatters
};
Allowance allowance_of(const Scene& scene);

/// `auto` most often; else without one of its features, without its plan, by its full kernel, or by another unbiased estimator.
Rendering random_rendering(RandomDraws& draw, const Scene& scene);

}  // namespace woodcock::selftest
