// A mountainous island as a height field, written as a binary PLY file.
#include <bit>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <vector>

#include "scenes/generate/generators.h"
#include "scenes/generate/noise.h"

namespace woodcock::generate {
namespace {

constexpr uint64_t kSeed = 0x151a;
constexpr int kCells = 128;      // per side: 32768 triangles
constexpr double kExtent = 8.0;  // units per side

/// Height over the sea. Ridged mountains under a dome that sinks below the sea before the border.
double height(double x, double y) {
  const DVec3 p{x, y, 0.5};
  const double shore = 0.35 * fractal_noise(0.9 * p, 4, kSeed);
  const double r = std::sqrt(x * x / 1.25 + y * y * 1.1) + shore;
  const double dome = 1 - smoothstep(0.5, 3.3, r);
  const double mountains = ridges(0.75 * p + DVec3(3.1, 0.2, 0.0), 6, kSeed + 40);
  return dome * (0.10 + 1.35 * mountains * dome) - 0.06 - 0.25 * smoothstep(2.6, 3.6, r);
}

static_assert(std::endian::native == std::endian::little, "values are written in the machine's order");
template <typename T>
void put(std::string& out, T value) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  out.append(bytes, sizeof(T));
}

}  // namespace

void write_island(const std::string& folder) {
  constexpr int kSide = kCells + 1;
  std::string out = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(kSide * kSide) +
                    "\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\n"
                    "property float u\nproperty float v\nelement face " +
                    std::to_string(2 * kCells * kCells) + "\nproperty list uchar int vertex_indices\nend_header\n";
  constexpr double kStep = kExtent / kCells;
  for (int j = 0; j < kSide; ++j)
    for (int i = 0; i < kSide; ++i) {
      const double x = i * kStep - kExtent / 2, y = j * kStep - kExtent / 2;
      // Central differences over one cell: the normal of the surface as it is sampled.
      const double dx = (height(x + kStep, y) - height(x - kStep, y)) / (2 * kStep);
      const double dy = (height(x, y + kStep) - height(x, y - kStep)) / (2 * kStep);
      const double length = std::sqrt(1 + dx * dx + dy * dy);
      for (const double value : {x, y, height(x, y), -dx / length, -dy / length, 1 / length, double(i) / kCells, double(j) / kCells})
        put(out, static_cast<float>(value));
    }
  for (int j = 0; j < kCells; ++j)
    for (int i = 0; i < kCells; ++i) {
      const int32_t a = j * kSide + i, b = a + 1, c = a + kSide, d = c + 1;
      const int32_t triangles[2][3] = {{a, b, d}, {a, d, c}};  // counter-clockwise from above
      for (const auto& triangle : triangles) {
        put(out, static_cast<uint8_t>(3));
        for (const int32_t vertex : triangle) put(out, vertex);
      }
    }
  std::ofstream file(folder + "/island.ply", std::ios::binary);
  file.write(out.data(), static_cast<std::streamsize>(out.size()));
  if (!file.flush()) throw std::runtime_error("cannot write " + folder + "/island.ply");
}

}  // namespace woodcock::generate
