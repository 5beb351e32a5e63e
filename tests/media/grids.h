// Grids, media and a slow, exact reference for the tests of this folder.
#pragma once

#include <algorithm>
#include <functional>
#include <memory>
#include <vector>

#include "renderer/core/random.h"
#include "renderer/core/warp.h"
#include "renderer/media/medium.h"

namespace woodcock {

inline DenseGrid<float> make_dense(IVec3 size, DVec3 p0, DVec3 p1, const std::function<float(IVec3)>& value) {
  DenseGrid<float> grid{size, p0, p1, {}};
  for (int z = 0; z < size.z; ++z)
    for (int y = 0; y < size.y; ++y)
      for (int x = 0; x < size.x; ++x) grid.values.push_back(value({x, y, z}));
  return grid;
}

inline DenseGrid<float> random_dense(IVec3 size, uint64_t seed, float filled = 0.5f) {
  Stream random(seed);
  return make_dense(size, DVec3(0), DVec3(size), [&](IVec3) { return random.uniform() < filled ? random.uniform() : 0.0f; });
}

inline std::shared_ptr<const RgbVolume> rgb_volume(IVec3 size, const std::function<Rgb(IVec3)>& value) {
  RgbVolume grid{size, DVec3(0), DVec3(size), {}};
  for (int z = 0; z < size.z; ++z)
    for (int y = 0; y < size.y; ++y)
      for (int x = 0; x < size.x; ++x) grid.values.push_back(value({x, y, z}));
  return std::make_shared<const RgbVolume>(std::move(grid));
}

inline GridMediumDescription grid_medium(FloatVolume density, Rgb sigma_a = Rgb(0.5f), Rgb sigma_s = Rgb(0.5f)) {
  GridMediumDescription d;
  d.sigma_a = sigma_a;
  d.sigma_s = sigma_s;
  d.density = std::make_shared<const FloatVolume>(std::move(density));
  return d;
}

inline MediumDescription describe(MediumKind kind, const DMat4& world_from_medium = DMat4(1)) {
  MediumDescription d;
  d.name = "test";
  d.where = {"test.pbrt", 1, 1};
  d.world_from_medium = world_from_medium;
  d.kind = std::move(kind);
  return d;
}

inline Medium make_medium(MediumKind kind, const DMat4& world_from_medium = DMat4(1), const DMat4& render_from_world = DMat4(1),
                          double scale = 1, const TransferTerms& terms = {}) {
  std::vector<std::string> notes;
  return Medium(describe(std::move(kind), world_from_medium), render_from_world, scale, notes, terms);
}

/// pbrt-v4's definition of a uniform grid, in double and without any cleverness: at a point of medium space.
inline double reference_density(const DenseGrid<float>& grid, DVec3 p) {
  const DVec3 q = (p - grid.p0) / (grid.p1 - grid.p0);
  for (int i = 0; i < 3; ++i)
    if (!(q[i] >= 0 && q[i] <= 1)) return 0;
  const DVec3 s = q * DVec3(grid.size) - 0.5;
  const DVec3 base = glm::floor(s);
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const IVec3 offset{corner & 1, (corner >> 1) & 1, corner >> 2};
    const IVec3 voxel = IVec3(base) + offset;
    double weight = 1;
    bool inside = true;
    for (int i = 0; i < 3; ++i) {
      weight *= offset[i] ? s[i] - base[i] : 1 - (s[i] - base[i]);
      inside = inside && voxel[i] >= 0 && voxel[i] < grid.size[i];
    }
    if (inside) sum += weight * grid.at(voxel.x, voxel.y, voxel.z);
  }
  return sum;
}

/// ∫ density dt over [t0, t1] for a ray in medium space, exact up to double rounding: between planes through samples
/// the trilinear interpolant along a line is a cubic, which Gauss' rule with two points integrates exactly.
inline double reference_depth(const DenseGrid<float>& grid, DVec3 o, DVec3 d, double t0, double t1) {
  std::vector<double> cuts{t0, t1};
  const DVec3 cell = (grid.p1 - grid.p0) / DVec3(grid.size);
  for (int i = 0; i < 3; ++i) {
    if (d[i] == 0) continue;
    for (int k = 0; k < grid.size[i]; ++k) cuts.push_back((grid.p0[i] + (k + 0.5) * cell[i] - o[i]) / d[i]);
    cuts.push_back((grid.p0[i] - o[i]) / d[i]);
    cuts.push_back((grid.p1[i] - o[i]) / d[i]);
  }
  std::sort(cuts.begin(), cuts.end());
  double sum = 0;
  for (size_t k = 0; k + 1 < cuts.size(); ++k) {
    const double a = std::max(cuts[k], t0), b = std::min(cuts[k + 1], t1);
    if (!(a < b)) continue;
    const double middle = (a + b) / 2, half = (b - a) / 2, x = half / std::sqrt(3.0);
    sum += half * (reference_density(grid, o + (middle - x) * d) + reference_density(grid, o + (middle + x) * d));
  }
  return sum;
}

/// A unit direction; one in four lies along an axis or a diagonal, with zeros of both signs.
inline Vec3 awkward_direction(Stream& random) {
  if (random.uniform() < 0.75f) return square_to_sphere(random.uniform2());
  for (;;) {
    Vec3 d;
    for (int i = 0; i < 3; ++i) {
      constexpr float kChoices[] = {1, -1, 0.0f, -0.0f};
      d[i] = kChoices[random.next_u32() % 4];
    }
    if (length_squared(d) > 0) return glm::normalize(d);
  }
}

}  // namespace woodcock
