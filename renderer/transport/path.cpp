#include "renderer/transport/path.h"

#include "renderer/transport/kernels.h"

namespace woodcock {

RadianceFunction path_function(const World& world, const PathSettings& settings) {
  // Without a plan nothing is known that a smaller kernel could leave out.
  const bool full = settings.full_kernel || !settings.plan;
  return (full ? kernels().back() : smallest_kernel(active_effects(world, settings))).run;
}

PathResult trace_path(const World& world, const PathSettings& settings, Ray ray, PathKey key, PathCounters& count) {
  return path_function(world, settings)(world, settings, ray, key, count);
}

CameraSample camera_sample(const World& world, PathKey key, int x, int y) {
  Stream film = stream(key, 0, Purpose::kPixelFilter);
  const auto filtered = world.filter.sample(film.uniform2());
  Stream lens = stream(key, 0, Purpose::kLens);
  Stream time = stream(key, 0, Purpose::kTime);
  const DVec2 position = DVec2(x + 0.5, y + 0.5) + filtered.offset;
  return {world.camera.ray(position, lens.uniform2(), time.uniform()), filtered.weight};
}

}  // namespace woodcock
