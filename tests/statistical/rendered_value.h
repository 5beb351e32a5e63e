// Renders a scene text in which every pixel estimates the same value, and says how well it is known.
#pragma once

#include <cstdint>
#include <string>

#include "renderer/frame/settings.h"
#include "renderer/transport/counters.h"

namespace woodcock::reference {

struct RenderedValue {
  double mean = 0;
  double standard_error = 0;   ///< of the mean, from the spread of the pixels
  int degrees_of_freedom = 1;  ///< pixels − 1
  PathCounters counters;
};

/// Renders 2^log2_samples samples in every pixel and averages the green channel (the scenes are grey). Pixels are
/// independent, whatever the sampler does inside one, so the error of the mean is taken between pixels.
RenderedValue render_value(const std::string& text, uint64_t seed, int log2_samples, const std::string& estimator = "auto");
/// The same by any settings, with `batches` times 2^log2_batch samples in every pixel.
RenderedValue render_value(const std::string& text, const FrameSettings& settings, int log2_batch, int batches);

/// A seed from a name: FNV-1a, so that a test keeps its numbers when others come or go.
uint64_t seed_of(const std::string& name);

/// x with P(|t| > x) = p for Student's t: the normal quantile, expanded in 1/dof (Cornish & Fisher; Abramowitz &
/// Stegun 26.7.5). Good to 1e-4 from 100 degrees of freedom on and p ≥ 1e-6.
double two_sided_t(double p, int degrees_of_freedom);

}  // namespace woodcock::reference
