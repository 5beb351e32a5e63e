#include "renderer/accuracy/error.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "renderer/accuracy/student.h"
#include "renderer/film/merge.h"

namespace woodcock {

namespace {

constexpr double kConfidence = 0.95;

/// The mean of the replicates that hold samples, weighted by them.
double mean_luminance(const std::array<double, kReplicates>& replicate, const FoldWeights& weights) {
  double sum = 0;
  for (size_t k = 0; k < kReplicates; ++k) sum += weights.of_replicate[k] * replicate[k];
  return sum / weights.samples;
}

std::array<double, kReplicates> replicates_of(const PixelStats& pixel) {
  std::array<double, kReplicates> values;
  std::copy(pixel.replicate.begin(), pixel.replicate.end(), values.begin());
  return values;
}

int degrees_of(const FoldWeights& weights) {
  return static_cast<int>(std::count_if(weights.of_replicate.begin(), weights.of_replicate.end(), [](double n) { return n > 0; })) - 1;
}

double variance_between(const std::array<double, kReplicates>& replicate, const FoldWeights& weights) {
  const double mean = mean_luminance(replicate, weights);
  double sum = 0;
  for (size_t k = 0; k < kReplicates; ++k) sum += weights.of_replicate[k] * (replicate[k] - mean) * (replicate[k] - mean);
  return sum / (degrees_of(weights) * weights.samples);
}

/// Var(x̄)/(x̄² + floor²) without the bias of order 1/n that a noisy x̄ gives it: the jackknife over the replicates that hold
/// samples (Efron & Stein 1981), of the quantity n·Var(x̄)/(x̄² + floor²), which does not depend on n otherwise. For
/// replicates equally full up to rounding; two of them leave nothing to compare with and the term as it is.
double jackknifed_term(const std::array<double, kReplicates>& replicate, const FoldWeights& weights, double term, double floor) {
  double k = 0, sum = 0, squares = 0;
  for (size_t i = 0; i < kReplicates; ++i) {
    if (weights.of_replicate[i] == 0) continue;
    k += 1;
    sum += replicate[i];
  }
  if (k < 3) return term;
  const double mean = sum / k;
  for (size_t i = 0; i < kReplicates; ++i)
    if (weights.of_replicate[i] > 0) squares += (replicate[i] - mean) * (replicate[i] - mean);
  double without = 0;  // mean over i of what the others say, for as many samples as there are
  for (size_t i = 0; i < kReplicates; ++i) {
    if (weights.of_replicate[i] == 0) continue;
    const double d = replicate[i] - mean, m = mean - d / (k - 1);
    const double scale = m * m + floor * floor, v = std::max(0.0, squares - d * d * k / (k - 1)) / ((k - 2) * k);
    if (scale > 0) without += v / scale / k;
  }
  return k * term - (k - 1) * without;
}

/// One pixel's Var(x̄), x̄, x̄² + floor², and what the first is of the last; a black pixel of a black image has no error.
struct PixelError {
  double variance = 0, mean = 0, scale = 0, term = 0;
};

PixelError pixel_error(const std::array<double, kReplicates>& replicate, const FoldWeights& weights, double floor) {
  PixelError e{variance_between(replicate, weights), mean_luminance(replicate, weights)};
  e.scale = e.mean * e.mean + floor * floor;
  if (e.scale > 0) e.term = e.variance / e.scale;
  return e;
}

/// largest²/Σ sample², with Σ = n·(deviation² + mean²) of luminance: the deviations of the channels are added as if they went
/// together, as those of light that comes and does not come do.
double largest_square_share(const PixelStats& pixel, double mean, double samples) {
  const double s = static_cast<double>(luminance(pixel.deviation)), sum = samples * (s * s + mean * mean);
  const double largest = static_cast<double>(pixel.largest);
  return sum > 0 ? std::min(1.0, largest * largest / sum) : 0;
}

}  // namespace

/// The sums of both rounds, and what follows from them.
struct ErrorSums::Impl {
  explicit Impl(PixelWeights weights) : weights_of(std::move(weights)) {}

  PixelWeights weights_of;
  ErrorEstimate error;
  // Of the first round.
  int fewest_degrees = kReplicates - 1;
  double mean_sum = 0, samples_sum = 0;
  int64_t fireflies = 0, pixels_for_fireflies = 0;
  double largest_squares = 0;
  // Of the second.
  double floor = 0, pixels = 0, variance = 0, variance_squares = 0, relative = 0, relative_squares = 0, noise = 0, unbiased = 0;
  double largest_absolute = 0, largest_relative = 0;

