// Shapes and scenes of one shape for tests.
#pragma once

#include <vector>

#include "renderer/geometry/geometry.h"

namespace woodcock::testing {

inline Quadric sphere_at(DVec3 center, double radius) {
  Quadric q;
  q.radius = radius;
  q.z_min = -radius;
  q.z_max = radius;
  q.render_from_object = DMat4(1);
  q.render_from_object[3] = glm::dvec4(center, 1);
  q.object_from_render = glm::inverse(q.render_from_object);
  return q;
}

/// A square in the plane z = 0 of half extent `e`, cut into n × n cells of two triangles.
inline Mesh plane(float e, int n) {
  Mesh mesh;
  for (int y = 0; y <= n; ++y) {
    for (int x = 0; x <= n; ++x) {
      mesh.positions.push_back(
          {-e + 2 * e * static_cast<float>(x) / static_cast<float>(n), -e + 2 * e * static_cast<float>(y) / static_cast<float>(n), 0});
    }
  }
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      const auto a = static_cast<uint32_t>(y * (n + 1) + x), b = a + 1, c = a + static_cast<uint32_t>(n) + 1, d = c + 1;
      mesh.triangles.push_back({a, b, d});
      mesh.triangles.push_back({a, d, c});
    }
  }
  return mesh;
}

/// A scene of one shape.
inline Geometry only(Shape shape) {
  std::vector<Shape> shapes;
  shapes.push_back(std::move(shape));
  return Geometry(std::move(shapes), 1, {}, {});
}

}  // namespace woodcock::testing
