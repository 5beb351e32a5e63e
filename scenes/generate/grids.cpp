// Media whose grids stand in the scene file as arrays.
#include <cstdio>
#include <fstream>
#include <functional>
#include <stdexcept>

#include "scenes/generate/generators.h"
#include "scenes/generate/noise.h"

namespace woodcock::generate {
namespace {

/// One value with three decimals, rounded by integer arithmetic.
void put(std::string& out, double value) {
  char text[32];
  const int thousandths = static_cast<int>(std::fmin(1.0, std::fmax(0.0, value)) * 1000 + 0.5);
  std::snprintf(text, sizeof text, "%d.%03d ", thousandths / 1000, thousandths % 1000);
  out += text;
}

/// Calls `at` for the voxel centres of an n³ grid over [−1, 1]³, x fastest.
void for_each_voxel(int n, const std::function<void(DVec3)>& at) {
  for (int k = 0; k < n; ++k)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) at((2.0 * DVec3(i, j, k) + 1.0) / double(n) - 1.0);
}

std::string swirl() {
  std::string out =
      "# Written by woodcock_generate_scenes. Fills the box (-1, -1, -1) .. (1, 1, 1) of the current transform.\n"
      "# A twisted grey column.\n"
      "MakeNamedMedium \"grey swirl\" \"string type\" \"uniformgrid\" \"integer nx\" 12 \"integer ny\" 12 \"integer nz\" 12\n"
      "  \"point3 p0\" [ -1 -1 -1 ] \"point3 p1\" [ 1 1 1 ] \"rgb sigma_a\" [ 0.4 0.4 0.4 ] \"rgb sigma_s\" [ 14 14 14 ] \"float g\" 0.2\n"
      "  \"float density\" [\n    ";
  for_each_voxel(12, [&](DVec3 p) {
    // A helix: the axis turns once around z between the bottom and the top.
    const double a = p.z, c = 1 - 2 * a * a, s = 2 * a * std::sqrt(std::fmax(0.0, 1 - a * a));
    const double dx = p.x - 0.42 * c, dy = p.y - 0.42 * s;
    put(out, 1.15 - 4 * (dx * dx + dy * dy) + 0.15 * fractal_noise(2.0 * p, 2, 0x5717));
    if (p.x > 0.9) out += "\n    ";
  });
  return out + "]\n";
}

std::string ramp() {
  std::string out =
      "# Written by woodcock_generate_scenes. Fills the box (-1, -1, -1) .. (1, 1, 1) of the current transform.\n"
      "# Scattering and absorption that change colour across the box; the two coefficients are grids of their own.\n"
      "MakeNamedMedium \"colour ramp\" \"string type\" \"rgbgrid\" \"integer nx\" 6 \"integer ny\" 6 \"integer nz\" 6 \"float scale\" 9\n"
      "  \"point3 p0\" [ -1 -1 -1 ] \"point3 p1\" [ 1 1 1 ] \"float g\" 0\n  \"rgb sigma_s\" [\n    ";
  for_each_voxel(6, [&](DVec3 p) {
    const double ball = smoothstep(0.0, 0.5, 1.15 - std::sqrt(glm::dot(p, p)));
    put(out, ball * (0.5 + 0.5 * p.x));
    put(out, ball * (0.5 + 0.5 * p.y));
    put(out, ball * (0.5 - 0.5 * p.x));
    if (p.x > 0.8) out += "\n    ";
  });
  out += "]\n  \"rgb sigma_a\" [\n    ";
  for_each_voxel(6, [&](DVec3 p) {
    const double ball = 0.12 * smoothstep(0.0, 0.5, 1.15 - std::sqrt(glm::dot(p, p)));
    put(out, ball * (0.5 - 0.5 * p.x));
    put(out, ball * (0.5 - 0.5 * p.y));
    put(out, ball * (0.5 + 0.5 * p.x));
    if (p.x > 0.8) out += "\n    ";
  });
  return out + "]\n";
}

std::string gas() {
  constexpr int kSide = 20;
  std::string out =
      "# Written by woodcock_generate_scenes. Fills the box (-1, -1, -1) .. (1, 1, 1) of the current transform.\n"
      "# A ball of gas in wisps. What it does to light is said before, by Attribute \"medium\" and the coefficients.\n"
      "MakeNamedMedium \"gas\" \"string type\" \"uniformgrid\" \"integer nx\" 20 \"integer ny\" 20 \"integer nz\" 20\n"
      "  \"point3 p0\" [ -1 -1 -1 ] \"point3 p1\" [ 1 1 1 ]\n"
      "  \"float density\" [\n    ";
  for_each_voxel(kSide, [&](DVec3 p) {
    const double ball = smoothstep(0.0, 0.35, 0.95 - std::sqrt(glm::dot(p, p)));
    put(out, ball * smoothstep(-0.05, 0.35, fractal_noise(2.6 * p, 2, 0x6a5)));
    if (p.x > 0.92) out += "\n    ";
  });
  return out + "]\n";
}

void write_text(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  if (!file.flush()) throw std::runtime_error("cannot write " + path);
}

}  // namespace

void write_grids(const std::string& folder) {
  write_text(folder + "/grid_swirl.pbrt", swirl());
  write_text(folder + "/grid_ramp.pbrt", ramp());
}

void write_gas(const std::string& folder) { write_text(folder + "/gas.pbrt", gas()); }

}  // namespace woodcock::generate
