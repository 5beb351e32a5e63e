// What is in the world: textures, materials, media, lights, shapes.
#include "renderer/scene/flat_transform.h"
#include "renderer/scene/limits.h"
#include "renderer/scene/scene_builder.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

void SceneBuilder::texture(const std::string& name, const std::string& value_type, const std::string& kind, ParameterList list,
                           const SourceLocation& where) {
  expect_world("Texture", where);
  Parameters parameters(context_, "Texture \"" + kind + "\"", where, std::move(list), state_.texture_attributes);
  const DMat4 transform = current_transform("Texture", where);
  SceneDescription& scene = context_.scene;
  const auto add = [&](auto& names, auto& textures, auto&& read) {
    expect_room(textures.size(), limits::kNamedThings, "textures", where);
    if (names.contains(name)) throw SceneError(where, "found Texture \"" + name + "\" a second time, expected another name");
    auto texture = read(name, kind, transform, parameters);
    names[name] = static_cast<int>(textures.size());
    textures.push_back(std::move(texture));
  };
  if (value_type == "float")
    add(context_.float_textures, scene.float_textures, read_float_texture);
  else if (value_type == "spectrum")
    add(context_.rgb_textures, scene.rgb_textures, read_rgb_texture);
  else
    throw SceneError(where, "found the texture type \"" + value_type + "\", expected \"float\" or \"spectrum\"");
  parameters.finish();
}

int SceneBuilder::add_material(const std::string& name, PendingMaterial pending, const SourceLocation& where) {
  expect_room(pending_materials_.size(), limits::kNamedThings, "materials", where);
  const int index = static_cast<int>(pending_materials_.size());
  context_.scene.materials.push_back({name, where, InterfaceDescription{}});
  pending_materials_.push_back(std::move(pending));
  return index;
}

void SceneBuilder::material(const std::string& kind, ParameterList list, const SourceLocation& where) {
  expect_world("Material", where);
  state_.material = add_material("", {kind, "Material \"" + kind + "\"", std::move(list), state_.material_attributes}, where);
}

namespace {
/// Takes `"string type"` out of the list.
std::string take_type(ParameterList& list, const std::string& directive, const SourceLocation& where) {
  const auto type = std::find_if(list.begin(), list.end(), [](const Parameter& p) { return p.name == "type"; });
  if (type == list.end()) throw SceneError(where, "found " + directive + " without \"string type\", expected it");
  if ((type->type != "string" && !type->type.empty()) || type->strings.size() != 1)
    throw SceneError(type->where, "found \"" + type->type + " type\" for " + directive + ", expected one \"string type\"");
  std::string kind = type->strings[0];
  list.erase(type);
  return kind;
}
}  // namespace

void SceneBuilder::make_named_material(const std::string& name, ParameterList list, const SourceLocation& where) {
  expect_world("MakeNamedMaterial", where);
  if (material_names_.contains(name))
    throw SceneError(where, "found MakeNamedMaterial \"" + name + "\" a second time, expected another name");
  const std::string kind = take_type(list, "MakeNamedMaterial \"" + name + "\"", where);
  material_names_[name] = add_material(
      name, {kind, "MakeNamedMaterial \"" + name + "\" of type \"" + kind + "\"", std::move(list), state_.material_attributes}, where);
}

void SceneBuilder::named_material(const std::string& name, const SourceLocation& where) {
  expect_world("NamedMaterial", where);
  state_.material = material_references_.refer(name, where);
}

