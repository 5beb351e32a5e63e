// Estimators against each other on one scene: the error that each reaches in equal time.
//
// Efficiency is 1/(relative variance × CPU time). The relative variance is the mean over pixels of Var(x̄)/(r² + (0.01·mean r)²), Var(x̄)
// from the scatter between replicates, r the same for all: the picture of all samples of the reference. (With each contender's own
// means below the line, one that finds light by rare chance would look good: its black pixels have neither value nor variance.) All
// quantities are of Rec. 709 luminance.
//
// Contenders take turns, one thread, in `kRounds` rounds, so that whatever else the machine does meets all of them. Each renders
// new samples every round, as many (a power of two) as fit the time it is given. A ratio is taken round by round; reported are the median
// and the smallest and largest of the 8, between which the median of such ratios lies with probability 1 − 2/2⁸ = 99.2 %.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "renderer/film/tile.h"
#include "renderer/frame/settings.h"

namespace woodcock::bench {

inline constexpr int kRounds = 8;  ///< a power of two: the samples of all rounds are one node of the tree

/// Who takes part, and with which settings.
struct Contender {
  std::string name;
  FrameSettings settings;
};

/// How far the expectation is from that of the reference: 0 for unbiased estimators. From the differences of the 8 replicates, which are
/// independent of each other.
struct Bias {
  double mean = 0, mean_error = 0;  ///< (mean of the picture)/(that of the reference) − 1, and its standard error
  /// Mean over pixels of (E x − E r)²/(r² + (0.01·mean r)²), estimated without bias by products of different replicates (so that noise
  /// does not count and it may come out negative), and its standard error by the jackknife over replicates.
  double square = 0, square_error = 0;
};

/// What came of a contender.
struct Outcome {
  std::string name;
  std::string refusal;  ///< why it cannot render the scene; empty where it can, and everything below is meant
  FrameHeader header;
  int64_t samples = 0;                    ///< per pixel and round
  std::array<double, kRounds> seconds{};  ///< CPU time of each round
  std::array<double, kRounds> relative_variance{};
  Bias bias;   ///< against the reference
  Tile first;  ///< the picture of the first round: what `samples` samples look like
  Tile all;    ///< and of all rounds

  double efficiency(int round) const { return 1 / (relative_variance[size_t(round)] * seconds[size_t(round)]); }
};

/// Median and range of the ratios of the rounds.
struct Ratio {
  double median = 0, lowest = 0, highest = 0;
};

/// Renders; the first contender is the reference and must be able to. `seconds` is the CPU time a round for each contender, met to within a
/// factor of two unless 8 samples, the fewest, take longer. Files outside the scene's folder may be read: the user named the scene. Throws
/// SceneError or std::invalid_argument where the first contender is refused.
std::vector<Outcome> contest(const std::string& scene, const std::vector<Contender>& contenders, double seconds);

/// How many times more efficient `a` is than `b`.
Ratio efficiency_ratio(const Outcome& a, const Outcome& b);
/// The same from the sums of variance and of time over all rounds: where light is found by rare chance, most rounds have too little
/// variance and the median of their ratios flatters, while this is right on average (and scatters).
double pooled_efficiency_ratio(const Outcome& a, const Outcome& b);
/// CPU time a sample of `a` over that of `b`.
Ratio time_ratio(const Outcome& a, const Outcome& b);

/// "5.1 [4.7, 5.6]"; "no noise" where the ratio is no number, since neither has variance.
std::string format(const Ratio& ratio);
/// "+0.31 % ± 0.05 %": of the picture's mean.
std::string format_mean(const Bias& bias);
/// "2.1 % ± 0.1 %": the square root of `square`; "< 0.4 %" where it is less than two standard errors from 0.
std::string format_pixels(const Bias& bias);
/// The middle of the values of the rounds.
double median(std::array<double, kRounds> values);
/// Three digits at most and no exponent.
std::string three_digits(double value);

}  // namespace woodcock::bench
