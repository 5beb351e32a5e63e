// Random choices for scenes: the same on every machine, whatever its standard library.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>

#include "renderer/core/random.h"

namespace woodcock::selftest {

/// Draws from the project's own counter-based numbers. Every value that goes into a scene is rounded to four decimal digits, so
/// that a last bit of the C library's exponential function changes no scene.
class RandomDraws {
 public:
  explicit RandomDraws(uint64_t key) : stream_(mix64(key)) {}

  double unit() { return stream_.uniform_double(); }
  bool chance(double probability) { return unit() < probability; }
  /// 0 … count − 1.
  int index(int count) { return static_cast<int>(unit() * count); }
  double uniform(double low, double high) { return rounded(low + (high - low) * unit()); }
  /// Uniform in the logarithm; 0 < low < high.
  double log_uniform(double low, double high) { return rounded(low * std::exp(unit() * std::log(high / low))); }
  /// One of the values.
  template <typename T>
  T pick(std::initializer_list<T> values) {
    return *(values.begin() + index(static_cast<int>(values.size())));
  }
  /// An index with a probability in proportion to its weight.
  int weighted(std::initializer_list<double> weights) {
    double total = 0;
    for (const double w : weights) total += w;
    double rest = unit() * total;
    int i = 0, last = 0;
    for (const double w : weights) {
      if (w > 0) last = i;
      if (rest < w) return i;
      rest -= w;
      ++i;
    }
    return last;
  }
  DVec3 colour(double low, double high) {
    const double r = uniform(low, high), g = uniform(low, high), b = uniform(low, high);
    return {r, g, b};
  }
  /// Uniform in the unit ball, by rejection.
  DVec3 in_ball() {
    while (true) {
      const double x = 2 * unit() - 1, y = 2 * unit() - 1, z = 2 * unit() - 1;
      if (x * x + y * y + z * z < 1) return {rounded(x), rounded(y), rounded(z)};
    }
  }
  /// A direction, of about unit length.
  DVec3 direction() {
    while (true) {
      const DVec3 p = in_ball();
      if (const double length = glm::length(p); length > 0.1) return {rounded(p.x / length), rounded(p.y / length), rounded(p.z / length)};
    }
  }

  /// Four significant decimal digits.
  static double rounded(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.4g", value);
    return std::strtod(text, nullptr);
  }

 private:
  Stream stream_;
};

}  // namespace woodcock::selftest
