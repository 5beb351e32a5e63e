#include "renderer/scene/flat_transform.h"

#include <algorithm>
#include <cmath>

#include "renderer/scene/mesh_checks.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

/// Of the products of lengths: less than this is rounding.
constexpr double kSingular = 1e-12;

struct Axes {
  DVec3 x, y, z;
  explicit Axes(const DMat4& m) : x(m[0]), y(m[1]), z(m[2]) {}
};

bool spans_a_plane(const DVec3& a, const DVec3& b) { return glm::length(glm::cross(a, b)) > kSingular * glm::length(a) * glm::length(b); }

size_t drop_flat_faces(TriangleMesh& mesh) { return drop_degenerate_triangles(mesh); }
size_t drop_flat_faces(BilinearMesh& mesh) {
  return std::erase_if(mesh.patches, [&](const std::array<uint32_t, 4>& p) {
    const auto at = [&](int i) { return mesh.positions[p[static_cast<size_t>(i)]]; };
    const DVec3 normal = glm::cross(at(3) - at(0), at(2) - at(1));
    return !(glm::dot(normal, normal) > 0);
  });
}
bool has_faces(const TriangleMesh& mesh) { return !mesh.triangles.empty(); }
bool has_faces(const BilinearMesh& mesh) { return !mesh.patches.empty(); }

/// Moves the vertices, so that no transform is left. Normals follow by the matrix of cofactors, which exists for every matrix and turns
/// them as cross products of edges; where one vanishes none is kept, and faces have their own.
template <typename Mesh>
std::shared_ptr<const Mesh> moved(const Mesh& source, const DMat4& m, size_t& dropped) {
  auto mesh = std::make_shared<Mesh>(source);
  for (DVec3& p : mesh->positions) p = DVec3(m * glm::dvec4(p, 1));
  const Axes a(m);
  const glm::dmat3 cofactors(glm::cross(a.y, a.z), glm::cross(a.z, a.x), glm::cross(a.x, a.y));
  for (Vec3& n : mesh->normals) {
    const DVec3 turned = cofactors * DVec3(n);
    const double length = glm::length(turned);
    n = length > 0 ? Vec3(turned / length) : Vec3(0);
  }
  if (std::any_of(mesh->normals.begin(), mesh->normals.end(), [](Vec3 n) { return n == Vec3(0); })) mesh->normals.clear();
  dropped += drop_flat_faces(*mesh);
  return mesh;
}

struct Restore {
  ShapeDescription& shape;
  const std::string& directive;
  size_t& dropped;

  template <typename Mesh>
  bool operator()(const std::shared_ptr<const Mesh>& mesh) const {
    const auto result = moved(*mesh, shape.world_from_object, dropped);
    shape.kind = result;
    shape.world_from_object = DMat4(1);
    return has_faces(*result);
  }
  bool operator()(const DiskDescription& disk) const {
    const DMat4 m = shape.world_from_object;
    const Axes a(m);
    if (!spans_a_plane(a.x, a.y)) return false;
    // Its own height is a part of where it lies, and any axis out of its plane does.
    DiskDescription flat = disk;
    flat.height = 0;
    shape.kind = flat;
    shape.world_from_object[2] = glm::dvec4(glm::normalize(glm::cross(a.x, a.y)), 0);
    shape.world_from_object[3] = m * glm::dvec4(0, 0, disk.height, 1);
    return true;
  }
  bool refuse() const {
    if (dimensions_of(shape.world_from_object) < 2) return false;
    throw SceneError(shape.where,
                     "found " + directive +
                         " under a singular transform, which presses it into a plane; expected a transform that can be inverted. "
                         "Write a disk or a mesh for what is flat");
  }
  bool operator()(const SphereDescription&) const { return refuse(); }
  bool operator()(const CylinderDescription&) const { return refuse(); }
};

}  // namespace

int dimensions_of(const DMat4& m) {
  const Axes a(m);
  const double product = glm::length(a.x) * glm::length(a.y) * glm::length(a.z);
  if (product > 0 && std::abs(glm::dot(a.x, glm::cross(a.y, a.z))) > kSingular * product) return 3;
  const auto plane = [](const DVec3& u, const DVec3& v) { return glm::length(u) * glm::length(v) > 0 && spans_a_plane(u, v); };
  if (plane(a.x, a.y) || plane(a.y, a.z) || plane(a.z, a.x)) return 2;
  return glm::length(a.x) + glm::length(a.y) + glm::length(a.z) > 0 ? 1 : 0;
}

bool restore_flat_shape(ShapeDescription& shape, const std::string& directive, size_t& dropped) {
  return std::visit(Restore{shape, directive, dropped}, ShapeKind(shape.kind));
}

}  // namespace woodcock
