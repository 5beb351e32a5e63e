// What a picture will cost, told from a short pilot.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "renderer/accuracy/convergence.h"

namespace woodcock {

/// What a pilot measured: the samples [0, n) of some of the frame's pixels.
struct Pilot {
  Convergence record;
  double pixel_share = 1;         ///< of the frame's pixels that it rendered
  double seconds_per_sample = 0;  ///< CPU time of one sample of every pixel of the frame
  double seconds_deviation = 0;   ///< relative standard deviation of that, from the scatter of the parts that were rendered
  double cpu_seconds = 0;         ///< what the pilot itself took
};

/// What an error costs, or what samples reach. Intervals are of 95 %.
struct Quote {
  double error = 0;                                        ///< relative, E
  int64_t samples = 0, samples_low = 0, samples_high = 0;  ///< of every pixel
  double cpu_seconds = 0, cpu_low = 0, cpu_high = 0;       ///< of all samples, the pilot's included
  /// Why it may be wrong by more than it says; empty for a quote that holds.
  std::string uncertain;
};

/// A quote says it is uncertain where its interval of samples is wider than ± this.
inline constexpr double kQuoteTolerance = 0.1;

/// Samples and time for the relative error `error` > 0. The interval holds the noise of the pilot's E² and as much again for that
/// of the E² that will be measured in the end, the pixels that a partial pilot left out, and what `predict_error` says of
/// bias and slope. Absent where the pilot saw no error: fewer than two samples, or a black picture.
std::optional<Quote> quote_error(const Pilot& pilot, double error);

/// The error that `samples` ≥ 1 of every pixel will reach, and their time; `samples_low` and `samples_high` are those that reach the
/// same error at worst and at best.
std::optional<Quote> quote_samples(const Pilot& pilot, int64_t samples);

}  // namespace woodcock
