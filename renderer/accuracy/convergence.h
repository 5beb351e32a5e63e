// How the error of one render fell while its samples grew, and what that lets one expect of more samples.
//
// The counts of one render are nested: the samples [0, n) are a part of [0, 2n), so their errors are not independent.
// For normal samples s² of the first m and of the first n samples have the covariance Var(s²_n) (s²_n is complete and
// sufficient); with K = 4 replicates of n/4 samples each, squared means of a part and of the whole correlate by m/n. So
//     corr(m, n) = g(m)/g(n),   g(n) = sqrt(n − 1) for n ≤ 4,   sqrt(3)·n/4 beyond,
// a Markov chain: the part of each error that the one before it does not explain is independent of all earlier ones, and
// the fits here weigh these increments. From 4 samples on they are what independent dyadic halves contribute.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "renderer/accuracy/error.h"

namespace woodcock {

/// The picture of the first `samples` samples per pixel.
struct ConvergencePoint {
  int64_t samples = 0;
  ErrorEstimate error;
  double cpu_seconds = 0;  ///< CPU time of the threads that rendered them, added up; it holds on a busy machine
};

/// The record of one render: smallest count first.
struct Convergence {
  std::vector<ConvergencePoint> points;
  int64_t timed_from = 0;  ///< samples that were there before: `cpu_seconds` counts from them on
};

/// CPU seconds a sample per pixel took: those of the last point over its timed samples. 0 where nothing was timed.
double seconds_per_sample(const Convergence& record);

/// The slope of log(E²) against log(samples) with its 95 % interval, by generalised least squares over the points from 8
/// samples on with an error below 50 %. E² is taken without the bias of its denominators (`unbiased_relative_mse`); the
/// weights hold the noise of each estimate and, for the bias that is left, 2·E⁴. Absent for fewer than three such points. −1
/// for independent samples; low-discrepancy ones can be steeper.
std::optional<Estimate> mse_slope(std::span<const ConvergencePoint> points);

/// The slope may be off by this before it counts: a tenth of the error then costs at most a quarter more than was said.
inline constexpr double kSlopeTolerance = 0.05;

/// Why the last error and what follows from it are not to be trusted; empty where nothing speaks against it. Grounds: the
/// slope is flatter than −1 beyond its interval and the tolerance; one sample carries a quarter of the squared error or of
/// the variance of the image mean, among at least 256; from 128 samples a pixel on, the largest of them is a quarter of the sum
/// of their squares, on average over the pixels (ordinary noise: a tenth, and falling as 1/samples; without a variance it stays).
/// Light that no sample has found yet leaves no trace: such a picture cannot be told from a good one.
std::string heavy_tail_reason(std::span<const ConvergencePoint> points);
/// The same from one estimate alone, without the slope.
std::string heavy_tail_reason(const ErrorEstimate& error);
inline bool heavy_tailed(std::span<const ConvergencePoint> points) { return !heavy_tail_reason(points).empty(); }

/// What an error smaller than the last point's would take. E² goes with a power of the samples: the slope of the last four points
/// where that is steeper than −1 beyond three standard deviations and the tolerance, else −1 ± 0.03 made better by the slope of
/// the last six (their mean by weight). The bias that E² has at the last point and will have less of is accounted for. The
/// interval (95 %) holds the noise of the last error, what is left of its bias, and the slope's; where a steeper fall is
/// followed it reaches up to slope −1 and to the next power of two.
struct Prediction {
  double error = 0;     ///< relative, E
  int64_t samples = 0;  ///< per pixel in all, those that are there included
  int64_t samples_low = 0, samples_high = 0;
  double cpu_seconds = 0;  ///< of the samples that are still to be rendered
};

/// For the relative error `target` > 0; absent where the error is unknown or zero.
std::optional<Prediction> predict_error(const Convergence& record, double target);

/// For half, a quarter and a tenth of the error; empty where it is unknown or zero, or the record is heavy-tailed: then
/// nobody knows.
std::vector<Prediction> predict(const Convergence& record);

}  // namespace woodcock
