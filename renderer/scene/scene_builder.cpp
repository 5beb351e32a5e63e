#include "renderer/scene/scene_builder.h"

#include <algorithm>
#include <cmath>

#include "renderer/scene/limits.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

void refuse_kind(ReadContext& context, const SourceLocation& where, const std::string& what, const std::string& kind,
                 const std::vector<std::string>& supported, const std::vector<std::string>& unsupported) {
  if (std::find(unsupported.begin(), unsupported.end(), kind) != unsupported.end()) {
    context.unsupported(where, what + " \"" + kind + "\"");
    return;
  }
  std::vector<std::string> all = supported;
  all.insert(all.end(), unsupported.begin(), unsupported.end());
  throw SceneError(where, "found the unknown type \"" + kind + "\" for " + what + ", expected one of " + quoted_list(supported) + "." +
                              suggestion(kind, all));
}

// --- names
// -----------------------------------------------------------------------------------------------------------------------------------

int SceneBuilder::References::refer(const std::string& name, const SourceLocation& where) {
  const auto [entry, fresh] = known_.try_emplace(name, static_cast<int>(list_.size()));
  if (fresh) list_.push_back({name, where});
  return -2 - entry->second;
}

void SceneBuilder::References::resolve(const std::map<std::string, int>& indices, const std::string& what, const std::string& advice) {
  targets_.resize(list_.size());
  for (size_t i = 0; i < list_.size(); ++i) {
    const auto found = indices.find(list_[i].name);
    if (found == indices.end()) {
      std::vector<std::string> names;
      for (const auto& [name, index] : indices) names.push_back(name);
      throw SceneError(list_[i].where, "found the unknown " + what + " \"" + list_[i].name + "\", expected one of: " + quoted_list(names) +
                                           "." + suggestion(list_[i].name, names) + " " + advice);
    }
    targets_[i] = found->second;
  }
}

template <typename Container>
void SceneBuilder::expect_room(const Container& container, int64_t limit, const std::string& what, const SourceLocation& where) const {
  if (static_cast<int64_t>(container.size()) >= limit)
    throw SceneError(where, "found more than " + std::to_string(limit) + " " + what + ", which is more than is accepted");
}

SceneBuilder::SceneBuilder(ReadContext& context) : context_(context) {
  // pbrt-v4's default material.
  state_.material = add_material("", {"diffuse", "Material \"diffuse\"", {}, nullptr}, {"", 0, 0});
}

void SceneBuilder::expect_options(const std::string& word, const SourceLocation& where) const {
  if (in_world_) throw SceneError(where, "found " + word + " after WorldBegin, expected it before: it describes the whole image");
}

void SceneBuilder::expect_world(const std::string& word, const SourceLocation& where) const {
  if (!in_world_) throw SceneError(where, "found " + word + " before WorldBegin, expected it after");
}

// --- transforms
// ------------------------------------------------------------------------------------------------------------------------------

namespace {
/// Throws unless `m` is affine, finite and invertible.
void expect_regular(const DMat4& m, const SourceLocation& where) {
  double product = 1;
  bool finite = true;
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) finite = finite && std::isfinite(m[column][row]);
    if (column < 3) product *= glm::length(DVec3(m[column]));
  }
  const bool affine = m[0][3] == 0 && m[1][3] == 0 && m[2][3] == 0 && m[3][3] == 1;
  if (!affine) throw SceneError(where, "found a projective transform, expected an affine one (last row 0 0 0 1)");
  const double determinant = std::abs(glm::dot(DVec3(m[0]), glm::cross(DVec3(m[1]), DVec3(m[2]))));
  if (!finite || !(product > 0) || !(determinant > 1e-12 * product))
    throw SceneError(where, "found a singular transform (it flattens space, or overflows), expected one that can be inverted");
}
}  // namespace

void SceneBuilder::identity() {
  for (int i = 0; i < 2; ++i)
    if (state_.active & (1u << i)) state_.transform[i] = DMat4(1);
}

