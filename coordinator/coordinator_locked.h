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

template <typename Work>
void Coordinator::wake(const std::string& id, Work work) {
  const std::lock_guard one_at_a_time(wake_mutex_);
  for (bool done = false; !done;) {
    bool here = false;
    uint64_t seen = 0;
    {
      const std::lock_guard lock(mutex_);
      here = scheduler_->find(id) != nullptr;
      const std::lock_guard stored_lock(last_stored_mutex_);
      seen = woken_;
    }
    // What was written before it went is read: the database works in order.
    std::optional<Job> job;
    if (!here) job = stored_with_tasks(id);
    done = locked([&] {
      if (!scheduler_->find(id)) {
        if (!job) return false;  // it went meanwhile
        {
          const std::lock_guard stored_lock(last_stored_mutex_);
          if (woken_ != seen) return false;  // the database has numbered an event of a job meanwhile, perhaps of this one
        }
        forget_stored();
        scheduler_->recover_job(std::move(*job), {}, options_.now());
      }
      scheduler_->release_if_ended(id);  // unless `work` makes it run
      work(must_find(id));
      return true;
    });
  }
}

template <typename Work>
void Coordinator::while_running(const std::string& id, Work work) {
  const bool here = locked([&] {
    const Job* job = scheduler_->find(id);
    if (job) work(*job);
    return job != nullptr;
  });
  if (here) return;
  const std::optional<StoredJob> row = store_->look([&](StoreSession& session) { return session.find_job(id); });
  if (!row) fail_no_job(id);
  rpc::fail_precondition("job " + id + " has ended: " + to_string(row->row.state));
}

}  // namespace woodcock::coordinator
