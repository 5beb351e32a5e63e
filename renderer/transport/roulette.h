// Russian roulette on what a path carries.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "renderer/core/vec.h"

namespace woodcock {

/// Paths that carry at least this share of what they began with go on without a decision. One whose throughput has fallen below is
/// not worth a whole path, but the last few scatterings of a bright path bring much of its light: on surfaces and in
/// thin media a threshold of one costs 1.3 to 1.6 times the work for the same error (docs/performance.md).
inline constexpr float kRouletteThreshold = 0.25f;

/// The largest size of a channel, one that is NaN left out (as std::fmax does, which is a call).
inline float largest_channel(Rgb beta) {
  const auto larger = [](float a, float b) { return a >= b || b != b ? a : b; };
  return larger(std::abs(beta.r), larger(std::abs(beta.g), std::abs(beta.b)));
}

/// The probability with which a path of throughput β goes on (and β is divided by it): min(1, max |β| η² / (threshold · start)), where η²
/// is the scale that refraction alone gives to radiance, which is no loss, and `start` what the path began with. By the size of β, since
/// unbiased ray marching may turn its sign.
inline float roulette_survival(Rgb beta, float eta_scale, float start = 1) {
  return std::min(1.0f, largest_channel(beta) * eta_scale / (kRouletteThreshold * start));
}

/// Light samples in media whose phase function and throughput come to half of what an even scattering of a fresh path has are traced in any
/// case.
inline constexpr float kLightSampleThreshold = 0.5f;

/// The probability with which a light sample at a scattering in a medium is traced, min(1, 4π max |β f| / threshold), f the phase function:
/// a shadow ray through a volume costs as much as a flight, and most directions of a forward peak bring little.
inline float light_sample_survival(Rgb beta_f) {
  return std::min(1.0f, 4 * std::numbers::pi_v<float> * largest_channel(beta_f) / kLightSampleThreshold);
}

}  // namespace woodcock
