#include "scenes/generate/terrain.h"

#include "scenes/generate/noise.h"

namespace woodcock::generate {
namespace {

constexpr uint64_t kSeed = 0x151a;

}  // namespace

double island_height(double x, double y) {
  const DVec3 p{x, y, 0.5};
  const double shore = 0.35 * fractal_noise(0.9 * p, 4, kSeed);
  const double r = std::sqrt(x * x / 1.25 + y * y * 1.1) + shore;
  const double dome = 1 - smoothstep(0.5, 3.3, r);
  const double mountains = ridges(0.75 * p + DVec3(3.1, 0.2, 0.0), 6, kSeed + 40);
  return dome * (0.10 + 1.35 * mountains * dome) - 0.06 - 0.25 * smoothstep(2.6, 3.6, r);
}

DVec3 island_normal(double x, double y, double step) {
  const double dx = (island_height(x + step, y) - island_height(x - step, y)) / (2 * step);
  const double dy = (island_height(x, y + step) - island_height(x, y - step)) / (2 * step);
  return DVec3(-dx, -dy, 1) / std::sqrt(1 + dx * dx + dy * dy);
}

}  // namespace woodcock::generate
