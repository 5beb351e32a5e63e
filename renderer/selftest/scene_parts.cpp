#include "renderer/selftest/scene_parts.h"

namespace woodcock::selftest {

double inscribed_radius(Form form) {
  switch (form) {
    case Form::kSphere:
      return 1;
    case Form::kBox:
    case Form::kPatchBox:
      return 0.57;
    case Form::kCappedCylinder:
      return 0.7;
    default:
      return 0;
  }
}

const char* name_of(Form form) {
  constexpr const char* kNames[] = {"sphere",
                                    "box of triangles",
                                    "box of patches",
                                    "cylinder with disks",
                                    "touching box, left",
                                    "touching box, right",
                                    "triangle",
                                    "sheet",
                                    "bilinear patch",
                                    "disk",
                                    "partial sphere",
                                    "tube",
                                    "partial tube"};
  return kNames[static_cast<int>(form)];
}

const char* name_of(MediumForm form) {
  constexpr const char* kNames[] = {"homogeneous", "uniformgrid", "rgbgrid", "cloud", "sum"};
  return kNames[static_cast<int>(form)];
}

const char* name_of(MaterialForm form) {
  constexpr const char* kNames[] = {"interface",  "diffuse",   "diffusetransmission", "dielectric",    "thindielectric", "mix",
                                    "subsurface", "conductor", "rough dielectric",    "coateddiffuse", "coatedconductor"};
  return kNames[static_cast<int>(form)];
}

const char* name_of(LightForm form) {
  constexpr const char* kNames[] = {"point", "spot", "distant", "infinite"};
  return kNames[static_cast<int>(form)];
}

bool is_region(const Body& body) {
  if (!is_closed(body.form)) return false;
  switch (body.material.form) {
    case MaterialForm::kInterface:
    case MaterialForm::kDiffuseTransmission:
    case MaterialForm::kGlass:
    case MaterialForm::kThinGlass:
    case MaterialForm::kRoughGlass:
      return true;
    case MaterialForm::kMix:
      return body.material.mixed[1].form == MaterialForm::kInterface;
    default:
      return false;
  }
}

bool changes_index(const MaterialPart& material) {
  return material.form == MaterialForm::kGlass || material.form == MaterialForm::kRoughGlass || material.form == MaterialForm::kSubsurface;
}

double index_inside(const Scene& scene, int body) {
  double index = 1;
  for (int i = body; i != kRoot; i = scene.bodies[static_cast<size_t>(i)].parent) {
    const Body& b = scene.bodies[static_cast<size_t>(i)];
    if (changes_index(b.material)) index *= b.material.eta;
  }
  return index;
}

const MediumPart* medium_inside(const Scene& scene, int body) {
  while (body != kRoot && scene.bodies[static_cast<size_t>(body)].within) body = scene.bodies[static_cast<size_t>(body)].parent;
  const std::optional<MediumPart>& medium = body == kRoot ? scene.medium : scene.bodies[static_cast<size_t>(body)].medium;
  return medium ? &*medium : nullptr;
}

DVec3 albedo_of(const MaterialPart& material) {
  switch (material.form) {
    case MaterialForm::kDiffuse:
      return material.reflectance;
    case MaterialForm::kDiffuseTransmission:
      return material.reflectance + material.transmittance;
    case MaterialForm::kMix:
      return (1 - material.amount) * albedo_of(material.mixed[0]) + material.amount * albedo_of(material.mixed[1]);
    default:
      return DVec3(1);
  }
}

DVec3 emission_of(const Scene& scene, const Body& body) {
  if (!scene.furnace) return body.emission;
  const double index = index_around(scene, body);
  return glm::max(DVec3(0), DVec3(1) - albedo_of(body.material)) * (index * index);
}

double furnace_value(const Scene& scene) {
  const double index = index_inside(scene, scene.camera.region);
  return index * index;
}

bool stands_in(const Scene& scene, int body, int region) {
  for (int i = scene.bodies[static_cast<size_t>(body)].parent; i != kRoot; i = scene.bodies[static_cast<size_t>(i)].parent)
    if (i == region) return true;
  return region == kRoot;
}

void remove_body(Scene& scene, int body) {
  const int parent = scene.bodies[static_cast<size_t>(body)].parent;
  const auto moved = [&](int i) { return i == body ? (parent > body ? parent - 1 : parent) : i > body ? i - 1 : i; };
  scene.bodies.erase(scene.bodies.begin() + body);
  for (Body& b : scene.bodies) b.parent = moved(b.parent);
  scene.camera.region = moved(scene.camera.region);
}

}  // namespace woodcock::selftest