void SceneBuilder::multiply(const DMat4& matrix, const SourceLocation& where) {
  for (int i = 0; i < 2; ++i)
    if (state_.active & (1u << i)) {
      state_.transform[i] = state_.transform[i] * matrix;
      expect_regular(state_.transform[i], where);
    }
}

void SceneBuilder::set_transform(const DMat4& matrix, const SourceLocation& where) {
  expect_regular(matrix, where);
  for (int i = 0; i < 2; ++i)
    if (state_.active & (1u << i)) state_.transform[i] = matrix;
}

void SceneBuilder::coordinate_system(const std::string& name) { coordinate_systems_[name] = state_.transform; }

void SceneBuilder::coord_sys_transform(const std::string& name, const SourceLocation& where) {
  const auto found = coordinate_systems_.find(name);
  if (found == coordinate_systems_.end()) {
    std::vector<std::string> names;
    for (const auto& [known, matrix] : coordinate_systems_) names.push_back(known);
    throw SceneError(where, "found the unknown coordinate system \"" + name + "\", expected one of: " + quoted_list(names) + "." +
                                suggestion(name, names));
  }
  state_.transform = found->second;
}

void SceneBuilder::active_transform(const std::string& which, const SourceLocation& where) {
  if (which == "StartTime")
    state_.active = 1;
  else if (which == "EndTime")
    state_.active = 2;
  else if (which == "All")
    state_.active = 3;
  else
    throw SceneError(where, "found ActiveTransform " + which + ", expected StartTime, EndTime or All");
}

void SceneBuilder::transform_times(double, double) {
  // Times matter only between transforms that differ, and those are refused where they are used.
}

DMat4 SceneBuilder::current_transform(const std::string& what, const SourceLocation& where) {
  if (state_.transform[0] != state_.transform[1])
    context_.unsupported(where, what + " with a transform that changes over time (motion blur)");
  return state_.transform[0];
}

// --- blocks
// ----------------------------------------------------------------------------------------------------------------------------------

void SceneBuilder::attribute_begin(const std::string& word, const SourceLocation& where) {
  expect_world(word, where);
  expect_room(saved_, limits::kNesting, "blocks within each other", where);
  saved_.push_back({state_, word, where});
}

void SceneBuilder::attribute_end(const std::string& word, const SourceLocation& where) {
  const std::string begin = word.substr(0, word.size() - 3) + "Begin";
  if (saved_.empty()) throw SceneError(where, "found " + word + " without " + begin);
  if (saved_.back().word != begin)
    throw SceneError(
        where, "found " + word + ", expected the end of " + saved_.back().word + " of line " + std::to_string(saved_.back().where.line));
  state_ = std::move(saved_.back().state);
  saved_.pop_back();
}

void SceneBuilder::import_begin(const SourceLocation& where) { attribute_begin("ImportBegin", where); }
void SceneBuilder::import_end(const SourceLocation& where) { attribute_end("ImportEnd", where); }

void SceneBuilder::object_begin(const std::string& name, const SourceLocation& where) {
  expect_world("ObjectBegin", where);
  if (current_object_ != kNone) throw SceneError(where, "found ObjectBegin inside ObjectBegin, expected ObjectEnd first");
  expect_room(context_.scene.objects, limits::kNamedThings, "objects", where);
  if (!object_names_.try_emplace(name, static_cast<int>(context_.scene.objects.size())).second)
    throw SceneError(where, "found ObjectBegin \"" + name + "\" a second time, expected another name");
  attribute_begin("ObjectBegin", where);
  current_object_ = static_cast<int>(context_.scene.objects.size());
  context_.scene.objects.push_back({name, {}});
}

void SceneBuilder::object_end(const SourceLocation& where) {
  attribute_end("ObjectEnd", where);
  current_object_ = kNone;
}

