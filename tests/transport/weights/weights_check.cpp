#include "tests/transport/weights/weights_check.h"

#include <fmt/format.h>

#include "renderer/scene/read_scene.h"
#include "renderer/world/effects.h"
#include "tests/transport/weights/random_scenes.h"
#include "tests/transport/weights/recorded_path.h"

namespace woodcock::testing {
namespace {

/// What an analysis may find not worth while, where it can be done at all.
uint32_t possible_effects(const World& world) {
  uint32_t effects = 0;
  if (!world.emissive_media.empty()) effects |= kEmissionSampling;
  bool bounded = false;
  for (int i = 0; i < world.lights.size(); ++i) bounded = bounded || world.lights.bounded_pmf(i) > 0;
  if (bounded && (world.effects & kVolumeScattering) != 0) effects |= kEquiangular;
  return effects;
}

}  // namespace

CheckReport check_scene(const std::string& text, PathSettings settings, bool force_effects, int paths, const std::string& name) {
  const SceneDescription description = read_scene_text(text, "random.pbrt", ".", {});
  const std::unique_ptr<const World> built = build_world(description);
  // Made by build_world() as an object that is not const.
  World& world = const_cast<World&>(*built);
  if (force_effects) world.effects |= possible_effects(world);
  settings.max_depth = description.settings.max_depth;
  const SceneFormulas formulas(description, world);
  PathCheck check(formulas, settings, world.effects);
  CheckReport report;
  PathCounters count, shipped_count;
  PathRecord record;
  const int width = description.film.x_resolution, height = description.film.y_resolution;
  for (int i = 0; i < paths; ++i) {
    // Spread over the pixels.
    const int pixel = static_cast<int>((static_cast<int64_t>(i) * 97) % (width * height)), x = pixel % width, y = pixel / width;
    const PathKey key = path_key(settings.frame_seed, static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint64_t>(i), 0,
                                 settings.features.has(Feature::kSobol));
    const CameraSample camera = camera_sample(world, key, x, y);
    const PathResult result = record_path(world, settings, camera.ray, key, count, record);
    const std::string path_name = fmt::format("{}, path {}", name, i);
    check.check(record, path_name, report);
    // What is recorded is what is rendered.
    if (i % 16 == 0 && trace_path(world, settings, camera.ray, key, shipped_count).radiance != result.radiance) {
      ++report.failed;
      report.failures.push_back(path_name + ": the recording kernel gives another radiance than the one that users run");
    }
  }
  if (count.truncated != 0 || count.majorant_violations != 0) {
    ++report.failed;
    report.failures.push_back(name + ": paths were cut off or bounds violated");
  }
  return report;
}

CheckReport check_random_scene(uint64_t seed, int paths) {
  const RandomSettings random = random_settings(seed);
  PathSettings settings;
  settings.frame_seed = frame_seed(seed, 0);
  settings.features = random.features;
  settings.plan = random.plan;
  return check_scene(random_scene(seed), settings, random.force_effects, paths,
                     fmt::format("scene {}{}{}", seed, random.name, random.force_effects ? " (all techniques)" : ""));
}

std::string describe(const CheckReport& r) {
  std::string text = fmt::format(
      "{} contributions ({} met, {} from the surroundings, {} at collisions, {} of segments, {} light samples, {} equiangular, {} samples "
      "of "
      "emission), {} of which several techniques could have made, {} values in closed form, {} steps; {} too near a threshold\n"
      "largest deviations: weight {:.2g}, sum of weights {:.2g}, density {:.2g}, value {:.2g}; {:.2g} of what rounding allows; {} failed, "
      "{} of them weights\n",
      r.total(), r.contributions[0], r.contributions[1], r.contributions[2], r.contributions[3], r.contributions[4], r.contributions[5],
      r.contributions[6], r.with_several, r.exact_values, r.steps, r.too_near, r.weight_deviation, r.sum_deviation, r.density_deviation,
      r.value_deviation, r.worst, r.failed, r.failed_weights);
  for (const std::string& failure : r.failures) text += failure + "\n";
  return text;
}

}  // namespace woodcock::testing
