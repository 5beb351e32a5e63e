#include "renderer/accuracy/sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>

#include "renderer/accuracy/student.h"

namespace woodcock {

namespace {

double mean_of(std::span<const double> values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

/// Half width of the 95 % interval of the mean; absent for one value.
std::optional<double> half_width_of(std::span<const double> values) {
  if (values.size() < 2) return std::nullopt;
  const double mean = mean_of(values), n = static_cast<double>(values.size());
  double squares = 0;
  for (const double v : values) squares += (v - mean) * (v - mean);
  return student_quantile(0.975, n - 1) * std::sqrt(squares / ((n - 1) * n));
}

/// r² + (0.01 · mean r)², and 1 for black in a black reference.
double scale_of(double r, double floor) {
  const double scale = r * r + floor * floor;
  return scale > 0 ? scale : 1;
}

double floor_of(std::span<const float> reference) {
  double sum = 0;
  for (const float r : reference) sum += static_cast<double>(r);
  return 0.01 * sum / static_cast<double>(reference.size());
}

const SweepPoint* point_at(const std::vector<SweepPoint>& points, int64_t samples) {
  const auto at = std::find_if(points.begin(), points.end(), [&](const SweepPoint& p) { return p.samples == samples; });
  return at == points.end() ? nullptr : &*at;
}

CountSummary summarise_count(std::span<const std::vector<SweepPoint>> seeds, int64_t samples, double reference_mse) {
  CountSummary summary{samples, 0, 0, 0, {}};
  std::vector<double> errors;
  for (const auto& points : seeds) {
    const SweepPoint* point = point_at(points, samples);
    if (point == nullptr) continue;
    errors.push_back(point->relative_mse - reference_mse);
    summary.cpu_seconds += point->cpu_seconds;
  }
  summary.seeds = errors.size();
  summary.cpu_seconds /= static_cast<double>(errors.size());
  summary.relative_mse = mean_of(errors);
  summary.half_width = half_width_of(errors);
  return summary;
}

/// Slope of the least-squares line through (x, y).
double line_slope(std::span<const double> x, std::span<const double> y) {
  const double mean_x = mean_of(x), mean_y = mean_of(y);
  double above = 0, below = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    above += (x[i] - mean_x) * (y[i] - mean_y);
    below += (x[i] - mean_x) * (x[i] - mean_x);
  }
  return above / below;
}

/// The noise of a seed at a count, where it has come so far.
std::optional<double> noise_of(const std::vector<SweepPoint>& points, int64_t samples, double known) {
  const SweepPoint* point = point_at(points, samples);
  return point == nullptr ? std::nullopt : std::optional(point->relative_mse - known);
}

/// Whether the noise at a count is what is measured there: in the mean more than what is taken off, and positive for each seed.
bool noise_dominates(std::span<const std::vector<SweepPoint>> seeds, const CountSummary& count, double reference_mse, double floor_mse) {
  if (!(count.relative_mse - floor_mse > reference_mse + floor_mse)) return false;
  return std::all_of(seeds.begin(), seeds.end(), [&](const auto& points) {
    const auto noise = noise_of(points, count.samples, reference_mse + floor_mse);
    return !noise || *noise > 0;
  });
}

std::optional<Slope> fit_slope(std::span<const std::vector<SweepPoint>> seeds, std::span<const CountSummary> counts, double known) {
  if (counts.size() < 3) return std::nullopt;
  std::vector<double> slopes;
  for (const auto& points : seeds) {
    std::vector<double> x, y;
    for (const CountSummary& count : counts) {
      const auto noise = noise_of(points, count.samples, known);
      if (!noise) break;
      x.push_back(std::log(static_cast<double>(count.samples)));
      y.push_back(std::log(*noise));
    }
    // Seeds that have not come so far say nothing of this range.
    if (x.size() == counts.size()) slopes.push_back(line_slope(x, y));
  }
  if (slopes.empty()) return std::nullopt;
  return Slope{mean_of(slopes), half_width_of(slopes), counts.front().samples, counts.back().samples};
}

/// The slope, its interval widened by what the floor's own interval leaves open.
std::optional<Slope> fit_slope(std::span<const std::vector<SweepPoint>> seeds, std::span<const CountSummary> counts, double known,
                               double uncertainty) {
  auto slope = fit_slope(seeds, counts, known);
  if (!slope || !slope->half_width || !(uncertainty > 0)) return slope;
  // With less taken off: the noise stays positive.
  if (const auto other = fit_slope(seeds, counts, known - uncertainty))
    slope->half_width = std::hypot(*slope->half_width, other->value - slope->value);
  return slope;
}

/// 1/mean of noise × time over the seeds.
std::optional<Estimate> fit_efficiency(std::span<const std::vector<SweepPoint>> seeds, int64_t samples, double known) {
  std::vector<double> products;
  for (const auto& points : seeds)
    if (const SweepPoint* point = point_at(points, samples)) products.push_back((point->relative_mse - known) * point->cpu_seconds);
  const double mean = mean_of(products);
  if (!(mean > 0)) return std::nullopt;
  return Estimate{1 / mean, half_width_of(products).value_or(0) / (mean * mean)};  // d(1/p) = dp/p²
}

[[noreturn]] void refuse_counts(const std::string& text, const char* expected) {
  throw std::invalid_argument(fmt::format("found \"{}\", expected {}", text, expected));
}

int64_t parse_count(const std::string& text, const std::string& word) {
  int64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || value < 1 || value > kMaxSamples)
    refuse_counts(text, "whole numbers from 1 on, separated by commas, e.g. 1,2,4,...,1024");
  return value;
}

}  // namespace

