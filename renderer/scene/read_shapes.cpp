// Shape: meshes and quadrics.
#include <algorithm>
#include <cmath>

#include "renderer/scene/mesh_checks.h"
#include "renderer/scene/ply.h"
#include "renderer/scene/read_parts.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

template <typename Mesh>
void read_vertices(Parameters& parameters, Mesh& mesh) {
  mesh.positions = parameters.points("P");
  mesh.normals = parameters.normals("N");
  for (const DVec2& uv : parameters.points2("uv")) mesh.uv.push_back(Vec2(uv));
  // Tangents only turn anisotropic highlights.
  parameters.refuse("S", true);
  parameters.refuse("faceIndices", false);
}

template <size_t corners>
std::vector<std::array<uint32_t, corners>> read_faces(Parameters& parameters, size_t vertices) {
  std::vector<int> indices = parameters.integers("indices");
  if (indices.empty() && !parameters.has("indices")) {
    if (vertices != corners)
      throw SceneError(parameters.where(), "found no \"integer indices\" for " + parameters.directive() + " of " +
                                               std::to_string(vertices) + " vertices, expected them");
    for (size_t i = 0; i < corners; ++i) indices.push_back(static_cast<int>(i));
  }
  if (indices.size() % corners != 0)
    throw SceneError(parameters.place("indices"), "found " + std::to_string(indices.size()) + " \"integer indices\" for " +
                                                      parameters.directive() + ", expected a multiple of " + std::to_string(corners));
  std::vector<std::array<uint32_t, corners>> faces(indices.size() / corners);
  for (size_t i = 0; i < indices.size(); ++i) {
    if (indices[i] < 0 || static_cast<size_t>(indices[i]) >= vertices)
      throw SceneError(parameters.place("indices"), "found the index " + std::to_string(indices[i]) + " at position " + std::to_string(i) +
                                                        " of " + parameters.directive() + ", expected 0 to " + std::to_string(vertices) +
                                                        " - 1");
    faces[i / corners][i % corners] = static_cast<uint32_t>(indices[i]);
  }
  return faces;
}

ShapeKind read_triangle_mesh(Parameters& parameters) {
  auto mesh = std::make_shared<TriangleMesh>();
  read_vertices(parameters, *mesh);
  mesh->triangles = read_faces<3>(parameters, mesh->positions.size());
  check_vertices(*mesh, parameters.where(), parameters.directive());
  if (const size_t dropped = drop_degenerate_triangles(*mesh))
    parameters.context().warn(parameters.where(), std::to_string(dropped) + " triangles without area are left out");
  if (parameters.context().options.skip_payload) return std::make_shared<TriangleMesh>();
  return mesh;
}

ShapeKind read_bilinear_mesh(Parameters& parameters) {
  auto mesh = std::make_shared<BilinearMesh>();
  read_vertices(parameters, *mesh);
  mesh->patches = read_faces<4>(parameters, mesh->positions.size());
  check_vertices(*mesh, parameters.where(), parameters.directive());
  parameters.refuse("emissionfilename", true);
  if (parameters.context().options.skip_payload) return std::make_shared<BilinearMesh>();
  return mesh;
}

ShapeKind read_ply_shape(Parameters& parameters) {
  const std::filesystem::path file = parameters.file("filename");
  if (file.empty())
    throw SceneError(parameters.where(),
                     "found " + parameters.directive() + " without \"string filename\", expected the path of a PLY file");
  parameters.refuse("displacement", true);
  parameters.refuse("edgelength", false);
  for (const char* name : {"displacement.edgelength", "displacement.maxlevel"}) parameters.refuse(name, false);
  ReadContext& context = parameters.context();
  const std::string bytes = context.files.read_unpacked(file, uint64_t{1} << 36, parameters.place("filename"));
  std::vector<std::string> warnings;
  auto mesh = std::make_shared<TriangleMesh>(read_ply(bytes, context.files.display_name(file), parameters.place("filename"), warnings));
  for (const std::string& warning : warnings) context.warn(parameters.place("filename"), warning);
  check_vertices(*mesh, parameters.place("filename"), quoted_list({context.files.display_name(file)}));
  if (const size_t dropped = drop_degenerate_triangles(*mesh))
    context.warn(parameters.place("filename"), std::to_string(dropped) + " triangles without area are left out");
  if (context.options.skip_payload) return std::make_shared<TriangleMesh>();
  return mesh;
}

constexpr double kTiny = 1e-30, kHuge = 1e30;

SphereDescription read_sphere(Parameters& parameters) {
  SphereDescription sphere;
  sphere.radius = parameters.number_within("radius", 1, kTiny, kHuge);
  sphere.z_min = parameters.number_within("zmin", -sphere.radius, -kHuge, kHuge);
  sphere.z_max = parameters.number_within("zmax", sphere.radius, -kHuge, kHuge);
  sphere.phi_max = parameters.number_within("phimax", 360, 0, 360);
  if (sphere.z_min > sphere.z_max) std::swap(sphere.z_min, sphere.z_max);
  sphere.z_min = std::clamp(sphere.z_min, -sphere.radius, sphere.radius);
  sphere.z_max = std::clamp(sphere.z_max, -sphere.radius, sphere.radius);
  return sphere;
}

DiskDescription read_disk(Parameters& parameters) {
  DiskDescription disk;
  disk.height = parameters.number_within("height", 0, -kHuge, kHuge);
  disk.radius = parameters.number_within("radius", 1, kTiny, kHuge);
  disk.inner_radius = parameters.number_within("innerradius", 0, 0, disk.radius);
  disk.phi_max = parameters.number_within("phimax", 360, 0, 360);
  return disk;
}

CylinderDescription read_cylinder(Parameters& parameters) {
  CylinderDescription cylinder;
  cylinder.radius = parameters.number_within("radius", 1, kTiny, kHuge);
  cylinder.z_min = parameters.number_within("zmin", -1, -kHuge, kHuge);
  cylinder.z_max = parameters.number_within("zmax", 1, -kHuge, kHuge);
  cylinder.phi_max = parameters.number_within("phimax", 360, 0, 360);
  if (cylinder.z_min > cylinder.z_max) std::swap(cylinder.z_min, cylinder.z_max);
  return cylinder;
}

}  // namespace

std::optional<ShapeKind> read_shape(const std::string& kind, Parameters& parameters) {
  if (kind == "trianglemesh") return read_triangle_mesh(parameters);
  if (kind == "plymesh") return read_ply_shape(parameters);
  if (kind == "bilinearmesh") return read_bilinear_mesh(parameters);
  if (kind == "sphere") return read_sphere(parameters);
  if (kind == "disk") return read_disk(parameters);
  if (kind == "cylinder") return read_cylinder(parameters);
  refuse_kind(parameters.context(), parameters.where(), "Shape", kind,
              {"trianglemesh", "plymesh", "bilinearmesh", "sphere", "disk", "cylinder"}, {"curve", "loopsubdiv"});
  return std::nullopt;
}

}  // namespace woodcock
