// A kernel of the path loop that records: built here only, with every effect.
#pragma once

#include "renderer/transport/path_record.h"
#include "renderer/transport/render_plan.h"

namespace woodcock::testing {

/// Like trace_path(), and what happened in `record`.
PathResult record_path(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count, PathRecord& record);

}  // namespace woodcock::testing
