// The average of a trilinear interpolant over a box.
#pragma once

#include <algorithm>
#include <vector>

#include "renderer/media/grid_map.h"

namespace woodcock {

/// ∫ max(0, 1 − |c − v − ½|) dc over [lower, upper] for the voxels v = 0 … voxels − 1: how much each contributes along one axis.
inline std::vector<double> hat_integrals(int voxels, double lower, double upper) {
  const auto below = [](double t) {
    t = std::clamp(t, -1.0, 1.0);
    return t < 0 ? 0.5 * (1 + t) * (1 + t) : 1 - 0.5 * (1 - t) * (1 - t);
  };
  std::vector<double> result;
  for (int v = 0; v < voxels; ++v) result.push_back(below(upper - v - 0.5) - below(lower - v - 0.5));
  return result;
}

/// The average over `box`, in cells, of the interpolant of the values of `size` voxels.
template <typename Value>
double grid_mean(IVec3 size, const CellBox& box, Value&& value) {
  std::vector<double> weights[3];
  for (int i = 0; i < 3; ++i) weights[i] = hat_integrals(size[i], box.lower[i], box.upper[i]);
  double sum = 0;
  for (int z = 0; z < size.z; ++z)
    for (int y = 0; y < size.y; ++y) {
      double row = 0;
      for (int x = 0; x < size.x; ++x) row += weights[0][static_cast<size_t>(x)] * static_cast<double>(value(IVec3(x, y, z)));
      sum += weights[2][static_cast<size_t>(z)] * weights[1][static_cast<size_t>(y)] * row;
    }
  const DVec3 extent = box.upper - box.lower;
  return sum / (extent.x * extent.y * extent.z);
}

}  // namespace woodcock