void SceneBuilder::make_named_medium(const std::string& name, ParameterList list, const SourceLocation& where) {
  expect_room(context_.scene.media.size(), limits::kNamedThings, "media", where);
  if (medium_names_.contains(name)) throw SceneError(where, "found MakeNamedMedium \"" + name + "\" a second time, expected another name");
  if (name.empty()) throw SceneError(where, "found MakeNamedMedium \"\", expected a name: the empty one stands for vacuum");
  const std::string kind = take_type(list, "MakeNamedMedium \"" + name + "\"", where);
  Parameters parameters(context_, "MakeNamedMedium \"" + name + "\" of type \"" + kind + "\"", where, std::move(list),
                        state_.medium_attributes);
  DMat4 transform = current_transform("MakeNamedMedium", where);
  if (auto medium = read_medium(kind, parameters)) {
    parameters.finish();
    // What is the same everywhere has no place.
    const bool placed =
        !std::holds_alternative<HomogeneousDescription>(medium->kind) && !std::holds_alternative<SumMediumDescription>(medium->kind);
    if (placed)
      transform = current_regular_transform("MakeNamedMedium \"" + name + "\"", where);
    else if (dimensions_of(transform) < 3)
      transform = DMat4(1);
    if (auto* sum = std::get_if<SumMediumDescription>(&medium->kind))
      for (const std::string& part : medium->summed) sum->media.push_back(medium_references_.refer(part, parameters.place("media")));
    medium_names_[name] = static_cast<int>(context_.scene.media.size());
    context_.scene.media.push_back({name, where, transform, std::move(medium->kind)});
  }
}

void SceneBuilder::light_source(const std::string& kind, ParameterList list, const SourceLocation& where) {
  expect_world("LightSource", where);
  expect_room(context_.scene.lights.size(), limits::kObjects, "lights", where);
  Parameters parameters(context_, "LightSource \"" + kind + "\"", where, std::move(list), state_.light_attributes);
  const auto light = read_light(kind, parameters);
  if (!light) return;
  parameters.finish();
  context_.scene.lights.push_back(
      {where, current_regular_transform("LightSource \"" + kind + "\"", where), state_.media.outside, state_.media.given, *light});
}

void SceneBuilder::area_light_source(const std::string& kind, ParameterList list, const SourceLocation& where) {
  expect_world("AreaLightSource", where);
  Parameters parameters(context_, "AreaLightSource \"" + kind + "\"", where, std::move(list), state_.light_attributes);
  const auto light = read_area_light(kind, parameters);
  if (!light) return;
  parameters.finish();
  state_.area_light = std::make_shared<const AreaLightDescription>(*light);
}

void SceneBuilder::shape(const std::string& kind, ParameterList list, const SourceLocation& where) {
  expect_world("Shape", where);
  SceneDescription& scene = context_.scene;
  std::vector<ShapeDescription>& shapes =
      current_object_ == kNone ? scene.shapes : scene.objects[static_cast<size_t>(current_object_)].shapes;
  expect_room(shapes.size(), limits::kObjects, "shapes", where);
  Parameters parameters(context_, "Shape \"" + kind + "\"", where, std::move(list), state_.shape_attributes);
  ShapeDescription shape;
  shape.alpha = parameters.float_or_texture("alpha", 1);
  auto geometry = read_shape(kind, parameters);
  if (!geometry) return;
  parameters.finish();
  shape.where = where;
  shape.kind = std::move(*geometry);
  shape.world_from_object = current_transform("Shape", where);
  const bool is_mesh = std::holds_alternative<std::shared_ptr<const TriangleMesh>>(shape.kind) ||
                       std::holds_alternative<std::shared_ptr<const BilinearMesh>>(shape.kind);
  if (dimensions_of(shape.world_from_object) < 3 && !(is_mesh && context_.options.skip_payload)) {
    size_t dropped = 0;
    const bool has_area = restore_flat_shape(shape, "Shape \"" + kind + "\"", dropped);
    if (!has_area)
      context_.warn(where, "Shape \"" + kind + "\" under a scale of 0 has no area and is left out");
    else if (dropped != 0)
      context_.warn(where, std::to_string(dropped) + " faces without area under a scale of 0 are left out");
    if (!has_area) return;
  }
  shape.reverse_orientation = state_.reverse_orientation;
  shape.material = state_.material;
  shape.media = state_.media;
  if (state_.area_light) {
    if (current_object_ == kNone)
      shape.area_light = *state_.area_light;
    else
      context_.ignore(where, "an area light on a shape between ObjectBegin and ObjectEnd (pbrt-v4 lets it emit nothing either)");
  }
  shapes.push_back(std::move(shape));
}

}  // namespace woodcock
