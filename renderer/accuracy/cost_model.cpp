#include "renderer/accuracy/cost_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "renderer/accuracy/student.h"

namespace woodcock {

namespace {

/// The clock of a processor is not the same all day: relative standard deviation of a time that is measured again.
constexpr double kClock = 0.03;

/// Relative half width (95 %) of what the pilot's E² adds to the interval of `predict_error`.
double further_spread(const Pilot& pilot) {
  const ErrorEstimate& error = pilot.record.points.back().error;
  // The error of the finished picture is estimated as well, with the same noise.
  const double later = kNormal95 * *error.mse_deviation;
  // dE²/E² = 2·dE/E; a part of the pixels that is chosen by chance stands for the others.
  const double parts =
      pilot.pixel_share < 1 ? 2 * error.relative_error->half_width / error.relative_error->value * std::sqrt(1 - pilot.pixel_share) : 0;
  return std::hypot(later, parts);
}

std::string doubts(const Pilot& pilot, const Quote& quote) {
  if (const std::string reason = heavy_tail_reason(pilot.record.points); !reason.empty()) return "heavy tail: " + reason;
  const auto samples = static_cast<double>(quote.samples);
  const double width =
      std::max(static_cast<double>(quote.samples_high) - samples, samples - static_cast<double>(quote.samples_low)) / samples;
  if (width > kQuoteTolerance)
    return fmt::format("a pilot of {} samples tells the samples to ±{:.0f} % only", pilot.record.points.back().samples, 100 * width);
  return {};
}

void add_time(const Pilot& pilot, Quote& quote) {
  const double spread = kNormal95 * std::hypot(pilot.seconds_deviation, kClock);
  quote.cpu_seconds = pilot.seconds_per_sample * static_cast<double>(quote.samples);
  quote.cpu_low = pilot.seconds_per_sample * static_cast<double>(quote.samples_low) * std::max(0.0, 1 - spread);
  quote.cpu_high = pilot.seconds_per_sample * static_cast<double>(quote.samples_high) * (1 + spread);
}

}  // namespace

std::optional<Quote> quote_error(const Pilot& pilot, double error) {
  const auto p = predict_error(pilot.record, error);
  if (!p) return std::nullopt;
  Quote quote{error, p->samples, 0, 0, 0, 0, 0, {}};
  const auto n = static_cast<double>(p->samples);
  const double more = further_spread(pilot), below = std::hypot(1 - static_cast<double>(p->samples_low) / n, more);
  const double above = std::hypot(static_cast<double>(p->samples_high) / n - 1, more);
  quote.samples_low = static_cast<int64_t>(n * std::max(0.0, 1 - below));
  quote.samples_high = static_cast<int64_t>(std::min(n * (1 + above), static_cast<double>(kMaxSamples)));
  quote.uncertain = doubts(pilot, quote);
  add_time(pilot, quote);
  return quote;
}

std::optional<Quote> quote_samples(const Pilot& pilot, int64_t samples) {
  // Samples fall with the error: halve an interval of it.
  double low = 0, high = 1;
  while (true) {
    const auto p = predict_error(pilot.record, high);
    if (!p) return std::nullopt;
    if (p->samples <= samples || high > 1e6) break;
    high *= 2;
  }
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    const auto p = middle > 0 ? predict_error(pilot.record, middle) : std::nullopt;
    (p && p->samples <= samples ? high : low) = middle;
  }
  auto quote = quote_error(pilot, high);
  if (quote) {
    quote->samples = samples;
    add_time(pilot, *quote);
  }
  return quote;
}

}  // namespace woodcock
