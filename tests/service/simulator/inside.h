// What a coordinator hides, for the checks.
#pragma once

#include "coordinator/coordinator.h"

namespace woodcock::coordinator {

/// Only of a coordinator without threads of its own, between its steps.
class CoordinatorInside {
 public:
  static const Scheduler& scheduler(const Coordinator& coordinator) { return *coordinator.scheduler_; }
  static Store& store(Coordinator& coordinator) { return *coordinator.store_; }
  /// Whether frames wait for their merge.
  static bool merges(const Coordinator& coordinator) { return !coordinator.to_assemble_.empty(); }
};

}  // namespace woodcock::coordinator
