#include "renderer/transport/estimator.h"

#include <algorithm>
#include <array>

#include "renderer/scene/scene_error.h"
#include "renderer/transport/line.h"
#include "renderer/transport/march.h"
#include "renderer/transport/uniform_path.h"
#include "renderer/transport/woodcock.h"
#include "renderer/world/effect_plan.h"

namespace woodcock {
namespace {

constexpr const char* kMarchBias =
    "where extinction varies the optical depth is a sum over steps, and the exponential of an estimate is too large on average";

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
    EstimatorInfo{
        .name = "uniform-path",
        .summary = "path tracing with uniform directions at surfaces and no light sampling; media may absorb and emit",
        .formula = "L0 = Le + (2 pi/N) sum_j f |cos theta_j| L(w_j), w_j uniform on the hemisphere, N of them at the first bounce",
        .source = "Kajiya 1986; Ka 2020, section 1",
        .bias = "",
        .directions = "",
        .branching = true,
        .radiance = trace_uniform_path},
    EstimatorInfo{.name = "march",
                  .summary = "fixed steps D along a ray, uniform directions at each",
                  .formula = "L = sum_i D T(y_i) [sigma_a Le + sigma_s (4 pi/N) sum_j f L(w_j)] + T(z) L0, w_j uniform on the sphere",
                  .source = "Ka 2020, section 2, algorithm 3",
                  .bias = kMarchBias,
                  .directions = "directions a step on the first ray that scatters; one a ray after that",
                  .step = true,
                  .media_scatter = true,
                  .radiance = trace_march},
    EstimatorInfo{
        .name = "line",
        .summary = "free-flight distances s_i by root finding on the marched optical depth, n on one march; phase-sampled directions",
        .formula = "L = (1/n) [sum_{s_i < z} (sigma_a Le + sigma_s L(w'))/sigma_t + (n - inside) L0], tau(s_i) = -ln(1 - xi_i)",
        .source = "Ka 2020, algorithms 1 and 2",
        .bias = kMarchBias,
        .directions = "distances n on the first ray that scatters; one a ray after that",
        .step = true,
        .media_scatter = true,
        .radiance = trace_line},
    EstimatorInfo{.name = "march-phase",
                  .summary = "fixed steps D along a ray, directions from the phase function at each",
                  .formula = "L = sum_i D T(y_i) [sigma_a Le + (sigma_s/N) sum_j L(w_j)] + T(z) L0, w_j from the phase function",
                  .source = "Ka 2020, algorithm 5, equations 12 and 13",
                  .bias = kMarchBias,
                  .directions = "directions a step on the first ray that scatters; one a ray after that",
                  .step = true,
                  .media_scatter = true,
                  .radiance = trace_march_phase},
    EstimatorInfo{
        .name = "woodcock",
        .summary = "Woodcock tracking with one majorant for the whole medium, uniform directions",
        .formula = "L = [sigma_a Le + sigma_s 4 pi f L(w')]/sigma_t at s < z with density sigma_t T, else L0; w' uniform on the sphere",
        .source = "Woodcock et al. 1965; Ka 2020, section 3.1, algorithm 4",
        .bias = "",
        .directions = "",
        .media_scatter = true,
        .radiance = trace_woodcock},
    EstimatorInfo{
        .name = "woodcock-phase",
        .summary = "Woodcock tracking with one majorant for the whole medium, directions from the phase function",
        .formula = "L = [sigma_a Le + sigma_s L(w')]/sigma_t at s < z with density sigma_t T, else L0; w' from the phase function",
        .source = "Woodcock et al. 1965; Ka 2020, section 3.2, equations 12 and 13",
        .bias = "",
        .directions = "",
        .media_scatter = true,
        .radiance = trace_woodcock_phase},
};

/// What a light without extent is called; null for lights that rays can meet, and for those that do not shine.
const char* delta_kind(const LightKind& kind) {
  if (const auto* point = std::get_if<PointLightDescription>(&kind)) return is_black(point->intensity) ? nullptr : "point";
  if (const auto* spot = std::get_if<SpotLightDescription>(&kind)) return is_black(spot->intensity) ? nullptr : "spot";
  if (const auto* distant = std::get_if<DistantLightDescription>(&kind)) return is_black(distant->radiance) ? nullptr : "distant";
  return nullptr;
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

void refuse_lights(const EstimatorInfo& estimator, const Features& features, const SceneDescription& scene) {
  if (estimator.samples_lights && features.has(Feature::kLightSampling)) return;
  const std::string others = estimator.samples_lights
                                 ? " without its light-sampling"
                                 : "; the estimators that do: " + estimator_names([](const EstimatorInfo& e) { return e.samples_lights; });
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
  for (const int medium : reachable_media(scene, world)) {
    if (!world.media[medium].scatters()) continue;
    const MediumDescription& description = scene.media[static_cast<size_t>(medium)];
    throw SceneError(description.where, "found the medium \"" + description.name + "\", which scatters, and the estimator " +
                                            name_in_quotes(estimator) +
                                            " follows scattering at surfaces only; leave in-scattering out with --only, or choose one of " +
                                            estimator_names([](const EstimatorInfo& e) { return e.media_scatter; }));
  }
}

}  // namespace woodcock
