#include "renderer/scene/scene_builder.h"

#include <algorithm>
#include <cmath>

#include "renderer/scene/flat_transform.h"
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

void SceneBuilder::expect_room(size_t held, int64_t limit, const std::string& what, const SourceLocation& where) {
  if (static_cast<int64_t>(held) >= limit)
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

namespace {
/// Throws unless `m` is affine and finite. One that flattens space (a scale of 0) is judged where it is used.
void expect_affine(const DMat4& m, const SourceLocation& where) {
  bool finite = true;
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 4; ++row) finite = finite && std::isfinite(m[column][row]);
  const bool affine = m[0][3] == 0 && m[1][3] == 0 && m[2][3] == 0 && m[3][3] == 1;
  if (!finite) throw SceneError(where, "found a transform that overflows, expected one with finite numbers");
  if (!affine) throw SceneError(where, "found a projective transform, expected an affine one (last row 0 0 0 1)");
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
      expect_affine(state_.transform[i], where);
    }
}

void SceneBuilder::set_transform(const DMat4& matrix, const SourceLocation& where) {
  expect_affine(matrix, where);
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

DMat4 SceneBuilder::current_regular_transform(const std::string& what, const SourceLocation& where) {
  const DMat4 m = current_transform(what, where);
  if (dimensions_of(m) < 3)
    throw SceneError(
        where, "found " + what + " under a singular transform, which flattens space (a scale of 0?), expected one that can be inverted");
  return m;
}

// --- blocks

void SceneBuilder::attribute_begin(const std::string& word, const SourceLocation& where) {
  expect_world(word, where);
  expect_room(saved_.size(), limits::kNesting, "blocks within each other", where);
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
  expect_room(context_.scene.objects.size(), limits::kNamedThings, "objects", where);
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
  expect_room(context_.scene.instances.size(), limits::kObjects, "object instances", where);
  const int object = object_references_.refer(name, where);
  if (dimensions_of(current_transform("ObjectInstance", where)) < 2) {
    context_.warn(where, "ObjectInstance \"" + name + "\" under a scale of 0 has no area and is left out");
    return;
  }
  context_.scene.instances.push_back({where, object, current_regular_transform("ObjectInstance \"" + name + "\"", where)});
}

void SceneBuilder::world_begin(const SourceLocation& where) {
  expect_options("WorldBegin", where);
  in_world_ = true;
  state_.transform = {DMat4(1), DMat4(1)};
  state_.active = 3;
  coordinate_systems_["world"] = state_.transform;
}

// --- state

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
      expect_room(list->size(), limits::kDefaultAttributes, "parameters of Attribute directives", p.where);
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
  camera.world_from_camera = glm::inverse(current_regular_transform("Camera", where));
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

}  // namespace woodcock
