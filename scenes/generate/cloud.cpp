// A cumulus: puffs joined into a body with a flat base, its surface pushed outwards by round bumps of ever
// smaller size, so that it looks like a cauliflower and not like smoke.
#include <array>
#include <vector>

#include "scenes/generate/generators.h"
#include "scenes/generate/nanovdb_file.h"
#include "scenes/generate/noise.h"

namespace woodcock::generate {
namespace {

constexpr uint64_t kSeed = 0xc10d;
constexpr IVec3 kVoxels{148, 112, 92};
constexpr double kVoxelSize = 3.0 / 144;  // the cloud is 3 units wide

struct Puff {
  DVec3 center;
  double radius;
};

/// A few large towers, each grown over with smaller puffs. Units of the cloud: x in ±1.5, y in ±1.1, z from 0.
std::vector<Puff> grow_puffs() {
  std::vector<Puff> puffs = {{{-0.10, 0.00, 0.55}, 0.52}, {{0.45, 0.10, 0.42}, 0.42},  {{-0.62, -0.08, 0.38}, 0.38},
                             {{0.05, 0.12, 1.05}, 0.36},  {{0.90, 0.00, 0.28}, 0.28},  {{-1.02, 0.06, 0.24}, 0.24},
                             {{-0.25, 0.30, 0.35}, 0.40}, {{0.30, -0.32, 0.33}, 0.36}, {{-0.35, -0.34, 0.30}, 0.32}};
  const size_t towers = puffs.size();
  Stream random(kSeed);
  for (size_t tower = 0; tower < towers; ++tower)
    for (int i = 0; i < 7; ++i) {
      DVec3 out{2 * random.uniform_double() - 1, 2 * random.uniform_double() - 1, 1.3 * random.uniform_double() - 0.3};
      out /= std::sqrt(glm::dot(out, out)) + 1e-9;
      const double radius = puffs[tower].radius * (0.35 + 0.25 * random.uniform_double());
      puffs.push_back({puffs[tower].center + 0.85 * puffs[tower].radius * out, radius});
    }
  return puffs;
}

/// Distance-like: negative inside. Puffs melt into each other over `blend` (polynomial smooth minimum).
double body(DVec3 p, const std::vector<Puff>& puffs) {
  constexpr double kBlend = 0.08;
  double distance = 10;
  for (const Puff& puff : puffs) {
    const DVec3 v = p - puff.center;
    const double d = std::sqrt(glm::dot(v, v)) - puff.radius;
    const double h = std::fmax(kBlend - std::abs(distance - d), 0.0) / kBlend;
    distance = std::fmin(distance, d) - h * h * kBlend * 0.25;
  }
  return distance;
}

double density(DVec3 p, const std::vector<Puff>& puffs) {
  const double coarse = body(p, puffs);
  if (coarse > 0.25) return 0;  // farther than all bumps together reach
  const DVec3 warp{fractal_noise(2.0 * p, 2, kSeed + 11), fractal_noise(2.0 * p, 2, kSeed + 21), fractal_noise(2.0 * p, 2, kSeed + 31)};
  const DVec3 q = p + 0.05 * warp;
  const double bumps = 0.20 * billow(3.0 * q, kSeed + 41) + 0.11 * billow(6.4 * q, kSeed + 51) + 0.05 * billow(13.0 * q, kSeed + 61);
  const double base = 0.10 + 0.035 * fractal_noise(DVec3(2.5 * p.x, 2.5 * p.y, 0.0), 3, kSeed + 71) - p.z;  // positive below the base
  const double outside = std::fmax(coarse + 0.14 - bumps, 0.8 * base);
  const double edge = smoothstep(0.0, 0.08, -outside);
  const double inner = 0.72 + 0.20 * fractal_noise(4.0 * p, 3, kSeed + 81);
  return std::fmin(1.0, std::fmax(0.0, edge * inner));
}

}  // namespace

void write_cloud(const std::string& folder) {
  openvdb::initialize();
  const std::vector<Puff> puffs = grow_puffs();
  auto grid = openvdb::FloatGrid::create(0.0f);
  grid->setName("density");
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(kVoxelSize));
  auto accessor = grid->getAccessor();
  for (int k = 0; k < kVoxels.z; ++k)
    for (int j = -kVoxels.y / 2; j < kVoxels.y / 2; ++j)
      for (int i = -kVoxels.x / 2; i < kVoxels.x / 2; ++i) {
        const float value = quantised(density(kVoxelSize * DVec3(i, j, k), puffs), 1.0);
        if (value > 0) accessor.setValue(openvdb::Coord(i, j, k), value);
      }
  write_nanovdb_file(folder + "/cloud.nvdb", {grid});
}

}  // namespace woodcock::generate
