// A mountainous island as a height field, written as a binary PLY file.
#include <bit>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <vector>

#include "scenes/generate/generators.h"
#include "scenes/generate/terrain.h"

namespace woodcock::generate {
namespace {

constexpr int kCells = 128;  // per side: 32768 triangles

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
  constexpr double kStep = kIslandExtent / kCells;
  for (int j = 0; j < kSide; ++j)
    for (int i = 0; i < kSide; ++i) {
      const double x = i * kStep - kIslandExtent / 2, y = j * kStep - kIslandExtent / 2;
      const DVec3 n = island_normal(x, y, kStep);  // of the surface as it is sampled
      for (const double value : {x, y, island_height(x, y), n.x, n.y, n.z, double(i) / kCells, double(j) / kCells})
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
