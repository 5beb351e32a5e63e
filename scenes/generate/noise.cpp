#include "scenes/generate/noise.h"

#include <algorithm>

namespace woodcock::generate {

double value_noise(DVec3 p, uint64_t seed) {
  const DVec3 base = glm::floor(p);
  const DVec3 f = p - base;
  const DVec3 w = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
  const auto x = static_cast<int64_t>(base.x), y = static_cast<int64_t>(base.y), z = static_cast<int64_t>(base.z);
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int i = corner & 1, j = (corner >> 1) & 1, k = corner >> 2;
    sum += (i ? w.x : 1 - w.x) * (j ? w.y : 1 - w.y) * (k ? w.z : 1 - w.z) * lattice_value(x + i, y + j, z + k, seed);
  }
  return 2 * sum - 1;
}

double fractal_noise(DVec3 p, int octaves, uint64_t seed) {
  double sum = 0, amplitude = 1;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += amplitude * value_noise(p, seed + static_cast<uint64_t>(octave));
    amplitude *= 0.5;
    p *= 2.03;  // not 2: the lattices of the octaves must not coincide
  }
  return sum;
}

double billow(DVec3 p, uint64_t seed) {
  const DVec3 base = glm::floor(p);
  double nearest = 1;
  for (int k = -1; k <= 1; ++k)
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) {
        const DVec3 cell = base + DVec3(i, j, k);
        const auto x = static_cast<int64_t>(cell.x), y = static_cast<int64_t>(cell.y), z = static_cast<int64_t>(cell.z);
        const DVec3 jitter{lattice_value(x, y, z, seed), lattice_value(x, y, z, seed + 1), lattice_value(x, y, z, seed + 2)};
        const DVec3 d = cell + jitter - p;
        nearest = std::min(nearest, d.x * d.x + d.y * d.y + d.z * d.z);
      }
  return 1 - nearest;
}

double ridges(DVec3 p, int octaves, uint64_t seed) {
  double sum = 0, amplitude = 0.5, total = 0, carried = 1;
  for (int octave = 0; octave < octaves; ++octave) {
    const double crease = 1 - std::abs(value_noise(p, seed + static_cast<uint64_t>(octave)));
    const double sharp = crease * crease * carried;
    sum += amplitude * sharp;
    total += amplitude;
    carried = std::clamp(1.6 * sharp, 0.0, 1.0);  // valleys stay smooth, ridges branch
    amplitude *= 0.5;
    p *= 2.07;
  }
  return sum / total;
}

}  // namespace woodcock::generate