  void add_mean(const PixelStats& pixel) {
    if (pixel.missing()) {
      ++error.missing_pixels;
      return;
    }
    ++error.pixels;
    const FoldWeights& weights = weights_of.of(pixel);
    fewest_degrees = std::min(fewest_degrees, degrees_of(weights));
    samples_sum += weights.samples;
    const double mean = mean_luminance(replicates_of(pixel), weights);
    mean_sum += mean;
    const double total = std::abs(mean) * weights.samples;
    if (weights.samples < static_cast<double>(kFireflySamples)) return;
    ++pixels_for_fireflies;
    if (static_cast<double>(pixel.largest) > 0.1 * total) ++fireflies;
    largest_squares += largest_square_share(pixel, total / weights.samples, weights.samples);
  }

  void end_means() {
    if (error.pixels == 0) return;
    error.samples = std::llround(samples_sum / static_cast<double>(error.pixels));
    error.degrees = std::max(0, fewest_degrees);
    error.image_mean = mean_sum / static_cast<double>(error.pixels);
    floor = 0.01 * error.image_mean;
    if (pixels_for_fireflies > 0) {
      error.firefly_share = static_cast<double>(fireflies) / static_cast<double>(pixels_for_fireflies);
      error.largest_square_share = largest_squares / static_cast<double>(pixels_for_fireflies);
    }
  }

  /// Var of the mean of independent pixels is Σ v_p/N². With v_p of ν degrees each, E[Σ v_p²] = (1 + 2/ν) Σ σ_p⁴, so that
  /// (ν + 2) (Σ v)²/Σ v² − 2 estimates the degrees of the sum, 2 (Σ σ²)²/Var(Σ v): ν for one pixel, N ν for N alike (Satterthwaite 1946,
  /// "An Approximate Distribution of Estimates of Variance Components").
  void end_image_mean() {
    error.image_mean_standard_error = std::sqrt(variance) / pixels;
    const double nu = error.degrees;
    error.image_mean_degrees = variance_squares > 0 ? std::max(nu, (nu + 2) * (variance * variance / variance_squares) - 2) : nu;
    error.image_mean_half_width = student_quantile(0.5 + kConfidence / 2, *error.image_mean_degrees) * *error.image_mean_standard_error;
  }

  void add_error(const PixelStats& pixel) {
    if (pixel.missing()) return;
    const FoldWeights& weights = weights_of.of(pixel);
    if (degrees_of(weights) < 1) return;  // one sample says nothing of its spread
    ++pixels;
    const std::array<double, kReplicates> values = replicates_of(pixel);
    const auto [v, mean, scale, term] = pixel_error(values, weights, floor);
    if (error.degrees >= 2) unbiased += jackknifed_term(values, weights, term, floor);
    variance += v;
    variance_squares += v * v;
    relative += term;
    relative_squares += term * term;
    // E[t²] = E[t]²·(1 + 2/ν), so 2/(ν + 2)·t² is on average the variance of a term that is a multiple of χ²; a mean that is
    // off by δ moves it by the factor 1 − 2·x̄·δ/(x̄² + floor²).
    noise += term * term * (2.0 / (error.degrees + 2) + (scale > 0 ? 4 * v * mean * mean / (scale * scale) : 0));
    const double one = static_cast<double>(pixel.largest) / weights.samples, share = std::min(one * one, v);
    largest_absolute = std::max(largest_absolute, share);
    if (scale > 0) largest_relative = std::max(largest_relative, share / scale);
  }

