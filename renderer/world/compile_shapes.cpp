#include "renderer/world/compile_shapes.h"

#include <cmath>

namespace woodcock {
namespace {

bool swaps_handedness(const DMat4& m) { return glm::determinant(glm::dmat3(m)) < 0; }

template <typename Source, typename Target>
void copy_vertices(const Source& source, const DMat4& target_from_object, bool reverse, Target& target) {
  target.positions.reserve(source.positions.size());
  for (const DVec3 p : source.positions) target.positions.push_back(DVec3(target_from_object * glm::dvec4(p, 1)));
  const glm::dmat3 normal_matrix = glm::transpose(glm::inverse(glm::dmat3(target_from_object)));
  target.normals.reserve(source.normals.size());
  for (const Vec3 n : source.normals) {
    const DVec3 m = normal_matrix * DVec3(n);
    const double length = glm::length(m);
    target.normals.push_back(length > 0 ? Vec3(m / length) * (reverse ? -1.0f : 1.0f) : Vec3(0));
  }
  target.uv = source.uv;
}

/// As Embree sees a vertex: what has no area there is never met.
DVec3 in_float(DVec3 p) { return DVec3(Vec3(p)); }

double to_radians(double degrees) { return degrees * (3.14159265358979323846 / 180); }

struct Compiler {
  const ShapeDescription& shape;
  const DMat4& target_from_object;
  size_t& dropped;

  std::variant<Mesh, PatchMesh, Quadric> operator()(const std::shared_ptr<const TriangleMesh>& source) const {
    Mesh mesh;
    copy_vertices(*source, target_from_object, shape.reverse_orientation, mesh);
    mesh.triangles.reserve(source->triangles.size());
    for (const auto& t : source->triangles) {
      const DVec3 p0 = in_float(mesh.positions[t[0]]), p1 = in_float(mesh.positions[t[1]]), p2 = in_float(mesh.positions[t[2]]);
      const DVec3 n = glm::cross(p1 - p0, p2 - p0);
      if (glm::dot(n, n) > 0) {
        mesh.triangles.push_back(t);
      } else {
        ++dropped;
      }
    }
    return mesh;
  }
  std::variant<Mesh, PatchMesh, Quadric> operator()(const std::shared_ptr<const BilinearMesh>& source) const {
    PatchMesh mesh;
    copy_vertices(*source, target_from_object, shape.reverse_orientation, mesh);
    for (const auto& p : source->patches) {
      const DVec3 d1 = in_float(mesh.positions[p[3]]) - in_float(mesh.positions[p[0]]);
      const DVec3 d2 = in_float(mesh.positions[p[2]]) - in_float(mesh.positions[p[1]]);
      const DVec3 n = glm::cross(d1, d2);
      if (glm::dot(n, n) > 0) {
        mesh.patches.push_back(p);
      } else {
        ++dropped;
      }
    }
    return mesh;
  }
  Quadric placed(Quadric q) const {
    q.render_from_object = target_from_object;
    q.object_from_render = glm::inverse(target_from_object);
    return q;
  }
  std::variant<Mesh, PatchMesh, Quadric> operator()(const SphereDescription& s) const {
    return placed({Quadric::Kind::kSphere, s.radius, s.z_min, s.z_max, 0, to_radians(s.phi_max)});
  }
  std::variant<Mesh, PatchMesh, Quadric> operator()(const DiskDescription& s) const {
    return placed({Quadric::Kind::kDisk, s.radius, s.height, s.height, s.inner_radius, to_radians(s.phi_max)});
  }
  std::variant<Mesh, PatchMesh, Quadric> operator()(const CylinderDescription& s) const {
    return placed({Quadric::Kind::kCylinder, s.radius, s.z_min, s.z_max, 0, to_radians(s.phi_max)});
  }
};

}  // namespace

Shape compile_shape(const ShapeDescription& shape, const DMat4& target_from_world, size_t& dropped) {
  const DMat4 target_from_object = target_from_world * shape.world_from_object;
  Shape result;
  result.geometry = std::visit(Compiler{shape, target_from_object, dropped}, shape.kind);
  result.emits = shape.area_light.has_value();
  result.flip = shape.reverse_orientation != swaps_handedness(target_from_object);
  return result;
}

}  // namespace woodcock
