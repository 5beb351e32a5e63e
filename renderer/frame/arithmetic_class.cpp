// What makes bits differ between machines that run the same program: the arithmetic class.
#include <cmath>
#include <cstring>

#include "renderer/core/random.h"
#include "renderer/core/sha256.h"
#include "renderer/frame/frame_renderer.h"
#include "renderer/geometry/geometry.h"

namespace woodcock {
namespace {

template <typename T>
void add_bits(Sha256& digest, T value) {
  digest.raw(&value, sizeof value);
}

/// The functions of the C library that the renderer calls, at points that exercise their ranges.
void add_library_functions(Sha256& digest) {
  Stream random(0x70726f6265ULL);
  for (int i = 0; i < 2000; ++i) {
    const double u = random.uniform_double(), x = (u - 0.5) * 40;
    add_bits(digest, std::exp(x));
    add_bits(digest, std::expm1(x * 0.1));
    add_bits(digest, std::log1p(-u));
    add_bits(digest, std::log(u + 1e-300));
    add_bits(digest, std::sin(x));
    add_bits(digest, std::cos(x));
    add_bits(digest, std::atan2(x, u - 0.3));
    add_bits(digest, std::acos(2 * u - 1));
    add_bits(digest, std::pow(u, 1 / 2.4));
    add_bits(digest, std::cbrt(x));
    const auto f = static_cast<float>(x), v = static_cast<float>(u);
    add_bits(digest, std::exp(f));
    add_bits(digest, std::log(v + 1e-30f));
    add_bits(digest, std::sin(f));
    add_bits(digest, std::cos(f));
    add_bits(digest, std::atan2(f, v - 0.3f));
    add_bits(digest, std::acos(2 * v - 1));
    add_bits(digest, std::pow(v, 1 / 2.4f));
    add_bits(digest, std::sqrt(v));
  }
}

/// Rays against a wavy mesh, many of them at shared edges and vertices: which primitive Embree names there
/// depends on the approximate reciprocals of the processor.
void add_intersections(Sha256& digest) {
  constexpr uint32_t kEdge = 24;
  Mesh mesh;
  for (uint32_t y = 0; y <= kEdge; ++y) {
    for (uint32_t x = 0; x <= kEdge; ++x) {
      const float u = static_cast<float>(x) / kEdge, v = static_cast<float>(y) / kEdge;
      mesh.positions.push_back({u, v, 0.1f * u * v * (1 - u) + 0.05f * v * v});
    }
  }
  for (uint32_t y = 0; y < kEdge; ++y) {
    for (uint32_t x = 0; x < kEdge; ++x) {
      const uint32_t a = y * (kEdge + 1) + x, b = a + 1, c = a + kEdge + 1, d = c + 1;
      mesh.triangles.push_back({a, b, d});
      mesh.triangles.push_back({a, d, c});
    }
  }
  const std::vector<DVec3> vertices = mesh.positions;
  std::vector<Shape> shapes;
  shapes.push_back({std::move(mesh), false});
  const Geometry geometry(std::move(shapes), 1, {}, {});
  Stream random(0x72617973ULL);
  for (int i = 0; i < 4000; ++i) {
    const DVec3 target = (i & 1) != 0 ? vertices[random.next_u32() % vertices.size()] : DVec3(Vec3(random.uniform2(), 0.02f));
    const DVec3 origin(Vec3(random.uniform2() * 3.0f - 1.0f, 0.5f + random.uniform()));
    const auto hit = geometry.intersect({origin, glm::normalize(target - origin)}, kInf);
    add_bits(digest, hit ? static_cast<int64_t>(hit->primitive) : int64_t{-1});
    add_bits(digest, hit ? hit->t : 0.0);
  }
}

}  // namespace

std::string arithmetic_class() {
  static const std::string digest = [] {
    Sha256 sha;
    add_library_functions(sha);
    add_intersections(sha);
    return sha.hex();
  }();
  return digest;
}

}  // namespace woodcock
