#include "tests/transport/weights/recorded_path.h"

#include "renderer/transport/kernel_group.h"

namespace woodcock::testing {

PathResult record_path(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count, PathRecord& record) {
  ++count.paths;
  PathKernel<kAllEffects | kRecorded> kernel(world, plan, ray, key, count);
  record.clear();
  kernel.record(record);
  return kernel.run();
}

}  // namespace woodcock::testing
