#include "renderer/accuracy/filter.h"

#include <algorithm>
#include <numeric>

namespace woodcock {

std::vector<double> sample_filter(int radius, const std::function<double(int)>& f) {
  std::vector<double> filter;
  for (int i = -radius; i <= radius; ++i) filter.push_back(f(i));
  return filter;
}

std::vector<double> normalised(std::vector<double> filter) {
  const double sum = std::accumulate(filter.begin(), filter.end(), 0.0);
  for (double& weight : filter) weight /= sum;
  return filter;
}

Plane filtered(const Plane& plane, const std::vector<double>& horizontal, const std::vector<double>& vertical) {
  Plane rows(plane.width, plane.height), result(plane.width, plane.height);
  const int rx = static_cast<int>(horizontal.size()) / 2, ry = static_cast<int>(vertical.size()) / 2;
  for (int y = 0; y < plane.height; ++y)
    for (int x = 0; x < plane.width; ++x) {
      double sum = 0;
      for (int i = -rx; i <= rx; ++i) sum += horizontal[static_cast<size_t>(i + rx)] * plane.at(std::clamp(x + i, 0, plane.width - 1), y);
      rows.at(x, y) = sum;
    }
  for (int y = 0; y < plane.height; ++y)
    for (int i = -ry; i <= ry; ++i) {
      const double weight = vertical[static_cast<size_t>(i + ry)];
      const int from = std::clamp(y + i, 0, plane.height - 1);
      for (int x = 0; x < plane.width; ++x) result.at(x, y) += weight * rows.at(x, from);
    }
  return result;
}

}  // namespace woodcock
