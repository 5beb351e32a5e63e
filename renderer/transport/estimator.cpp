#include "renderer/transport/estimator.h"

#include <algorithm>
#include <array>
#include <set>

#include "renderer/scene/scene_error.h"

namespace woodcock {
namespace {

constexpr std::array kEstimators{
    EstimatorInfo{
        .name = "auto",
        .summary = "the best unbiased choice for what the scene calls for",
        .formula = "L = int_0^z T(s) [sigma_a Le + sigma_s int f L dw] ds + T(z) L0, weighted Woodcock tracking with light sampling",
        .source = "Woodcock et al. 1965; Raab, Seibert & Keller 2006; Galtier et al. 2013; Veach 1997",
        .bias = "",
        .directions = "",
        .tunable = true,
        .samples_lights = true,
        .media_scatter = true,
        .radiance = trace_path},
};

/// What a light without extent is called; null for lights that rays can meet, and for those that do not shine.
const char* delta_kind(const LightKind& kind) {
  if (const auto* point = std::get_if<PointLightDescription>(&kind)) return is_black(point->intensity) ? nullptr : "point";
  if (const auto* spot = std::get_if<SpotLightDescription>(&kind)) return is_black(spot->intensity) ? nullptr : "spot";
  if (const auto* distant = std::get_if<DistantLightDescription>(&kind)) return is_black(distant->radiance) ? nullptr : "distant";
  return nullptr;
}

/// The media that boundaries and the camera lead into.
std::set<int> used_media(const SceneDescription& scene, const World& world) {
  std::set<int> used{world.camera_medium};
  const auto add = [&](const ShapeDescription& shape) {
    if (shape.media.given) used.insert({shape.media.inside, shape.media.outside});
  };
  std::for_each(scene.shapes.begin(), scene.shapes.end(), add);
  for (const InstanceDescription& instance : scene.instances) {
    const auto& shapes = scene.objects[static_cast<size_t>(instance.object)].shapes;
    std::for_each(shapes.begin(), shapes.end(), add);
  }
  used.erase(kNone);
  return used;
}

std::string name_in_quotes(const EstimatorInfo& estimator) { return std::string("\"") + estimator.name + "\""; }

}  // namespace

std::span<const EstimatorInfo> estimators() { return kEstimators; }

const EstimatorInfo* find_estimator(std::string_view name) {
  const auto found = std::find_if(kEstimators.begin(), kEstimators.end(), [&](const EstimatorInfo& e) { return e.name == name; });
  return found == kEstimators.end() ? nullptr : &*found;
}

std::string estimator_names(bool (*accepts)(const EstimatorInfo&)) {
  std::string names;
  for (const EstimatorInfo& e : kEstimators) {
    if (!accepts(e)) continue;
    if (!names.empty()) names += ", ";
    names += e.name;
  }
  return names;
}

void refuse_lights(const EstimatorInfo& estimator, const SceneDescription& scene) {
  if (estimator.samples_lights) return;
  const std::string others = "; the estimators that do: " + estimator_names([](const EstimatorInfo& e) { return e.samples_lights; });
  for (const LightDescription& light : scene.lights) {
    if (const char* kind = delta_kind(light.kind))
      throw SceneError(light.where, "found a " + std::string(kind) + " light, which no ray can meet, and the estimator " +
                                        name_in_quotes(estimator) + " does not sample lights" + others);
  }
  for (const ShapeDescription& shape : scene.shapes) {
    if (shape.area_light && shape.alpha.texture == kNone && shape.alpha.value <= 0)
      throw SceneError(shape.where, "found an area light of opacity 0, which no ray can meet, and the estimator " +
                                        name_in_quotes(estimator) + " does not sample lights" + others);
  }
}

void refuse_media(const EstimatorInfo& estimator, const SceneDescription& scene, const World& world) {
  if (estimator.media_scatter) return;
  for (const int medium : used_media(scene, world)) {
    if (!world.media[medium].scatters()) continue;
    const MediumDescription& description = scene.media[static_cast<size_t>(medium)];
    throw SceneError(description.where, "found the medium \"" + description.name + "\", which scatters, and the estimator " +
                                            name_in_quotes(estimator) +
                                            " follows scattering at surfaces only; leave in-scattering out with --only, or choose one of " +
                                            estimator_names([](const EstimatorInfo& e) { return e.media_scatter; }));
  }
}

}  // namespace woodcock
