// The environment image and the textures of the example scenes.
#include <OpenImageIO/imageio.h>

#include <stdexcept>
#include <vector>

#include "scenes/generate/generators.h"
#include "scenes/generate/noise.h"
#include "scenes/generate/terrain.h"

namespace woodcock::generate {
namespace {

/// `stored` is the type in the file; `values` are linear for EXR, sRGB-encoded in [0, 1] for PNG.
void write_image(const std::string& path, int width, int height, const std::vector<float>& values, OIIO::TypeDesc stored) {
  auto output = OIIO::ImageOutput::create(path);
  OIIO::ImageSpec spec(width, height, 3, stored);
  spec.attribute("compression", "zip");
  spec.attribute("DateTime", "2026:01:01 00:00:00");  // without one the library writes the time of day
  if (!output || !output->open(path, spec) || !output->write_image(OIIO::TypeDesc::FLOAT, values.data()) || !output->close())
    throw std::runtime_error("cannot write " + path + ": " + (output ? output->geterror() : OIIO::geterror()));
}

/// The direction of a point of the unit square in the equal-area octahedral map (Clarberg 2008, "Fast
/// Equal-Area Mapping of the (Hemi)Sphere using SIMD"): +z in the centre, −z in the corners.
DVec3 octahedral_direction(double u, double v) {
  const double x = 2 * u - 1, y = 2 * v - 1;
  const double ax = std::abs(x), ay = std::abs(y);
  const double signed_distance = 1 - (ax + ay);
  const double r = 1 - std::abs(signed_distance);
  const double phi = (r == 0 ? 1 : (ay - ax) / r + 1) * (3.14159265358979323846 / 4);
  const double planar = r * std::sqrt(2 - r * r);
  return {std::copysign(std::cos(phi), x) * planar, std::copysign(std::sin(phi), y) * planar, std::copysign(1 - r * r, signed_distance)};
}

/// Sky radiance: deep blue above, hazy towards the horizon, a glow and a disk of 3° radius where the sun is.
DVec3 sky(DVec3 d) {
  const DVec3 kSun = DVec3(-0.62, -0.55, 0.56) / std::sqrt(0.62 * 0.62 + 0.55 * 0.55 + 0.56 * 0.56);
  constexpr double kCosRadius = 0.99863;  // 3°
  const double up = std::fmax(0.0, d.z);
  const double haze = (1 - up) * (1 - up) * (1 - up) * (1 - up);
  DVec3 colour = (1 - haze) * DVec3(0.13, 0.27, 0.62) + haze * DVec3(0.72, 0.82, 0.92);
  const double toward = glm::dot(d, kSun);
  const double glow = std::fmax(0.0, toward);
  const double glow8 = glow * glow * glow * glow * glow * glow * glow * glow;
  colour += glow8 * (0.25 + 0.9 * glow8 * glow8 * glow8) * DVec3(1.0, 0.85, 0.62);
  if (d.z < 0) colour = (1 - smoothstep(0.0, 0.15, -d.z)) * colour + smoothstep(0.0, 0.15, -d.z) * DVec3(0.10, 0.12, 0.14);
  if (toward > kCosRadius) colour += DVec3(620, 560, 470);
  return colour;
}

/// A radiance without sharp edges: an overcast sky, bright around one direction, over a dim ground.
DVec3 soft_sky(DVec3 d) {
  const DVec3 kBright = DVec3(-0.55, -0.5, 0.67) / std::sqrt(0.55 * 0.55 + 0.5 * 0.5 + 0.67 * 0.67);
  const double up = smoothstep(-0.3, 0.3, d.z), toward = std::fmax(0.0, glm::dot(d, kBright));
  const double glow = toward * toward * toward * toward;
  return (1 - up) * DVec3(0.16, 0.14, 0.12) + up * DVec3(0.42, 0.52, 0.68) + glow * glow * DVec3(3.4, 2.9, 2.2);
}

}  // namespace

void write_soft_sky(const std::string& folder) {
  constexpr int kSide = 96;
  std::vector<float> values;
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      const DVec3 colour = soft_sky(octahedral_direction((x + 0.5) / kSide, (y + 0.5) / kSide));
      for (int c = 0; c < 3; ++c) values.push_back(static_cast<float>(colour[c]));
    }
  write_image(folder + "/soft_sky.exr", kSide, kSide, values, OIIO::TypeDesc::HALF);
}

