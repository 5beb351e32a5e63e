// Checks that every mesh passes, wherever it came from.
#pragma once

#include <cmath>
#include <string>

#include "renderer/scene/description.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

/// Finite vertices of a size that float can square, and as many normals and uv as vertices (or none).
template <typename Mesh>
void check_vertices(const Mesh& mesh, const SourceLocation& where, const std::string& what) {
  constexpr double kMax = 1e18;
  if (mesh.positions.empty()) throw SceneError(where, "found no vertices in " + what + ", expected at least three");
  for (size_t i = 0; i < mesh.positions.size(); ++i)
    for (int c = 0; c < 3; ++c)
      if (!(std::abs(mesh.positions[i][c]) <= kMax))
        throw SceneError(where, "found the coordinate " + std::to_string(mesh.positions[i][c]) + " in vertex " + std::to_string(i) +
                                    " of " + what + ", expected a finite number below 1e18");
  for (size_t i = 0; i < mesh.normals.size(); ++i)
    if (!is_finite(mesh.normals[i]))
      throw SceneError(where, "found a normal that is not finite at vertex " + std::to_string(i) + " of " + what);
  for (size_t i = 0; i < mesh.uv.size(); ++i)
    if (!std::isfinite(mesh.uv[i].x) || !std::isfinite(mesh.uv[i].y))
      throw SceneError(where, "found a texture coordinate that is not finite at vertex " + std::to_string(i) + " of " + what);
  const auto matches = [&](size_t count, const char* name) {
    if (count != 0 && count != mesh.positions.size())
      throw SceneError(where, "found " + std::to_string(count) + " " + name + " for " + std::to_string(mesh.positions.size()) +
                                  " vertices of " + what + ", expected one for each");
  };
  matches(mesh.normals.size(), "normals");
  matches(mesh.uv.size(), "texture coordinates");
}

/// Removes triangles of exactly zero area: they cannot be hit, and their normal would not be a number. Returns how many.
inline size_t drop_degenerate_triangles(TriangleMesh& mesh) {
  return std::erase_if(mesh.triangles, [&](const std::array<uint32_t, 3>& t) {
    const DVec3& p = mesh.positions[t[0]];
    const DVec3 normal = glm::cross(mesh.positions[t[1]] - p, mesh.positions[t[2]] - p);
    return !(glm::dot(normal, normal) > 0);
  });
}

}  // namespace woodcock
