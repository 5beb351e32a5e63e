#include "renderer/accuracy/ssim.h"

#include <algorithm>
#include <cmath>

namespace woodcock {

namespace {

constexpr int kRadius = 5;

Plane product(const Plane& a, const Plane& b) {
  Plane result = a;
  for (size_t i = 0; i < result.values.size(); ++i) result.values[i] *= b.values[i];
  return result;
}

Plane displayed_luma(const Picture& picture) {
  Plane plane(picture.width, picture.height);
  for (size_t i = 0; i < picture.pixels.size(); ++i) {
    double code[3];
    for (int c = 0; c < 3; ++c) code[c] = srgb_encode(std::clamp(static_cast<double>(picture.pixels[i][c]), 0.0, 1.0));
    plane.values[i] = 0.2126 * code[0] + 0.7152 * code[1] + 0.0722 * code[2];
  }
  return plane;
}

}  // namespace

std::optional<double> ssim(const Plane& a, const Plane& b) {
  if (a.width <= 2 * kRadius || a.height <= 2 * kRadius) return std::nullopt;
  const auto gauss = normalised(sample_filter(kRadius, [](int i) { return std::exp(-i * i / (2 * 1.5 * 1.5)); }));
  const auto smooth = [&](const Plane& plane) { return filtered(plane, gauss, gauss); };
  const Plane mean_a = smooth(a), mean_b = smooth(b), aa = smooth(product(a, a)), bb = smooth(product(b, b)), ab = smooth(product(a, b));
  constexpr double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
  double sum = 0;
  for (int y = kRadius; y < a.height - kRadius; ++y)
    for (int x = kRadius; x < a.width - kRadius; ++x) {
      const double ma = mean_a.at(x, y), mb = mean_b.at(x, y);
      const double va = aa.at(x, y) - ma * ma, vb = bb.at(x, y) - mb * mb, covariance = ab.at(x, y) - ma * mb;
      sum += (2 * ma * mb + c1) * (2 * covariance + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
    }
  return sum / (static_cast<double>(a.width - 2 * kRadius) * (a.height - 2 * kRadius));
}

std::optional<double> ssim(const Picture& a, const Picture& b) { return ssim(displayed_luma(a), displayed_luma(b)); }

}  // namespace woodcock
