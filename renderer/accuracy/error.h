// The error a frame has reached, from its own statistics.
//
// Errors are estimated *between* the 4 replicates, not from the scatter of single samples: with low-discrepancy numbers
// the samples of a replicate depend on each other, the replicates do not. Fewer than 4 samples are of as many
// replicates; from one sample nothing follows. All quantities are of Rec. 709 luminance.
// The sums use + − × ÷ and √ in double, in the order of the pixels, so that every program gets the same result.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "renderer/film/dyadic.h"
#include "renderer/film/exr.h"
#include "renderer/film/node.h"
#include "renderer/film/tile.h"

namespace woodcock {

/// A value with the half width of its 95 % confidence interval.
struct Estimate {
  double value = 0;
  double half_width = 0;
};

/// What is known about the error of a frame. Values that its samples do not support are absent.
struct ErrorEstimate {
  int64_t samples = 0;  ///< per pixel; the rounded mean where blocks hold different numbers
  int64_t pixels = 0;   ///< with all their samples; the others are left out of every mean
  int64_t missing_pixels = 0;
  double image_mean = 0;  ///< mean over the pixels
  int degrees = 0;        ///< of freedom: the replicates that hold samples, less one; 3 from 4 samples on
  /// Of the pixels' variances, which are independent: their numbers are scrambled for each pixel by itself.
  std::optional<double> image_mean_standard_error;
  /// Degrees of freedom of the former (Welch & Satterthwaite): the more, the evener the pixels' variances are.
  std::optional<double> image_mean_degrees;
  /// Half width of the 95 % interval of `image_mean`, by Student's t.
  std::optional<double> image_mean_half_width;
  /// E = sqrt(mean over pixels of Var(x̄)/(x̄² + (0.01·image mean)²)), and a 95 % interval from the scatter of the pixels
  /// (wide of the truth rather than narrow: differences between parts of the image count as scatter).
  std::optional<Estimate> relative_error;
  std::optional<double> relative_mse;  ///< E²
  /// E² as it would be with the true means of the pixels in its denominator, by the jackknife: where single samples are rare and
  /// large, E² itself is too small as long as E is beyond some 10 %. From three samples on; may be negative.
  std::optional<double> unbiased_relative_mse;
  /// Relative standard deviation of `relative_mse` as an estimate, for replicates with normal means: what the noise of the
  /// pixels' variances (2/ν each) and means makes of it, without what differs between the pixels themselves.
  std::optional<double> mse_deviation;
  std::optional<double> standard_error;  ///< sqrt(mean over pixels of Var(x̄)), in units of radiance
  /// Share of the pixels that owe more than a tenth of their value to one sample; of those with kFireflySamples at least.
  std::optional<double> firefly_share;
  /// Mean over the pixels of largest²/Σ sample², absent below kFireflySamples. It falls about as 1/n where samples have a
  /// variance; where P(sample > v) ~ v^-α with α < 2 it stays near 1 − α/2, however many they are (Darling 1952, "The influence of the
  /// maximum term in the addition of independent random variables").
  std::optional<double> largest_square_share;
  /// The largest share that one sample has of the picture's E² or of the variance of its mean.
  std::optional<double> one_sample_share;
};

/// Below this the largest of ordinary samples is a tenth of the whole anyway.
inline constexpr int64_t kFireflySamples = 64;

/// Var(x̄) of one pixel's luminance: Σ n_k (r_k − x̄)² / ((K − 1)·n) over the K ≤ 4 replicates that hold n_k > 0 samples of
/// mean r_k; unbiased for independent replicates. `weights` as for the pixel's range, with two replicates at least.
double variance_of_mean(const PixelStats& pixel, const FoldWeights& weights);

/// Var(x̄)/(x̄² + floor²) of one pixel, plain and without the bias of order 1/n that the noise of x̄ gives it (jackknife; may be
/// negative). Black pixels have 0, and so have pixels with one replicate, of which nothing is known.
struct RelativeTerm {
  double plain = 0, unbiased = 0;
};
RelativeTerm relative_term(const PixelStats& pixel, const FoldWeights& weights, double floor);

/// The weights of each pixel of a picture: those of one range, or, in a frame with a sample map, of [0, the pixel's count).
class PixelWeights {
 public:
  explicit PixelWeights(SampleRange range) : weights_(range) {}
  static PixelWeights by_count() { return PixelWeights(); }

  /// `pixel` must not be missing. Valid until the next call.
  const FoldWeights& of(const PixelStats& pixel) {
    if (by_count_ && static_cast<double>(pixel.count) != weights_.samples)
      weights_ = FoldWeights(SampleRange{0, static_cast<int64_t>(pixel.count)});
    return weights_;
  }

 private:
  PixelWeights() : by_count_(true) {}

  FoldWeights weights_;
  bool by_count_ = false;
};

/// The estimate of a picture that comes in pieces: all of it is added twice, in the order of its pixels.
class ErrorSums {
 public:
  explicit ErrorSums(PixelWeights weights);
  ErrorSums(ErrorSums&&) noexcept;
  ~ErrorSums();

  void add(std::span<const PixelStats> piece);
  void begin_second_round();
  /// After the second round.
  ErrorEstimate estimate();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  bool second_ = false;
};

/// Samples per pixel that reach `error_factor` (½, ¼, …) of the present error: error² falls as 1/samples.
int64_t samples_for(int64_t samples, double error_factor);

/// The error of a picture whose pixels hold the samples of `range`.
ErrorEstimate estimate_error(std::span<const PixelStats> picture, SampleRange range);

/// The error of the fold of `nodes`: the maximal dyadic nodes of one range, in order, of one rectangle.
ErrorEstimate estimate_error(std::span<const Tile> nodes);

/// The error of a node file, read by rows (twice). Throws FilmError.
ErrorEstimate estimate_error(const std::filesystem::path& exr);

/// The errors of the pictures of the first `counts[i]` samples, powers of two in order: from the tiles of one frame, node files
/// that hold these samples of all its pixels. As `estimate_error` of each picture, in reading every tile twice. Throws FilmError.
std::vector<ErrorEstimate> estimate_prefixes(std::span<const std::filesystem::path> tiles, std::span<const int64_t> counts);

/// A few lines of plain text, each ending in a newline.
std::string format_error(const ErrorEstimate& error);

/// The same as numbers with names, absent ones left out, for JSON and tables.
std::vector<std::pair<std::string, double>> error_fields(const ErrorEstimate& error);

/// The inverse, up to fields that follow from others. Unknown names are passed over; throws std::invalid_argument where one that every
/// estimate has is missing or no number can be what it says.
ErrorEstimate error_from_fields(const std::map<std::string, double>& fields);

}  // namespace woodcock
