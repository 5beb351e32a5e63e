// The optical depth of a homogeneous or grid medium along a ray, without random numbers or marching error.
#pragma once

#include <algorithm>
#include <vector>

#include "renderer/media/medium.h"

namespace woodcock::testing {

/// ∫ σt dt per channel over [t0, t1] (t1 finite) for a unit direction. Between the planes through samples a trilinear interpolant is
/// a cubic along a line, which Gauss' rule with two points integrates exactly: what remains is the float rounding of
/// look-ups (about 1e-6). Not for procedural clouds.
inline DVec3 optical_depth_exact(const Medium& medium, const Ray& ray, double t0, double t1) {
  if (medium.is_homogeneous()) return DVec3(medium.homogeneous().sigma_t) * (t1 - t0);
  if (!medium.parts().empty()) {
    DVec3 sum{0};
    for (const auto& part : medium.parts()) sum += optical_depth_exact(*part, ray, t0, t1);
    return sum;
  }
  const MajorantGrid& grid = medium.majorants();
  const DVec3 o = grid.map().point(DVec3(ray.o)), d = grid.map().vector(DVec3(ray.d));
  std::vector<double> cuts{t0, t1};
  const auto cut = [&](double t) {
    if (t > t0 && t < t1) cuts.push_back(t);
  };
  for (int i = 0; i < 3; ++i) {
    if (d[i] == 0) continue;
    cut((grid.box().lower[i] - o[i]) / d[i]);
    cut((grid.box().upper[i] - o[i]) / d[i]);
    const int last = static_cast<int>(std::ceil(grid.box().upper[i]));
    for (int k = 0; k < last; ++k) cut((k + 0.5 - o[i]) / d[i]);
  }
  std::sort(cuts.begin(), cuts.end());
  DVec3 sum{0};
  for (size_t k = 0; k + 1 < cuts.size(); ++k) {
    const double middle = (cuts[k] + cuts[k + 1]) / 2, half = (cuts[k + 1] - cuts[k]) / 2, x = half / std::sqrt(3.0);
    const auto sigma_t = [&](double t) { return DVec3(medium.sigma_t(Vec3(DVec3(ray.o) + t * DVec3(ray.d)))); };
    sum += half * (sigma_t(middle - x) + sigma_t(middle + x));
  }
  return sum;
}

}  // namespace woodcock::testing
