#include "renderer/transport/path.h"

#include "renderer/transport/render_plan.h"

namespace woodcock {

PathResult trace_path(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count) {
  return plan.kernel(world, plan, ray, key, count);
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