std::vector<int64_t> parse_sample_counts(const std::string& text) {
  std::vector<int64_t> counts;
  bool dots = false;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    const std::string word = text.substr(begin, end - begin);
    begin = end + 1;
    if (word == "..." || word == "…") {
      if (dots || counts.size() < 2 || counts.back() % counts[counts.size() - 2] != 0)
        refuse_counts(text, "\"...\" behind two numbers of which the first divides the second");
      dots = true;
      continue;
    }
    const int64_t value = parse_count(text, word);
    if (dots) {
      const int64_t factor = counts.back() / counts[counts.size() - 2];
      while (counts.back() <= value / factor && counts.back() * factor < value) counts.push_back(counts.back() * factor);
      if (counts.back() != value / factor || value % factor != 0) refuse_counts(text, "a number behind \"...\" that the row meets");
      dots = false;
    }
    if (!counts.empty() && value <= counts.back()) refuse_counts(text, "numbers that ascend");
    counts.push_back(value);
    if (counts.size() > kMaxCounts) refuse_counts(text, "at most 40 numbers");
  }
  if (dots) refuse_counts(text, "a number behind \"...\"");
  return counts;
}

std::vector<SweepStep> sweep_order(size_t curves, size_t seeds, std::span<const int64_t> counts) {
  std::vector<SweepStep> steps;
  for (const int64_t samples : counts)
    for (size_t seed = 0; seed < seeds; ++seed)
      for (size_t curve = 0; curve < curves; ++curve) steps.push_back({curve, seed, samples});
  return steps;
}

double relative_mse(std::span<const float> picture, std::span<const float> reference) {
  if (picture.size() != reference.size() || picture.empty()) throw std::invalid_argument("relative_mse: the pictures differ in size");
  const double floor = floor_of(reference);
  double sum = 0;
  for (size_t i = 0; i < picture.size(); ++i) {
    const double r = static_cast<double>(reference[i]), d = static_cast<double>(picture[i]) - r;
    sum += d * d / scale_of(r, floor);
  }
  return sum / static_cast<double>(picture.size());
}

