// Separable filters of planes of numbers, for SSIM and FLIP.
#pragma once

#include <functional>
#include <vector>

namespace woodcock {

/// One number a pixel, row by row.
struct Plane {
  int width = 0, height = 0;
  std::vector<double> values;

  Plane(int w, int h) : width(w), height(h), values(static_cast<size_t>(w) * static_cast<size_t>(h)) {}
  double& at(int x, int y) { return values[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)]; }
  double at(int x, int y) const { return values[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)]; }
};

/// f(−r), …, f(r).
std::vector<double> sample_filter(int radius, const std::function<double(int)>& f);

/// The filter scaled so that its weights sum to one.
std::vector<double> normalised(std::vector<double> filter);

/// Correlates the rows with `horizontal` and the columns with `vertical`, both of odd length; beyond the border the outermost
/// pixel is repeated.
Plane filtered(const Plane& plane, const std::vector<double>& horizontal, const std::vector<double>& vertical);

}  // namespace woodcock
