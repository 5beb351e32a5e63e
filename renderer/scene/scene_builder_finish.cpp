// After the last directive: names are resolved, materials built, and what spans directives is checked.
#include "renderer/scene/scene_builder.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

void SceneBuilder::build_materials() {
  interior_media_.assign(pending_materials_.size(), kNone);
  for (size_t i = 0; i < pending_materials_.size(); ++i) {
    PendingMaterial& pending = pending_materials_[i];
    MaterialDescription& material = context_.scene.materials[i];
    Parameters parameters(context_, pending.directive, material.where, std::move(pending.parameters), pending.attributes);
    ReadMaterial read = read_material(pending.kind, parameters);
    if (pending.kind != "hair" && pending.kind != "measured") parameters.finish();
    material.kind = read.kind;
    material.normal_map = read.normal_map;
    material.displacement = read.displacement;
    if (auto* mix = std::get_if<MixDescription>(&material.kind)) {
      mix->material1 = material_references_.refer(read.mixed[0], parameters.place("materials"));
      mix->material2 = material_references_.refer(read.mixed[1], parameters.place("materials"));
    }
    if (read.interior) {
      interior_media_[i] = static_cast<int>(context_.scene.media.size());
      context_.scene.media.push_back({"inside of " + pending.directive, material.where, DMat4(1), *read.interior});
    }
  }
}

void SceneBuilder::check_mixes() const {
  // Depth-first over mixes with an own stack: 0 unseen, 1 on the path, 2 done.
  const std::vector<MaterialDescription>& materials = context_.scene.materials;
  std::vector<char> state(materials.size(), 0);
  for (size_t root = 0; root < materials.size(); ++root) {
    std::vector<std::pair<int, int>> path{{static_cast<int>(root), 0}};
    if (state[root] == 2) continue;
    state[root] = 1;
    while (!path.empty()) {
      auto& [index, child] = path.back();
      const MaterialDescription& material = materials[static_cast<size_t>(index)];
      const auto* mix = std::get_if<MixDescription>(&material.kind);
      if (!mix || child == 2) {
        state[static_cast<size_t>(index)] = 2;
        path.pop_back();
        continue;
      }
      const int next = child++ == 0 ? mix->material1 : mix->material2;
      if (state[static_cast<size_t>(next)] == 1)
        throw SceneError(material.where, "found the mix material \"" + material.name +
                                             "\" that contains itself, expected materials that are defined without it");
      if (interior_media_[static_cast<size_t>(next)] != kNone)
        throw SceneError(
            material.where,
            "found a mix of a subsurface material, which is not supported: a boundary has one medium inside. Use \"subsurface\" by itself");
      if (state[static_cast<size_t>(next)] == 0) {
        state[static_cast<size_t>(next)] = 1;
        path.emplace_back(next, 0);
      }
    }
  }
}

void SceneBuilder::resolve_sum(const MediumDescription& medium, SumMediumDescription& sum) const {
  for (int& part : sum.media) {
    part = medium_references_.target(part);
    const MediumDescription& summed = context_.scene.media[static_cast<size_t>(part)];
    if (std::holds_alternative<SumMediumDescription>(summed.kind))
      throw SceneError(medium.where, "found the sum \"" + summed.name + "\" in the sum \"" + medium.name +
                                         "\", expected media that are no sums; name its media here instead");
  }
}

void SceneBuilder::resolve_interface(MediumInterfaceDescription& media) const {
  media.inside = medium_references_.target(media.inside);
  media.outside = medium_references_.target(media.outside);
}

void SceneBuilder::resolve_shape(ShapeDescription& shape) {
  shape.material = material_references_.target(shape.material);
  resolve_interface(shape.media);
  // As in pbrt-v4 the same on both sides is no transition: the ray's medium stays what it is.
  if (shape.media.inside == shape.media.outside) shape.media.given = false;
  if (shape.area_light &&
      std::holds_alternative<InterfaceDescription>(context_.scene.materials[static_cast<size_t>(shape.material)].kind)) {
    context_.ignore(shape.where, "an area light on a shape of material \"interface\" (pbrt-v4 lets it emit nothing either)");
    shape.area_light.reset();
  }
  const int interior = interior_media_[static_cast<size_t>(shape.material)];
  if (interior == kNone) return;
  shape.media.inside = interior;
  shape.media.given = true;
}

void SceneBuilder::warn_about_surface_integrator() {
  static const std::vector<std::string> kSurfacesOnly{"path", "simplepath", "randomwalk", "lightpath", "sppm"};
  const RenderSettings& settings = context_.scene.settings;
  if (!context_.scene.media.empty() && std::find(kSurfacesOnly.begin(), kSurfacesOnly.end(), settings.integrator) != kSurfacesOnly.end())
    context_.warn(context_.scene.media.front().where,
                  "Integrator \"" + settings.integrator + "\" of pbrt-v4 does not see media; here they are rendered");
}

void SceneBuilder::finish(const SourceLocation& where) {
  if (!saved_.empty()) throw SceneError(saved_.back().where, "found " + saved_.back().word + " without its end");
  if (!in_world_) throw SceneError(where, "found the end of the file before WorldBegin, expected WorldBegin and a world");
  build_materials();
  material_references_.resolve(material_names_, "material", "Define it with MakeNamedMaterial");
  medium_references_.resolve(medium_names_, "medium", "Define it with MakeNamedMedium");
  object_references_.resolve(object_names_, "object", "Define it with ObjectBegin");
  SceneDescription& scene = context_.scene;
  for (MaterialDescription& material : scene.materials)
    if (auto* mix = std::get_if<MixDescription>(&material.kind)) {
      mix->material1 = material_references_.target(mix->material1);
      mix->material2 = material_references_.target(mix->material2);
    }
  check_mixes();
  for (MediumDescription& medium : scene.media)
    if (auto* sum = std::get_if<SumMediumDescription>(&medium.kind)) resolve_sum(medium, *sum);
  for (ShapeDescription& shape : scene.shapes) resolve_shape(shape);
  for (ObjectDescription& object : scene.objects)
    for (ShapeDescription& shape : object.shapes) resolve_shape(shape);
  for (InstanceDescription& instance : scene.instances) instance.object = object_references_.target(instance.object);
  for (LightDescription& light : scene.lights) light.medium = medium_references_.target(light.medium);
  resolve_interface(scene.camera.media);
  // pbrt-v4's imaging ratio: exposure time × iso / 100.
  scene.film.image_scale *= static_cast<float>(scene.camera.shutter_close - scene.camera.shutter_open);
  warn_about_surface_integrator();
}

}  // namespace woodcock
