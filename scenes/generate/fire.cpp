// A flame: columns of hot gas that narrow upwards, bent and torn by noise that grows with height and is
// stretched along the flow. Soot follows the heat, since only hot soot shines.
#include <array>

#include "scenes/generate/generators.h"
#include "scenes/generate/nanovdb_file.h"
#include "scenes/generate/noise.h"

namespace woodcock::generate {
namespace {

constexpr uint64_t kSeed = 0xf12e;
constexpr IVec3 kVoxels{72, 72, 128};
constexpr double kVoxelSize = 2.0 / 128;
constexpr double kColdest = 700, kHottest = 2000;  // kelvin, of a luminous wood flame

struct Tongue {
  double x, y, height, radius;
};
constexpr std::array<Tongue, 6> kTongues = {{{0.00, 0.00, 1.95, 0.26},
                                             {0.20, 0.08, 1.35, 0.18},
                                             {-0.22, -0.05, 1.50, 0.19},
                                             {0.05, -0.22, 1.10, 0.17},
                                             {-0.08, 0.22, 1.20, 0.17},
                                             {0.30, -0.14, 0.75, 0.12}}};

/// 1 on the axis of the hottest tongue, 0 outside the flame.
double heat(DVec3 p) {
  const double z = p.z;
  if (z <= 0) return 0;
  const DVec3 flow{2.2 * p.x, 2.2 * p.y, 1.1 * z};
  const double sway = 0.03 + 0.13 * z;
  const double x = p.x + sway * fractal_noise(flow, 3, kSeed + 1);
  const double y = p.y + sway * fractal_noise(flow, 3, kSeed + 11);
  double best = -1;
  for (const Tongue& tongue : kTongues) {
    const double up = z / tongue.height;
    if (up >= 1) continue;
    // Widest a fifth above the fuel, a point at the top.
    const double profile = std::sqrt(smoothstep(-0.15, 0.2, up)) * (1 - up) * (1 + 0.8 * up);
    const double dx = x - tongue.x * (1 - 0.5 * up), dy = y - tongue.y * (1 - 0.5 * up);
    const double radius = tongue.radius * profile + 1e-6;
    best = std::fmax(best, 1 - std::sqrt(dx * dx + dy * dy) / radius);
  }
  const double torn = fractal_noise(DVec3(6 * x, 6 * y, 2.6 * z), 4, kSeed + 21);  // filaments along the flow
  return std::fmin(1.0, std::fmax(0.0, best + (0.10 + 0.30 * std::fmin(1.0, z)) * (torn - 0.1)));
}

}  // namespace

void write_fire(const std::string& folder) {
  openvdb::initialize();
  const auto make_grid = [](const char* name) {
    auto grid = openvdb::FloatGrid::create(0.0f);
    grid->setName(name);
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(kVoxelSize));
    return grid;
  };
  auto density = make_grid("density"), temperature = make_grid("temperature");
  auto density_accessor = density->getAccessor(), temperature_accessor = temperature->getAccessor();
  for (int k = 0; k < kVoxels.z; ++k)
    for (int j = -kVoxels.y / 2; j < kVoxels.y / 2; ++j)
      for (int i = -kVoxels.x / 2; i < kVoxels.x / 2; ++i) {
        const DVec3 p = kVoxelSize * DVec3(i, j, k);
        const double h = heat(p);
        const float soot = quantised(smoothstep(0.02, 0.45, h), 1.0);
        if (soot <= 0) continue;
        const openvdb::Coord at(i, j, k);
        density_accessor.setValue(at, soot);
        const double cooling = 1 - 0.18 * std::fmin(1.0, p.z / 2);
        temperature_accessor.setValue(at, quantised((kColdest + (kHottest - kColdest) * std::sqrt(h)) * cooling, kHottest));
      }
  write_nanovdb_file(folder + "/fire.nvdb", {density, temperature});
}

}  // namespace woodcock::generate