  void end_errors() {
    if (pixels == 0 || error.degrees < 1) return;
    end_image_mean();
    const double mse = relative / pixels;
    error.relative_mse = mse;
    error.standard_error = std::sqrt(variance / pixels);
    Estimate e{std::sqrt(mse), 0};
    if (pixels > 1 && mse > 0) {
      const double scatter = std::max(0.0, relative_squares / pixels - mse * mse) / (pixels - 1);
      e.half_width = kNormal95 * std::sqrt(scatter) / (2 * e.value);  // dE = d(E²)/(2E)
    }
    error.relative_error = e;
    if (error.degrees >= 2) error.unbiased_relative_mse = unbiased / pixels;
    error.mse_deviation = mse > 0 ? std::sqrt(noise) / relative : 0;
    error.one_sample_share = mse > 0 ? std::max(largest_absolute / variance, largest_relative / relative) : 0;
  }
};

ErrorSums::ErrorSums(PixelWeights weights) : impl_(std::make_unique<Impl>(std::move(weights))) {}
ErrorSums::ErrorSums(ErrorSums&&) noexcept = default;
ErrorSums::~ErrorSums() = default;

void ErrorSums::add(std::span<const PixelStats> piece) {
  for (const PixelStats& pixel : piece) second_ ? impl_->add_error(pixel) : impl_->add_mean(pixel);
}

void ErrorSums::begin_second_round() {
  impl_->end_means();
  second_ = true;
}

ErrorEstimate ErrorSums::estimate() {
  impl_->end_errors();
  return impl_->error;
}

namespace {

/// `visit` hands the picture over in pieces, in the order of its pixels.
template <typename Visit>
ErrorEstimate estimate(const Visit& visit, PixelWeights weights) {
  ErrorSums sums(std::move(weights));
  const auto add = [&](std::span<const PixelStats> piece) { sums.add(piece); };
  visit(add);
  sums.begin_second_round();
  visit(add);
  return sums.estimate();
}

}  // namespace

double variance_of_mean(const PixelStats& pixel, const FoldWeights& weights) { return variance_between(replicates_of(pixel), weights); }

RelativeTerm relative_term(const PixelStats& pixel, const FoldWeights& weights, double floor) {
  if (degrees_of(weights) < 1) return {};
  const std::array<double, kReplicates> replicate = replicates_of(pixel);
  const PixelError e = pixel_error(replicate, weights, floor);
  if (!(e.scale > 0)) return {};
  return {e.term, jackknifed_term(replicate, weights, e.term, floor)};
}

int64_t samples_for(int64_t samples, double error_factor) {
  const double wanted = std::ceil(static_cast<double>(samples) / (error_factor * error_factor));
  return wanted < static_cast<double>(kMaxSamples) ? static_cast<int64_t>(wanted) : kMaxSamples;
}

ErrorEstimate estimate_error(std::span<const PixelStats> picture, SampleRange range) {
  return estimate([&](const auto& use) { use(picture); }, PixelWeights(range));
}

ErrorEstimate estimate_error(std::span<const Tile> nodes) {
  if (nodes.empty()) return {};
  if (nodes.size() == 1) return estimate_error(nodes[0].pixels, nodes[0].range);
  std::vector<SampleRange> ranges;
  for (const Tile& node : nodes) ranges.push_back(node.range);
  const size_t pixels = nodes[0].pixels.size();
  std::vector<PixelStats> piece, one(nodes.size());
  return estimate(
      [&](const auto& use) {
        constexpr size_t kPixels = 4096;
        for (size_t begin = 0; begin < pixels; begin += kPixels) {
          piece.clear();
          for (size_t p = begin; p < std::min(pixels, begin + kPixels); ++p) {
            for (size_t i = 0; i < nodes.size(); ++i) one[i] = nodes[i].pixels[p];
            piece.push_back(fold(ranges, one));
          }
          use(piece);
        }
      },
      PixelWeights({ranges.front().begin, ranges.back().end}));
}

ErrorEstimate estimate_error(const std::filesystem::path& exr) {
  ExrReader reader(exr);
  const PixelRect rect = reader.info().rect;
  constexpr int kRows = 64;
  return estimate(
      [&](const auto& use) {
        for (int y = rect.y0; y < rect.y1; y += kRows) use(reader.beauty_rows(y, std::min(rect.y1, y + kRows)));
      },
      reader.info().map ? PixelWeights::by_count() : PixelWeights(reader.info().samples));
}

std::vector<ErrorEstimate> estimate_prefixes(std::span<const std::filesystem::path> tiles, std::span<const int64_t> counts) {
  if (counts.empty()) return {};
  std::vector<ErrorSums> sums;
  for (const int64_t n : counts) sums.emplace_back(PixelWeights({0, n}));
  const auto add = [&](size_t i, std::span<const PixelStats> rows) { sums[i].add(rows); };
  visit_prefixes(tiles, counts, add);
  for (ErrorSums& s : sums) s.begin_second_round();
  visit_prefixes(tiles, counts, add);
  std::vector<ErrorEstimate> errors;
  for (ErrorSums& s : sums) errors.push_back(s.estimate());
  return errors;
}

std::string format_error(const ErrorEstimate& error) {
  std::string text = fmt::format("{} samples per pixel, {} pixels", error.samples, error.pixels);
  if (error.missing_pixels > 0) text += fmt::format("; {} pixels miss samples and are left out", error.missing_pixels);
  text += '\n';
  if (error.pixels == 0) return text;
  if (!error.relative_error) {
    text += fmt::format(
        "image mean {:.6g}\nnot enough samples for an interval: the error is estimated between replicates, two of them need samples\n",
        error.image_mean);
    return text;
  }
  text += fmt::format("image mean {:.6g} ± {:.2g} (95 %, Student's t with {:.0f} degrees of freedom)\n", error.image_mean,
                      *error.image_mean_half_width, *error.image_mean_degrees);
  text +=
      fmt::format("relative error {:.3g} % ± {:.2g} % (95 %); relative MSE {:.3g}; standard error {:.3g}\n",
                  100 * error.relative_error->value, 100 * error.relative_error->half_width, *error.relative_mse, *error.standard_error);
  if (error.firefly_share)
    text += fmt::format("{:.3g} % of the pixels owe more than a tenth of their value to one sample\n", 100 * *error.firefly_share);
  return text;
}

std::vector<std::pair<std::string, double>> error_fields(const ErrorEstimate& error) {
  std::vector<std::pair<std::string, double>> fields = {{"samples", static_cast<double>(error.samples)},
                                                        {"pixels", static_cast<double>(error.pixels)},
                                                        {"missing_pixels", static_cast<double>(error.missing_pixels)},
                                                        {"image_mean", error.image_mean}};
  const auto add = [&](const char* name, std::optional<double> value) {
    if (value) fields.emplace_back(name, *value);
  };
  add("image_mean_standard_error", error.image_mean_standard_error);
  add("image_mean_degrees", error.image_mean_degrees);
  add("image_mean_half_width", error.image_mean_half_width);
  if (error.relative_error) {
    add("relative_error", error.relative_error->value);
    add("relative_error_half_width", error.relative_error->half_width);
    add("samples_for_half_error", static_cast<double>(samples_for(error.samples, 0.5)));
    add("samples_for_quarter_error", static_cast<double>(samples_for(error.samples, 0.25)));
    add("samples_for_tenth_error", static_cast<double>(samples_for(error.samples, 0.1)));
  }
  add("relative_mse", error.relative_mse);
  add("standard_error", error.standard_error);
  add("unbiased_relative_mse", error.unbiased_relative_mse);
  add("mse_deviation", error.mse_deviation);
  add("firefly_share", error.firefly_share);
  add("largest_square_share", error.largest_square_share);
  add("one_sample_share", error.one_sample_share);
  return fields;
}

ErrorEstimate error_from_fields(const std::map<std::string, double>& fields) {
  const auto number = [&](const char* name) {
    const auto it = fields.find(name);
    if (it != fields.end() && !std::isfinite(it->second)) throw std::invalid_argument(fmt::format("{} is not finite", name));
    return it == fields.end() ? std::nullopt : std::optional(it->second);
  };
  const auto count = [&](const char* name) {
    const auto value = number(name);
    if (!value || !(*value >= 0 && *value <= static_cast<double>(kMaxSamples)))
      throw std::invalid_argument(fmt::format("{} is no count", name));
    return static_cast<int64_t>(*value);
  };
  ErrorEstimate e;
  e.samples = count("samples");
  e.pixels = count("pixels");
  e.missing_pixels = count("missing_pixels");
  e.image_mean = number("image_mean").value_or(0);
  e.degrees = static_cast<int>(std::clamp<int64_t>(e.samples - 1, 0, static_cast<int64_t>(kReplicates) - 1));
  e.image_mean_standard_error = number("image_mean_standard_error");
  e.image_mean_degrees = number("image_mean_degrees");
  e.image_mean_half_width = number("image_mean_half_width");
  e.relative_mse = number("relative_mse");
  if (const auto value = number("relative_error")) {
    // What judges an error asks for all of these.
    if (!e.relative_mse || !number("mse_deviation")) throw std::invalid_argument("relative_error comes without its spread");
    e.relative_error = Estimate{*value, number("relative_error_half_width").value_or(0)};
  }
  e.unbiased_relative_mse = number("unbiased_relative_mse");
  e.mse_deviation = number("mse_deviation");
  e.standard_error = number("standard_error");
  e.firefly_share = number("firefly_share");
  e.largest_square_share = number("largest_square_share");
  e.one_sample_share = number("one_sample_share");
  return e;
}

}  // namespace woodcock
