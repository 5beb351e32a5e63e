// Discrete and piecewise-constant distributions, each with its probability or density beside its sampling.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "renderer/core/vec.h"

namespace woodcock {

/// Chooses an index in proportion to weights ≥ 0. An index of weight 0 is never chosen, every other has a positive
/// probability; sampling and probability come from the same table.
class DiscreteDistribution {
 public:
  DiscreteDistribution() = default;
  explicit DiscreteDistribution(const std::vector<double>& weights) : cdf_(weights.size() + 1, 0.0) {
    for (size_t i = 0; i < weights.size(); ++i) cdf_[i + 1] = cdf_[i] + weights[i];
  }

  size_t size() const { return cdf_.empty() ? 0 : cdf_.size() - 1; }
  /// The sum of the weights; nothing can be sampled where it is 0.
  double total() const { return cdf_.empty() ? 0.0 : cdf_.back(); }

  struct Sample {
    size_t index;
    double remainder;  ///< uniform in [0, 1), given the index
  };
  /// u in [0, 1); the total must be positive.
  Sample sample(double u) const {
    const double target = u * cdf_.back();
    size_t i = static_cast<size_t>(std::upper_bound(cdf_.begin(), cdf_.end(), target) - cdf_.begin());
    // Only rounding of u · total brings the target to the end; the last index of positive weight is meant.
    if (i == cdf_.size()) i = static_cast<size_t>(std::lower_bound(cdf_.begin(), cdf_.end(), cdf_.back()) - cdf_.begin());
    const double width = cdf_[i] - cdf_[i - 1];
    return {i - 1, std::clamp((target - cdf_[i - 1]) / width, 0.0, 0x1.fffffffffffffp-1)};
  }
  /// The probability of an index.
  double probability(size_t i) const { return total() > 0 ? (cdf_[i + 1] - cdf_[i]) / cdf_.back() : 0.0; }

 private:
  std::vector<double> cdf_;  // not normalised; cdf_[0] is 0
};

/// A density on [0,1]² that is constant on the cells of a width × height grid, row 0 at y = 0.
class PiecewiseConstant2D {
 public:
  PiecewiseConstant2D() = default;
  /// `weights` ≥ 0, row after row: the density is proportional to them.
  PiecewiseConstant2D(int width, int height, const std::vector<float>& weights) : width_(width), height_(height) {
    std::vector<double> row(static_cast<size_t>(width)), row_totals;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) row[static_cast<size_t>(x)] = static_cast<double>(weights[index(x, y)]);
      rows_.emplace_back(row);
      row_totals.push_back(rows_.back().total());
    }
    marginal_ = DiscreteDistribution(row_totals);
  }

  /// The sum of the weights; nothing can be sampled where it is 0.
  double total() const { return marginal_.total(); }
  /// A point with density `pdf`.
  DVec2 sample(DVec2 u) const {
    const auto y = marginal_.sample(u.y);
    const auto x = rows_[y.index].sample(u.x);
    return {(static_cast<double>(x.index) + x.remainder) / width_, (static_cast<double>(y.index) + y.remainder) / height_};
  }
  /// The cell (column, row) that holds a point of [0,1]².
  IVec2 cell_of(DVec2 p) const {
    return {std::clamp(static_cast<int>(p.x * width_), 0, width_ - 1), std::clamp(static_cast<int>(p.y * height_), 0, height_ - 1)};
  }
  /// Density per unit area of the square.
  double pdf(DVec2 p) const {
    const IVec2 c = cell_of(p);
    return marginal_.probability(static_cast<size_t>(c.y)) * rows_[static_cast<size_t>(c.y)].probability(static_cast<size_t>(c.x)) *
           width_ * height_;
  }

 private:
  size_t index(int x, int y) const { return static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x); }

  int width_ = 0, height_ = 0;
  std::vector<DiscreteDistribution> rows_;
  DiscreteDistribution marginal_;
};

}  // namespace woodcock