void SceneBuilder::object_instance(const std::string& name, const SourceLocation& where) {
  expect_world("ObjectInstance", where);
  if (current_object_ != kNone) throw SceneError(where, "found ObjectInstance inside ObjectBegin, expected ObjectEnd first");
  expect_room(context_.scene.instances, limits::kObjects, "object instances", where);
  context_.scene.instances.push_back({where, object_references_.refer(name, where), current_transform("ObjectInstance", where)});
}

void SceneBuilder::world_begin(const SourceLocation& where) {
  expect_options("WorldBegin", where);
  in_world_ = true;
  state_.transform = {DMat4(1), DMat4(1)};
  state_.active = 3;
  coordinate_systems_["world"] = state_.transform;
}

// --- state
// -----------------------------------------------------------------------------------------------------------------------------------

void SceneBuilder::reverse_orientation(const SourceLocation& where) {
  expect_world("ReverseOrientation", where);
  state_.reverse_orientation = !state_.reverse_orientation;
}

void SceneBuilder::color_space(const std::string& name, const SourceLocation& where) {
  if (name == "srgb") return;
  refuse_kind(context_, where, "ColorSpace", name, {"srgb"}, {"aces2065-1", "dci-p3", "rec2020"});
}

void SceneBuilder::attribute(const std::string& target, ParameterList parameters, const SourceLocation& where) {
  const std::vector<std::pair<std::string, Attributes*>> targets{{"shape", &state_.shape_attributes},
                                                                 {"light", &state_.light_attributes},
                                                                 {"material", &state_.material_attributes},
                                                                 {"medium", &state_.medium_attributes},
                                                                 {"texture", &state_.texture_attributes}};
  for (const auto& [name, attributes] : targets) {
    if (target != name) continue;
    auto list = *attributes ? std::make_shared<ParameterList>(**attributes) : std::make_shared<ParameterList>();
    for (Parameter& p : parameters) {
      expect_room(*list, limits::kDefaultAttributes, "parameters of Attribute directives", p.where);
      list->push_back(std::move(p));
    }
    *attributes = std::move(list);
    return;
  }
  throw SceneError(where, "found Attribute \"" + target + "\", expected one of \"shape\" \"light\" \"material\" \"medium\" \"texture\"");
}

void SceneBuilder::medium_interface(const std::string& inside, const std::string& outside, const SourceLocation& where) {
  const auto reference = [&](const std::string& name) { return name.empty() ? kNone : medium_references_.refer(name, where); };
  state_.media = {reference(inside), reference(outside), true};
}

// --- what describes the image
// ----------------------------------------------------------------------------------------------------------------

void SceneBuilder::option(ParameterList list, const SourceLocation& where) {
  Parameters parameters(context_, "Option", where, std::move(list));
  read_option(parameters, context_.scene.settings);
  parameters.finish();
}

void SceneBuilder::camera(const std::string& kind, ParameterList list, const SourceLocation& where) {
  expect_options("Camera", where);
  Parameters parameters(context_, "Camera \"" + kind + "\"", where, std::move(list));
  CameraDescription camera = read_camera(kind, parameters);
  // The parameters of a camera that is left out under --allow-unsupported mean nothing to the one that replaces it.
  if (kind == "perspective" || kind == "orthographic") parameters.finish();
  camera.world_from_camera = glm::inverse(current_transform("Camera", where));
  coordinate_systems_["camera"] = {glm::inverse(state_.transform[0]), glm::inverse(state_.transform[1])};
  camera.media = state_.media;
  context_.scene.camera = camera;
}

void SceneBuilder::film(const std::string& kind, ParameterList list, const SourceLocation& where) {
  expect_options("Film", where);
  Parameters parameters(context_, "Film \"" + kind + "\"", where, std::move(list));
  const FilterDescription filter = context_.scene.film.filter;
  context_.scene.film = read_film(kind, parameters);
  context_.scene.film.filter = filter;
  parameters.finish();
}

void SceneBuilder::pixel_filter(const std::string& kind, ParameterList list, const SourceLocation& where) {
  expect_options("PixelFilter", where);
  Parameters parameters(context_, "PixelFilter \"" + kind + "\"", where, std::move(list));
  context_.scene.film.filter = read_filter(kind, parameters);
  parameters.finish();
}

