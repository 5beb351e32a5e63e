#include "tests/transport/weights/recorded_path.h"

#include "renderer/transport/kernel_group.h"

namespace woodcock::testing {

PathResult record_path(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count, PathRecord& record) {
  ++count.paths;
  PathSample sample{world, plan, count};
  PathKernel<kAllEffects | kRecorded> kernel(sample, ray, key);
  record.clear();
  kernel.record(record);
  return kernel.run();
}

}  // namespace woodcock::testing