void write_sky(const std::string& folder) {
  constexpr int kSide = 256, kSub = 4;
  std::vector<float> values;
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      DVec3 sum{0};
      for (int s = 0; s < kSub * kSub; ++s)
        sum += sky(octahedral_direction((x + (s % kSub + 0.5) / kSub) / kSide, (y + (s / kSub + 0.5) / kSub) / kSide));
      for (int c = 0; c < 3; ++c) values.push_back(static_cast<float>(sum[c] / (kSub * kSub)));
    }
  write_image(folder + "/sky.exr", kSide, kSide, values, OIIO::TypeDesc::HALF);
}

void write_tiles(const std::string& folder) {
  constexpr int kSide = 256, kTiles = 8, kSub = 3;
  constexpr double kArc = 0.5, kHalfWidth = 0.14;  // in tiles
  const DVec3 kGround{0.93, 0.89, 0.78}, kLine{0.72, 0.23, 0.12};
  std::vector<float> values;
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      int covered = 0;
      for (int s = 0; s < kSub * kSub; ++s) {
        const double tx = (x + (s % kSub + 0.5) / kSub) * kTiles / kSide, ty = (y + (s / kSub + 0.5) / kSub) * kTiles / kSide;
        const auto i = static_cast<int64_t>(tx), j = static_cast<int64_t>(ty);
        double fx = tx - static_cast<double>(i);
        const double fy = ty - static_cast<double>(j);
        if (lattice_value(i, j, 0, 0x7715) < 0.5) fx = 1 - fx;
        const double near_corner = std::sqrt(fx * fx + fy * fy), far_corner = std::sqrt((1 - fx) * (1 - fx) + (1 - fy) * (1 - fy));
        if (std::abs(near_corner - kArc) < kHalfWidth || std::abs(far_corner - kArc) < kHalfWidth) ++covered;
      }
      const double t = double(covered) / (kSub * kSub);
      for (int c = 0; c < 3; ++c) values.push_back(static_cast<float>((1 - t) * kGround[c] + t * kLine[c]));
    }
  write_image(folder + "/tiles.png", kSide, kSide, values, OIIO::TypeDesc::UINT8);
}

void write_island_colours(const std::string& folder) {
  constexpr int kSide = 256;
  constexpr uint64_t kSeed = 0x151b;
  const DVec3 kSand{0.80, 0.73, 0.55}, kGrass{0.40, 0.47, 0.22}, kForest{0.22, 0.33, 0.15}, kRock{0.44, 0.40, 0.37},
      kSnow{0.95, 0.95, 0.97};
  const auto blend = [](DVec3 a, DVec3 b, double t) { return a + t * (b - a); };
  std::vector<float> values;
  for (int row = 0; row < kSide; ++row)
    for (int column = 0; column < kSide; ++column) {
      // The first row of an image is at v = 1.
      const double x = ((column + 0.5) / kSide - 0.5) * kIslandExtent, y = (0.5 - (row + 0.5) / kSide) * kIslandExtent;
      const double patches = fractal_noise(DVec3(3 * x, 3 * y, 0.5), 4, kSeed), h = island_height(x, y) + 0.03 * patches;
      DVec3 colour = blend(kSand, kGrass, smoothstep(0.02, 0.07, h));
      colour = blend(colour, kForest, smoothstep(0.07, 0.16, h) * smoothstep(-0.4, 0.5, patches));
      const double steep = 1 - island_normal(x, y, 0.03).z;
      colour = blend(colour, kRock, std::fmax(smoothstep(0.14, 0.28, steep), smoothstep(0.38, 0.58, h)));
      colour = blend(colour, kSnow, smoothstep(0.52, 0.68, h - 0.35 * steep));
      for (int c = 0; c < 3; ++c) values.push_back(static_cast<float>(colour[c] * (1 + 0.06 * patches)));
    }
  write_image(folder + "/island.png", kSide, kSide, values, OIIO::TypeDesc::UINT8);
}

}  // namespace woodcock::generate
