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

/// A random scene or another, compiled, and what runs its paths.
struct CheckedScene {
  SceneDescription description;
  std::unique_ptr<const World> world;
  PathSettings settings;
  SceneFormulas formulas;
  PathCounters count{};

  CheckedScene(const std::string& text, const PathSettings& given, bool force_effects)
      : description(read_scene_text(text, "random.pbrt", ".", {})),
        world(build(description, force_effects)),
        settings(given),
        formulas(description, *world) {
    settings.max_depth = description.settings.max_depth;
  }

  static std::unique_ptr<const World> build(const SceneDescription& description, bool force_effects) {
    std::unique_ptr<const World> world = build_world(description);
    // build_world() makes an object that is not const.
    if (force_effects) const_cast<World&>(*world).effects |= possible_effects(*world);
    return world;
  }

  struct Start {
    PathKey key;
    Ray ray;
  };
  /// Paths are spread over the pixels.
  Start start(int path) const {
    const int width = description.film.x_resolution, height = description.film.y_resolution;
    const int pixel = static_cast<int>((static_cast<int64_t>(path) * 97) % (width * height)), x = pixel % width, y = pixel / width;
    const PathKey key = path_key(settings.frame_seed, static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint64_t>(path), 0,
                                 settings.features.has(Feature::kSobol));
    return {key, camera_sample(*world, key, x, y).ray};
  }

  PathResult record(int path, PathRecord& record) {
    const Start s = start(path);
    return record_path(*world, {*world, settings}, s.ray, s.key, count, record);
  }
};

PathSettings path_settings(const RandomSettings& random, uint64_t seed) {
  PathSettings settings;
  settings.frame_seed = frame_seed(seed, 0);
  settings.features = random.features;
  settings.plan = random.plan;
  settings.splits = 1u << seed % 4;
  return settings;
}

}  // namespace

CheckReport check_scene(const std::string& text, PathSettings settings, bool force_effects, int paths, const std::string& name) {
  CheckedScene scene(text, settings, force_effects);
  PathCheck check(scene.formulas, scene.settings, scene.world->effects);
  CheckReport report;
  PathCounters shipped_count;
  PathRecord record;
  for (int i = 0; i < paths; ++i) {
    const PathResult result = scene.record(i, record);
    const std::string path_name = fmt::format("{}, path {}", name, i);
    check.check(record, path_name, report);
    if (i % 16 != 0) continue;
    // What is recorded is what is rendered.
    const CheckedScene::Start start = scene.start(i);
    if (trace_path(*scene.world, {*scene.world, scene.settings}, start.ray, start.key, shipped_count).radiance == result.radiance) continue;
    ++report.failed;
    report.failures.push_back(path_name + ": the recording kernel gives another radiance than the one that users run");
  }
  if (scene.count.truncated != 0 || scene.count.majorant_violations != 0) {
    ++report.failed;
    report.failures.push_back(name + ": paths were cut off or bounds violated");
  }
  return report;
}

Tampering check_tampered_scene(uint64_t seed, int paths) {
  const RandomSettings random = random_settings(seed);
  CheckedScene scene(random_scene(seed), path_settings(random, seed), random.force_effects);
  PathCheck check(scene.formulas, scene.settings, scene.world->effects);
  Tampering result;
  PathRecord record;
  constexpr double kWrong = 1 - 1.0 / 500;
  for (int i = 0; i < paths; ++i) {
    scene.record(i, record);
    CheckReport right;
    check.check(record, "as it was", right);
    int kind = i;
    for (PathEvent& event : record) {
      auto* added = std::get_if<LightAdded>(&event);
      if (added == nullptr || added->weight == 0 || added->technique == Technique::kSegment) continue;
      const LightAdded was = *added;
      ++kind;
      if (kind % 3 == 0) added->weight *= kWrong;
      if (kind % 3 == 1) (added->density > 0 ? added->density : added->weight) *= kWrong;
      if (kind % 3 == 2) added->added *= kWrong;
      CheckReport wrong;
      check.check(record, "changed", wrong);
      ++result.changed;
      result.noticed += wrong.failed > right.failed;
      *added = was;
    }
  }
  return result;
}

CheckReport check_random_scene(uint64_t seed, int paths) {
  const RandomSettings random = random_settings(seed);
  return check_scene(random_scene(seed), path_settings(random, seed), random.force_effects, paths,
                     fmt::format("scene {}{}{}", seed, random.name, random.force_effects ? " (all techniques)" : ""));
}

std::string describe(const CheckReport& r) {
  std::string text = fmt::format(
      "{} contributions ({} met, {} from the surroundings, {} at collisions, {} of segments, {} light samples, {} equiangular, {} samples "
      "of "
      "emission, {} samples through glass), {} of which several techniques could have made, {} values in closed form, {} light samples "
      "that branches could have made, {} "
      "vertices of branches, {} light samples after a roulette, {} steps; {} too "
      "near a threshold\n"
      "largest deviations: weight {:.2g}, sum of weights {:.2g}, density {:.2g}, value {:.2g}; {:.2g} of what rounding allows; {} failed, "
      "{} of them weights\n",
      r.total(), r.contributions[0], r.contributions[1], r.contributions[2], r.contributions[3], r.contributions[4], r.contributions[5],
      r.contributions[6], r.contributions[7], r.with_several, r.exact_values, r.shared, r.branches, r.light_roulettes, r.steps, r.too_near,
      r.weight_deviation, r.sum_deviation, r.density_deviation, r.value_deviation, r.worst, r.failed, r.failed_weights);
  for (const std::string& failure : r.failures) text += failure + "\n";
  return text;
}

}  // namespace woodcock::testing
