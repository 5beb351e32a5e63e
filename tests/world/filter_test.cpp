// Pixel filters as sampling techniques, against numeric integration of the filters themselves.
#include "renderer/world/filter.h"

#include <gtest/gtest.h>

#include <functional>
#include <numbers>

#include "renderer/core/random.h"
#include "tests/support/chi_square.h"

namespace woodcock {
namespace {

using Kind = FilterDescription::Kind;

FilterDescription filter(Kind kind, double x_radius, double y_radius) {
  FilterDescription f;
  f.kind = kind;
  f.x_radius = x_radius;
  f.y_radius = y_radius;
  return f;
}

std::vector<FilterDescription> all() {
  FilterDescription wide = filter(Kind::kGaussian, 2, 1);
  wide.sigma = 1.5;
  FilterDescription sharp = filter(Kind::kMitchell, 2, 2);
  sharp.b = 0;
  sharp.c = 0.75;
  return {filter(Kind::kBox, 0.5, 0.5),
          filter(Kind::kBox, 1.5, 0.25),
          filter(Kind::kTriangle, 2, 1),
          filter(Kind::kGaussian, 1.5, 1.5),
          wide,
          filter(Kind::kMitchell, 2, 1.5),
          sharp,
          filter(Kind::kSinc, 4, 4)};
}

/// The formulas of the format, one axis.
double value(const FilterDescription& f, double x, double radius) {
  x = std::abs(x);
  if (x > radius) return 0;
  const double pi = std::numbers::pi;
  switch (f.kind) {
    case Kind::kBox:
      return 1;
    case Kind::kTriangle:
      return radius - x;
    case Kind::kGaussian:
      return std::exp(-0.5 * x * x / (f.sigma * f.sigma)) - std::exp(-0.5 * radius * radius / (f.sigma * f.sigma));
    case Kind::kMitchell: {
      const double t = 2 * x / radius, b = f.b, c = f.c;
      return t < 1 ? (12 - 9 * b - 6 * c) * t * t * t + (12 * b + 6 * c - 18) * t * t + 6 - 2 * b
                   : (-b - 6 * c) * t * t * t + (6 * b + 30 * c) * t * t - (12 * b + 48 * c) * t + 8 * b + 24 * c;
    }
    case Kind::kSinc:
      return x < 1e-9 ? 1 : std::sin(pi * x) / (pi * x) * std::sin(pi * x / f.tau) / (pi * x / f.tau);
  }
  return 0;
}

/// ∫ f(x) g(x) dx over one axis by the midpoint rule.
double integral(const FilterDescription& f, double radius, const std::function<double(double)>& g, bool absolute = false) {
  constexpr int kSteps = 200000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double x = radius * (2 * (i + 0.5) / kSteps - 1), y = value(f, x, radius);
    sum += (absolute ? std::abs(y) : y) * g(x);
  }
  return sum * 2 * radius / kSteps;
}

TEST(PixelFilter, WeightedSamplesHaveTheMomentsOfTheFilter) {
  for (const FilterDescription& f : all()) {
    SCOPED_TRACE(static_cast<int>(f.kind));
    const PixelFilter sampler(f);
    const auto moment = [&](double radius, const std::function<double(double)>& g) {
      return integral(f, radius, g) / integral(f, radius, [](double) { return 1.0; });
    };
    const std::vector<std::function<double(double)>> functions = {[](double) { return 1.0; }, [](double x) { return x; },
                                                                  [](double x) { return x * x; }, [](double x) { return std::cos(2 * x); },
                                                                  [](double x) { return x > 0.3 ? 1.0 : 0.0; }};
    std::vector<double> x_moment, y_moment;
    for (const auto& g : functions) {
      x_moment.push_back(moment(f.x_radius, g));
      y_moment.push_back(moment(f.y_radius, g));
    }
    constexpr int kSamples = 400000;
    Stream random(21);
    std::vector<double> sum(functions.size()), squares(functions.size());
    for (int i = 0; i < kSamples; ++i) {
      const PixelFilter::Sample s = sampler.sample(random.uniform2());
      EXPECT_LE(std::abs(s.offset.x), f.x_radius);
      EXPECT_LE(std::abs(s.offset.y), f.y_radius);
      for (size_t k = 0; k < functions.size(); ++k) {
        const double v = static_cast<double>(s.weight) * functions[k](s.offset.x) * functions[k](s.offset.y);
        sum[k] += v;
        squares[k] += v * v;
      }
    }
    for (size_t k = 0; k < functions.size(); ++k) {
      const double mean = sum[k] / kSamples, variance = squares[k] / kSamples - mean * mean;
      // Five standard errors (a false alarm in 1.7 million) and the error of the tabulated filter.
      EXPECT_NEAR(mean, x_moment[k] * y_moment[k], 5 * std::sqrt(variance / kSamples) + 2e-5) << "function " << k;
    }
  }
}

// χ² of both axes against |f|, cut into 20 cells each. False alarm: 1e-6 an axis.
TEST(PixelFilter, OffsetsFollowTheAbsoluteValueOfTheFilter) {
  constexpr int kCells = 20, kSamples = 200000;
  for (const FilterDescription& f : all()) {
    SCOPED_TRACE(static_cast<int>(f.kind));
    const PixelFilter sampler(f);
    std::array<std::array<double, kCells>, 2> count{};
    Stream random(23);
    for (int i = 0; i < kSamples; ++i) {
      const DVec2 offset = sampler.sample(random.uniform2()).offset;
      const DVec2 cell = (offset / DVec2(f.x_radius, f.y_radius) + 1.0) * 0.5 * static_cast<double>(kCells);
      for (int axis = 0; axis < 2; ++axis) ++count[axis][std::min<size_t>(kCells - 1, static_cast<size_t>(cell[axis]))];
    }
    for (int axis = 0; axis < 2; ++axis) {
      const double radius = axis == 0 ? f.x_radius : f.y_radius, total = integral(
                                                                     f, radius, [](double) { return 1.0; }, true);
      double statistic = 0;
      int degrees = -1;
      for (int i = 0; i < kCells; ++i) {
        const auto in_cell = [&](double x) { return static_cast<int>((x / radius + 1) * 0.5 * kCells) == i ? 1.0 : 0.0; };
        const double expected = kSamples * integral(f, radius, in_cell, true) / total, d = count[axis][static_cast<size_t>(i)] - expected;
        if (expected < 5) continue;
        statistic += d * d / expected;
        ++degrees;
      }
      EXPECT_GT(degrees, kCells / 2);
      EXPECT_GT(testing::chi_square_p_value(statistic, degrees), 1e-6) << "axis " << axis << ": " << statistic << " for " << degrees;
    }
  }
}

TEST(PixelFilter, WeightsAreTheRatioOfIntegralsAndExactlyOneWithoutNegativeLobes) {
  for (const FilterDescription& f : all()) {
    SCOPED_TRACE(static_cast<int>(f.kind));
    const PixelFilter sampler(f);
    const auto one = [](double) { return 1.0; };
    const double ratio = integral(f, f.x_radius, one, true) / integral(f, f.x_radius, one) * integral(f, f.y_radius, one, true) /
                         integral(f, f.y_radius, one);
    Stream random(22);
    for (int i = 0; i < 2000; ++i) {
      const PixelFilter::Sample s = sampler.sample(random.uniform2());
      if (f.kind == Kind::kMitchell || f.kind == Kind::kSinc) {
        EXPECT_NEAR(std::abs(static_cast<double>(s.weight)), ratio, 1e-4);
        const double here = value(f, s.offset.x, f.x_radius) * value(f, s.offset.y, f.y_radius);
        if (std::abs(here) > 1e-4) {
          EXPECT_EQ(s.weight < 0, here < 0);
        }
      } else {
        EXPECT_EQ(s.weight, 1);
      }
    }
  }
}

TEST(PixelFilter, CornersOfTheUnitSquareAreFinite) {
  for (const FilterDescription& f : all())
    for (const float u : {0.0f, 0.5f, kOneMinusEpsilon}) {
      const PixelFilter::Sample s = PixelFilter(f).sample({u, u});
      EXPECT_TRUE(std::isfinite(s.offset.x) && std::isfinite(s.offset.y) && std::isfinite(s.weight));
      EXPECT_LE(std::abs(s.offset.x), f.x_radius);
    }
}

}  // namespace
}  // namespace woodcock
