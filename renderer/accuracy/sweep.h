// The arithmetic of a sweep: errors of many pictures of one scene, by estimator, sample count and seed.
//
// A curve is one estimator with one set of settings. Each of its seeds renders the largest count once; the smaller counts are
// prefixes of it. So the points of one seed depend on each other and those of different seeds do not: every interval
// here is Student's t *between seeds*. "Relative MSE" is as in `ErrorEstimate`, with the reference r in place of the picture:
// mean over pixels of (x − r)²/(r² + (0.01 · mean r)²), of luminance.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "renderer/accuracy/error.h"

namespace woodcock {

/// "1,2,4,8" as numbers; "1,2,...,64" (or "…") goes on by the factor of the two before it, up to the one after it. Throws
/// std::invalid_argument where they do not ascend, are not whole, or are more than kMaxCounts.
std::vector<int64_t> parse_sample_counts(const std::string& text);
inline constexpr size_t kMaxCounts = 40;

/// One run of a sweep: the samples [0, `samples`) of a curve and a seed.
struct SweepStep {
  size_t curve = 0, seed = 0;
  int64_t samples = 0;
};

/// The runs in their order: every curve and seed at the smallest count, then at the next, so that a sweep that is
/// interrupted has all curves up to some count. `counts` ascend.
std::vector<SweepStep> sweep_order(size_t curves, size_t seeds, std::span<const int64_t> counts);

/// What one run found.
struct SweepPoint {
  int64_t samples = 0;
  double cpu_seconds = 0;   ///< of all samples [0, samples)
  double relative_mse = 0;  ///< against the reference as it is, its own error included
};

/// Relative MSE of the luminances of a picture. A pixel that is black in a black reference counts (x − r)²/1 where x differs.
double relative_mse(std::span<const float> picture, std::span<const float> reference);

/// What stays of the error of a curve when its noise is averaged away.
struct BiasFloor {
  double relative_mse = 0;  ///< the squared floor; may be negative where it is noise
  double half_width = 0;    ///< of a 95 % interval, from the scatter of the pixels: wide of the truth rather than narrow
  bool seen() const { return relative_mse > half_width; }
};

/// From pictures of equal counts, one a seed: mean over pixels of ((m − r)² − s²/S)/(r² + …), m and s² the mean and the variance
/// between the S seeds, less the reference's own error. Absent for S < 2: one seed does not tell bias from noise.
std::optional<BiasFloor> bias_floor(std::span<const std::vector<float>> pictures, std::span<const float> reference, double reference_mse);

/// The seeds of a curve at one count.
struct CountSummary {
  int64_t samples = 0;
  size_t seeds = 0;
  double cpu_seconds = 0;   ///< mean over the seeds
  double relative_mse = 0;  ///< mean over the seeds, the reference's own error subtracted; may be negative where that is all there is
  std::optional<double> half_width;  ///< 95 %, between seeds; absent for one seed
};

/// A fitted power law error ∝ n^value, from at least three counts.
struct Slope {
  double value = 0;                  ///< of the relative MSE without floor and reference error; −1 for independent samples
  std::optional<double> half_width;  ///< 95 %, between seeds; absent for one seed
  int64_t from = 0, to = 0;          ///< the counts it is fitted over
  /// Whether the error falls at least as fast as 1/n, as far as the seeds can tell.
  bool falls_with_samples() const;
};

/// All that a report says of a curve.
struct CurveSummary {
  std::vector<CountSummary> counts;
  std::optional<BiasFloor> floor;
  std::optional<Slope> slope;
  /// 1/(relative MSE of the noise × CPU seconds), the same for every count where the error falls as 1/n; taken at the largest
  /// count whose noise exceeds floor and reference error. `half_width` between seeds, 0 for one seed.
  std::optional<Estimate> efficiency;
  int64_t efficiency_at = 0;  ///< that count
  /// Why single samples carry the pictures (heavy_tail_reason of convergence.h), for the caller to fill in; empty where none do.
  std::string heavy_tail;

  /// The squared floor that is taken off to see the noise: 0 where none is seen.
  double floor_mse() const { return floor && floor->seen() ? floor->relative_mse : 0; }
};

/// `seeds[s]` are the points of one seed with ascending counts; seeds may have come to different counts.
CurveSummary summarise_curve(std::span<const std::vector<SweepPoint>> seeds, double reference_mse, const std::optional<BiasFloor>& floor);

/// When a curve reaches an error.
struct TimeToError {
  enum class Kind {
    kAtMost,        ///< the smallest count is there already
    kMeasured,      ///< between two counts, along a line in the logarithms
    kExtrapolated,  ///< beyond the largest count, as 1/n
    kNever,         ///< the bias floor lies above
    kUnknown,       ///< beyond the largest count, and the error does not fall as 1/n, or nothing was measured
  };
  Kind kind = Kind::kUnknown;
  double cpu_seconds = 0;
  double samples = 0;
};

/// `error` is √ of a relative MSE: 0.01 for 1 %.
TimeToError time_to_error(const CurveSummary& curve, double error);

}  // namespace woodcock