std::optional<BiasFloor> bias_floor(std::span<const std::vector<float>> pictures, std::span<const float> reference, double reference_mse) {
  const double seeds = static_cast<double>(pictures.size()), pixels = static_cast<double>(reference.size());
  if (pictures.size() < 2 || reference.size() < 2) return std::nullopt;
  const double floor = floor_of(reference);
  double sum = 0, squares = 0;
  std::vector<double> values(pictures.size());
  for (size_t i = 0; i < reference.size(); ++i) {
    for (size_t s = 0; s < pictures.size(); ++s) values[s] = static_cast<double>(pictures[s][i]);
    const double mean = mean_of(values), r = static_cast<double>(reference[i]);
    double scatter = 0;
    for (const double v : values) scatter += (v - mean) * (v - mean);
    const double term = ((mean - r) * (mean - r) - scatter / ((seeds - 1) * seeds)) / scale_of(r, floor);
    sum += term;
    squares += term * term;
  }
  const double mean = sum / pixels, variance = std::max(0.0, squares / pixels - mean * mean);
  return BiasFloor{mean - reference_mse, kNormal95 * std::sqrt(variance / (pixels - 1))};
}

bool Slope::falls_with_samples() const {
  // What a few counts and seeds cannot tell from −1, and no more.
  constexpr double kTolerance = 0.05;
  return value - half_width.value_or(kTolerance) - kTolerance <= -1;
}

CurveSummary summarise_curve(std::span<const std::vector<SweepPoint>> seeds, double reference_mse, const std::optional<BiasFloor>& floor) {
  CurveSummary curve;
  curve.floor = floor;
  std::vector<int64_t> counts;
  for (const auto& points : seeds)
    for (const SweepPoint& point : points) counts.push_back(point.samples);
  std::sort(counts.begin(), counts.end());
  counts.erase(std::unique(counts.begin(), counts.end()), counts.end());
  for (const int64_t samples : counts) curve.counts.push_back(summarise_count(seeds, samples, reference_mse));

  const double known = reference_mse + curve.floor_mse();
  std::vector<CountSummary> noisy;
  for (const CountSummary& count : curve.counts) {
    if (!noise_dominates(seeds, count, reference_mse, curve.floor_mse())) break;
    noisy.push_back(count);
  }
  if (noisy.empty()) return curve;
  curve.slope = fit_slope(seeds, noisy, known, curve.floor_mse() > 0 ? floor->half_width : 0);
  curve.efficiency_at = noisy.back().samples;
  curve.efficiency = fit_efficiency(seeds, curve.efficiency_at, known);
  return curve;
}

TimeToError time_to_error(const CurveSummary& curve, double error) {
  using Kind = TimeToError::Kind;
  const double target = error * error;
  const auto& counts = curve.counts;
  const auto below = std::find_if(counts.begin(), counts.end(), [&](const CountSummary& c) { return c.relative_mse <= target; });
  if (below != counts.end()) {
    const double n = static_cast<double>(below->samples);
    if (below == counts.begin()) return {Kind::kAtMost, below->cpu_seconds, n};
    const CountSummary& above = *std::prev(below);
    // What is not positive is below any error that can be seen: the later count is where it is reached at the latest.
    if (!(below->relative_mse > 0)) return {Kind::kAtMost, below->cpu_seconds, n};
    const double part = std::log(above.relative_mse / target) / std::log(above.relative_mse / below->relative_mse);
    const auto between = [&](double a, double b) { return a * std::pow(b / a, part); };
    return {Kind::kMeasured, between(above.cpu_seconds, below->cpu_seconds), between(static_cast<double>(above.samples), n)};
  }
  if (curve.floor_mse() >= target) return {Kind::kNever, 0, 0};
  if (counts.empty() || !curve.slope || !curve.slope->falls_with_samples() || !curve.heavy_tail.empty()) return {};
  const double factor = (counts.back().relative_mse - curve.floor_mse()) / (target - curve.floor_mse());
  return {Kind::kExtrapolated, counts.back().cpu_seconds * factor, static_cast<double>(counts.back().samples) * factor};
}

}  // namespace woodcock