void SceneBuilder::sampler(const std::string& kind, ParameterList list, const SourceLocation& where) {
  expect_options("Sampler", where);
  Parameters parameters(context_, "Sampler \"" + kind + "\"", where, std::move(list));
  read_sampler(kind, parameters, context_.scene.settings);
  parameters.finish();
}

void SceneBuilder::integrator(const std::string& kind, ParameterList list, const SourceLocation& where) {
  expect_options("Integrator", where);
  Parameters parameters(context_, "Integrator \"" + kind + "\"", where, std::move(list));
  read_integrator(kind, parameters, context_.scene.settings);
  parameters.finish();
}

void SceneBuilder::accelerator(const std::string& kind, ParameterList list, const SourceLocation& where) {
  expect_options("Accelerator", where);
  Parameters parameters(context_, "Accelerator \"" + kind + "\"", where, std::move(list));
  read_accelerator(kind, parameters);
  parameters.finish();
}

// --- what is in the world
// --------------------------------------------------------------------------------------------------------------------

void SceneBuilder::texture(const std::string& name, const std::string& value_type, const std::string& kind, ParameterList list,
                           const SourceLocation& where) {
  expect_world("Texture", where);
  Parameters parameters(context_, "Texture \"" + kind + "\"", where, std::move(list), state_.texture_attributes);
  const DMat4 transform = current_transform("Texture", where);
  SceneDescription& scene = context_.scene;
  const auto add = [&](auto& names, auto& textures, auto&& read) {
    expect_room(textures, limits::kNamedThings, "textures", where);
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
  expect_room(pending_materials_, limits::kNamedThings, "materials", where);
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
  expect_room(context_.scene.media, limits::kNamedThings, "media", where);
  if (medium_names_.contains(name)) throw SceneError(where, "found MakeNamedMedium \"" + name + "\" a second time, expected another name");
  if (name.empty()) throw SceneError(where, "found MakeNamedMedium \"\", expected a name: the empty one stands for vacuum");
  const std::string kind = take_type(list, "MakeNamedMedium \"" + name + "\"", where);
  Parameters parameters(context_, "MakeNamedMedium \"" + name + "\" of type \"" + kind + "\"", where, std::move(list),
                        state_.medium_attributes);
  const DMat4 transform = current_transform("MakeNamedMedium", where);
  if (auto medium = read_medium(kind, parameters)) {
    parameters.finish();
    if (auto* sum = std::get_if<SumMediumDescription>(&medium->kind))
      for (const std::string& part : medium->summed) sum->media.push_back(medium_references_.refer(part, parameters.place("media")));
    medium_names_[name] = static_cast<int>(context_.scene.media.size());
    context_.scene.media.push_back({name, where, transform, std::move(medium->kind)});
  }
}

void SceneBuilder::light_source(const std::string& kind, ParameterList list, const SourceLocation& where) {
  expect_world("LightSource", where);
  expect_room(context_.scene.lights, limits::kObjects, "lights", where);
  Parameters parameters(context_, "LightSource \"" + kind + "\"", where, std::move(list), state_.light_attributes);
  const auto light = read_light(kind, parameters);
  if (!light) return;
  parameters.finish();
  context_.scene.lights.push_back({where, current_transform("LightSource", where), state_.media.outside, state_.media.given, *light});
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
  expect_room(shapes, limits::kObjects, "shapes", where);
  Parameters parameters(context_, "Shape \"" + kind + "\"", where, std::move(list), state_.shape_attributes);
  ShapeDescription shape;
  shape.alpha = parameters.float_or_texture("alpha", 1);
  auto geometry = read_shape(kind, parameters);
  if (!geometry) return;
  parameters.finish();
  shape.where = where;
  shape.kind = std::move(*geometry);
  shape.world_from_object = current_transform("Shape", where);
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

// --- the end
// ---------------------------------------------------------------------------------------------------------------------------------

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
