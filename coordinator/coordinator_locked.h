// How the parts of Coordinator run under its mutex.
#pragma once

#include "coordinator/coordinator.h"

namespace woodcock::coordinator {

/// Runs `work` with the mutex held, then carries out what the scheduler wants, and answers held calls after unlocking.
template <typename Work>
auto Coordinator::locked(Work work) {
  Completions completions;
  struct RunLast {
    Completions& completions;
    ~RunLast() {
      for (auto& completion : completions) completion();
    }
  };
  const RunLast run_last{completions};
  const std::lock_guard lock(mutex_);
  if constexpr (std::is_void_v<decltype(work())>) {
    work();
    completions = pump();
  } else {
    auto result = work();
    completions = pump();
    return result;
  }
}

}  // namespace woodcock::coordinator
