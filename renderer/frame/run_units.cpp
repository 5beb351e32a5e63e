#include "renderer/frame/run_units.h"

#include <time.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace woodcock {

double thread_cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

int processors() { return static_cast<int>(std::max(1u, std::thread::hardware_concurrency())); }

double run_units(size_t count, int threads, std::atomic<bool>& cancel, const std::function<bool(size_t)>& work,
                 const std::function<void()>& watch) {
  std::atomic<size_t> next{0};
  std::mutex mutex;
  std::condition_variable finished;
  int running = threads;
  double cpu_seconds = 0;
  std::exception_ptr failure;
  const auto run = [&] {
    const double start = thread_cpu_seconds();
    try {
      for (size_t i = next++; i < count && !cancel && work(i); i = next++) {
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      failure = std::current_exception();
      cancel = true;
    }
    const std::lock_guard lock(mutex);
    cpu_seconds += thread_cpu_seconds() - start;
    --running;
    finished.notify_all();
  };
  std::vector<std::thread> workers;
  for (int i = 0; i < threads; ++i) workers.emplace_back(run);
  {
    std::unique_lock lock(mutex);
    while (!finished.wait_for(lock, std::chrono::milliseconds(100), [&] { return running == 0; })) watch();
  }
  for (std::thread& worker : workers) worker.join();
  if (failure) std::rethrow_exception(failure);
  return cpu_seconds;
}

}  // namespace woodcock
