// How the parts of Coordinator run under its mutex.
#pragma once

#include <spdlog/spdlog.h>

#include "coordinator/coordinator.h"
#include "rpc/failure.h"

namespace woodcock::coordinator {

/// Runs `work` with the mutex held, then carries out what the scheduler wants, and answers held calls after unlocking.
template <typename Work>
auto Coordinator::locked(Work work) {
  Completions completions;
  struct RunLast {
    Completions& completions;
    ~RunLast() {
      for (auto& completion : completions)
        if (const auto error = rpc::failure_of(completion)) spdlog::error("answering a worker failed: {}", *error);
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
