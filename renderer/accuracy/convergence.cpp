#include "renderer/accuracy/convergence.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "renderer/accuracy/student.h"

namespace woodcock {

namespace {

constexpr double kMaxError = 0.5;
/// How far slopes are from −1 as a rule, where low-discrepancy numbers help a little.
constexpr double kSlopeDeviation = 0.03;
constexpr double kMaxOneSampleShare = 0.25;
constexpr double kMaxSquareShare = 0.25;
constexpr int64_t kSquareShareSamples = 128;

/// g of the head of convergence.h.
double chain(int64_t samples) {
  const auto n = static_cast<double>(samples);
  return samples <= kReplicates ? std::sqrt(n - 1) : std::sqrt(kReplicates - 1.0) * n / kReplicates;
}

double mse_of(const ErrorEstimate& error) {
  const double unbiased = error.unbiased_relative_mse.value_or(0);
  return unbiased > 0 ? unbiased : *error.relative_mse;
}

/// Relative standard deviation of `mse_of`: noise, and the bias of order E⁴ that the jackknife leaves, taken for `bias`·E⁴.
double deviation(const ErrorEstimate& error, double bias) { return std::hypot(*error.mse_deviation, bias * *error.relative_mse); }

}  // namespace

double seconds_per_sample(const Convergence& record) {
  if (record.points.empty() || record.points.back().samples <= record.timed_from) return 0;
  return record.points.back().cpu_seconds / static_cast<double>(record.points.back().samples - record.timed_from);
}

std::optional<Estimate> mse_slope(std::span<const ConvergencePoint> points) {
  // Rows (1, log n | log MSE), each without what the row before explains of it and divided by its deviation, make the normal
  // equations of independent rows.
  double a = 0, b = 0, c = 0, u = 0, v = 0, last[3] = {}, last_chain = 0;
  int rows = 0;
  for (const auto& [samples, error, seconds] : points) {
    if (samples < kReplicates || !error.relative_error || !(*error.relative_mse > 0) || error.relative_error->value > kMaxError) continue;
    const double sigma = std::max(deviation(error, 2), 1e-9);
    // E[log(1 + ε)] = −σ²/2.
    const double row[3] = {1 / sigma, std::log(static_cast<double>(samples)) / sigma,
                           (std::log(mse_of(error)) + 0.5 * *error.mse_deviation * *error.mse_deviation) / sigma};
    const double g = chain(samples), correlation = last_chain / g, rest = std::sqrt(1 - correlation * correlation);
    double x[3];
    for (int i = 0; i < 3; ++i) x[i] = (row[i] - correlation * last[i]) / rest;
    a += x[0] * x[0];
    b += x[0] * x[1];
    c += x[1] * x[1];
    u += x[0] * x[2];
    v += x[1] * x[2];
    std::copy(row, row + 3, last);
    last_chain = g;
    ++rows;
  }
  const double determinant = a * c - b * b;
  if (rows < 3 || !(determinant > 0)) return std::nullopt;
  return Estimate{(a * v - b * u) / determinant, kNormal95 * std::sqrt(a / determinant)};
}

std::string heavy_tail_reason(const ErrorEstimate& error) {
  if (error.one_sample_share && *error.one_sample_share > kMaxOneSampleShare && error.samples * error.pixels >= 256)
    return fmt::format("one sample carries {:.0f} % of the error", 100 * std::min(1.0, *error.one_sample_share));
  if (error.samples >= kSquareShareSamples && error.largest_square_share && *error.largest_square_share > kMaxSquareShare)
    return fmt::format("in {} samples a pixel the largest one still is {:.0f} % of the sum of squares", error.samples,
                       100 * *error.largest_square_share);
  return {};
}

std::string heavy_tail_reason(std::span<const ConvergencePoint> points) {
  if (points.empty()) return {};
  const auto slope = mse_slope(points);
  if (slope && slope->value - slope->half_width > -1 + kSlopeTolerance)
    return fmt::format("the MSE falls as samples^({:.2f} ± {:.2f}) instead of samples^-1", slope->value, slope->half_width);
  return heavy_tail_reason(points.back().error);
}

std::optional<Prediction> predict_error(const Convergence& record, double target) {
  if (record.points.empty() || !(target > 0)) return std::nullopt;
  const auto& [samples, error, seconds] = record.points.back();
  if (!error.relative_error || !(error.relative_error->value > 0)) return std::nullopt;
  const auto n = static_cast<double>(samples);
  const double mse = mse_of(error), wanted = target * target;
  // n·E² = a − b/n with the bias b/n² of E²: the larger root of wanted·n² − a·n + b = 0.
  const double a = n * mse, b = n * (a - n * *error.relative_mse);
  double needed = (a + std::sqrt(std::max(0.0, a * a - 4 * wanted * b))) / (2 * wanted), flatter = needed;
  double spread = kNormal95 * deviation(error, 1);
  const double ratio = std::log(*error.relative_mse / wanted);
  const auto last = [&](ptrdiff_t count) {
    return mse_slope(std::span(record.points.end() - std::min(count, std::ssize(record.points)), record.points.end()));
  };
  if (const auto slope = last(4); slope && slope->value + 1.5 * slope->half_width < -1 - kSlopeTolerance) {
    needed = n * std::exp(ratio / -slope->value);
    spread = std::hypot(spread, ratio * slope->half_width / (slope->value * slope->value));
    // Nobody knows how far the steeper fall goes on; and it is that of the powers of two, between which points fill less well.
    flatter = std::max({needed, flatter, std::exp2(std::ceil(std::log2(std::max(1.0, needed))))});
  } else if (const auto all = last(6)) {
    // The mean of two normal distributions: what is expected of slopes, and what was seen of this one.
    const double seen = std::pow(all->half_width / kNormal95, 2), expected = kSlopeDeviation * kSlopeDeviation;
    const double s = (all->value * expected - seen) / (seen + expected);
    needed *= std::exp(ratio * (-1 / s - 1));
    flatter = needed;
    spread = std::hypot(spread, kNormal95 * ratio * std::sqrt(seen * expected / (seen + expected)));
  }
  const auto count = [](double v) {
    return v < static_cast<double>(kMaxSamples) ? static_cast<int64_t>(std::ceil(std::max(1.0, v))) : kMaxSamples;
  };
  Prediction p{target, count(needed), count(needed * std::max(0.0, 1 - spread)), count(flatter * (1 + spread)), 0};
  p.cpu_seconds = seconds_per_sample(record) * static_cast<double>(std::max<int64_t>(0, p.samples - samples));
  return p;
}

std::vector<Prediction> predict(const Convergence& record) {
  std::vector<Prediction> list;
  if (record.points.empty() || heavy_tailed(record.points)) return list;
  for (const double factor : {0.5, 0.25, 0.1})
    if (const auto& error = record.points.back().error.relative_error)
      if (const auto p = predict_error(record, factor * error->value)) list.push_back(*p);
  return list;
}

}  // namespace woodcock
