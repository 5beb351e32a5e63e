// The picture pairs of tests/accuracy/metric_values.py, by the same formulas.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>

#include "renderer/accuracy/filter.h"
#include "renderer/accuracy/picture.h"

namespace woodcock::testing {

inline constexpr int kMetricWidth = 48, kMetricHeight = 40;

/// Waves in each channel, and a disc.
inline double metric_base(int x, int y, int c) {
  const double dx = x - 30, dy = y - 12;
  return dx * dx + dy * dy < 64 ? 0.9 - 0.3 * c : 0.5 + 0.35 * std::sin(0.31 * x + 0.9 * c) * std::cos(0.23 * y - 0.5 * c);
}

/// A picture whose values are `value(x, y, channel)`.
inline Picture metric_picture(const std::function<double(int, int, int)>& value) {
  Picture picture{kMetricWidth, kMetricHeight, {}};
  for (int y = 0; y < kMetricHeight; ++y)
    for (int x = 0; x < kMetricWidth; ++x) {
      Rgb pixel;
      for (int c = 0; c < 3; ++c) pixel[c] = static_cast<float>(value(x, y, c));
      picture.pixels.push_back(pixel);
    }
  return picture;
}

/// Uniform numbers in [0, 1) by a linear congruential generator, in the order of pixels and channels.
class MetricNoise {
 public:
  explicit MetricNoise(uint64_t seed) : state_(seed) {}
  double operator()() {
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return static_cast<double>(state_ >> 40) / (1 << 24);
  }

 private:
  uint64_t state_;
};

}  // namespace woodcock::testing
