#include "renderer/world/filter.h"

#include <algorithm>
#include <functional>
#include <numbers>

namespace woodcock {
namespace {

double gaussian(double x, double sigma) { return std::exp(-x * x / (2 * sigma * sigma)) / (std::sqrt(2 * std::numbers::pi) * sigma); }

/// Mitchell & Netravali 1988, "Reconstruction Filters in Computer Graphics", equation 8, over [-2, 2].
double mitchell(double x, double b, double c) {
  x = std::abs(x);
  if (x <= 1) return ((12 - 9 * b - 6 * c) * x * x * x + (-18 + 12 * b + 6 * c) * x * x + (6 - 2 * b)) / 6;
  if (x <= 2) return ((-b - 6 * c) * x * x * x + (6 * b + 30 * c) * x * x + (-12 * b - 48 * c) * x + (8 * b + 24 * c)) / 6;
  return 0;
}

/// Parts of [0, 1) for which the place in the table is known beforehand.
constexpr int kGuides = 4096;

/// sin(πx) / (πx)
double sinc(double x) {
  const double t = std::numbers::pi * x;
  return std::abs(t) < 1e-5 ? 1 - t * t / 6 : std::sin(t) / t;
}

std::function<double(double)> profile(const FilterDescription& filter, double radius) {
  switch (filter.kind) {
    case FilterDescription::Kind::kMitchell:
      return [=](double x) { return mitchell(2 * x / radius, filter.b, filter.c); };
    case FilterDescription::Kind::kSinc:
      return [=](double x) { return sinc(x) * sinc(x / filter.tau); };
    default:
      return [=, edge = gaussian(radius, filter.sigma)](double x) { return std::max(0.0, gaussian(x, filter.sigma) - edge); };
  }
}

}  // namespace

PixelFilter::PixelFilter(const FilterDescription& filter)
    : kind_(filter.kind), x_(tabulate(filter, filter.x_radius)), y_(tabulate(filter, filter.y_radius)) {}

PixelFilter::Axis PixelFilter::tabulate(const FilterDescription& filter, double radius) {
  Axis axis;
  axis.radius = radius;
  if (filter.kind == FilterDescription::Kind::kBox || filter.kind == FilterDescription::Kind::kTriangle) return axis;

  // The linear interpolant of 2048 cells stands for the filter: it differs by less than 1e-5 of the peak, is
  // inverted in closed form, and leaves no variance in the weights.
  constexpr int kCells = 2048;
  const auto f = profile(filter, radius);
  for (int i = 0; i <= kCells; ++i) {
    const double x = radius * (2.0 * i / kCells - 1);
    const double y = i == 0 || i == kCells ? (filter.kind == FilterDescription::Kind::kSinc ? f(x) : 0.0) : f(x);
    if (i > 0 && axis.value.back() * y < 0) {
      const double a = std::abs(axis.value.back());
      axis.node.push_back(axis.node.back() + (x - axis.node.back()) * (a / (a + std::abs(y))));
      axis.value.push_back(0);
    }
    axis.node.push_back(x);
    axis.value.push_back(y);
  }
  double total = 0, signed_total = 0;
  axis.cdf.push_back(0);
  for (size_t i = 1; i < axis.node.size(); ++i) {
    const double area = 0.5 * (axis.value[i - 1] + axis.value[i]) * (axis.node[i] - axis.node[i - 1]);
    signed_total += area;
    total += std::abs(area);
    axis.cdf.push_back(total);
  }
  for (double& c : axis.cdf) c /= total;
  for (int k = 0; k <= kGuides; ++k)
    axis.guide.push_back(std::upper_bound(axis.cdf.begin() + 1, axis.cdf.end() - 1, static_cast<double>(k) / kGuides) - axis.cdf.begin());
  // A filter without negative lobes sums the same numbers in the same order, so that the ratio is exactly 1.
  axis.weight = static_cast<float>(total / signed_total);
  return axis;
}

double PixelFilter::sample_axis(const Axis& axis, double u, float& weight) const {
  if (kind_ == FilterDescription::Kind::kBox) return axis.radius * (2 * u - 1);
  if (kind_ == FilterDescription::Kind::kTriangle) return axis.radius * (u < 0.5 ? std::sqrt(2 * u) - 1 : 1 - std::sqrt(2 * (1 - u)));

  // The guides bound what a search of the whole table would find.
  const auto guide = axis.guide.begin() + static_cast<ptrdiff_t>(u * kGuides);
  const auto upper = std::upper_bound(axis.cdf.begin() + guide[0], axis.cdf.begin() + guide[1], u);
  const size_t i = static_cast<size_t>(upper - axis.cdf.begin()) - 1;
  const double t = std::clamp((u - axis.cdf[i]) / (axis.cdf[i + 1] - axis.cdf[i]), 0.0, 1.0);
  const double a = std::abs(axis.value[i]), b = std::abs(axis.value[i + 1]);
  // Inverts the integral of the line from a to b: s solves a·s + (b − a)·s²/2 = t·(a + b)/2, in the form without
  // a difference of nearly equal numbers.
  const double s = t * (a + b) / (a + std::sqrt(std::max(0.0, a * a + t * (b * b - a * a))));
  weight *= axis.value[i] + axis.value[i + 1] < 0 ? -axis.weight : axis.weight;
  return axis.node[i] + (std::isfinite(s) ? std::min(s, 1.0) : 0.0) * (axis.node[i + 1] - axis.node[i]);
}

PixelFilter::Sample PixelFilter::sample(Vec2 u) const {
  Sample sample;
  sample.weight = 1;
  sample.offset.x = sample_axis(x_, static_cast<double>(u.x), sample.weight);
  sample.offset.y = sample_axis(y_, static_cast<double>(u.y), sample.weight);
  return sample;
}

}  // namespace woodcock
