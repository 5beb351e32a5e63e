// Work in parts that threads take one after the other.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>

namespace woodcock {

/// CPU time of the calling thread, in seconds.
double thread_cpu_seconds();

/// The processors of this machine, 1 at least.
int processors();

/// Calls work(i) for i < count on `threads` threads, each of which takes the next i until `work` says false or `cancel` is set; meanwhile
/// `watch`, which may set it, is called about every 100 ms by the calling thread. Returns the threads' CPU time, added up. What `work`
/// throws sets `cancel`, and is thrown again once all threads have ended.
double run_units(
    size_t count, int threads, std::atomic<bool>& cancel, const std::function<bool(size_t)>& work,
    const std::function<void()>& watch = [] {});

}  // namespace woodcock
