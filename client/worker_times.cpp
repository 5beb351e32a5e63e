#include "client/worker_times.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace woodcock {
namespace {

/// Workers differ where their times do by more than this and by more than three standard errors.
constexpr double kDifference = 0.1;

}  // namespace

std::vector<MeasuredWorker> by_worker(const std::vector<v1::WorkerStatus>& present, const std::vector<v1::TaskResult>& results) {
  std::map<std::string, MeasuredWorker> workers;
  for (const v1::WorkerStatus& status : present) {
    MeasuredWorker& worker = workers[status.worker_id()];
    worker.threads = render_threads(status);
    worker.per_task = status.threads();
  }
  std::map<std::string, double> squares;  // of the tasks' rates, weighted by their paths
  for (const v1::TaskResult& result : results) {
    // A cost that was not kept is none to go by.
    if (result.cpu_ns() <= 0 || result.samples() <= 0) continue;
    MeasuredWorker& worker = workers[result.worker_id()];
    const double cpu = static_cast<double>(result.cpu_ns()) * 1e-9, paths = static_cast<double>(result.samples());
    ++worker.tasks;
    worker.paths += paths;
    worker.cpu_seconds += cpu;
    worker.wall_seconds += static_cast<double>(result.wall_ns()) * 1e-9;
    squares[result.worker_id()] += cpu * cpu / paths;
  }
  std::vector<MeasuredWorker> list;
  for (auto& [id, worker] : workers) {
    worker.worker_id = id;
    if (worker.tasks > 1) {
      const double rate = worker.cpu_seconds / worker.paths, n = static_cast<double>(worker.tasks);
      worker.deviation = std::sqrt(std::max(0.0, squares[id] / worker.paths - rate * rate) * n / (n - 1));
    }
    list.push_back(worker);
  }
  return list;
}

WorkerTimes judge_workers(const std::vector<MeasuredWorker>& workers) {
  WorkerTimes times;
  double paths = 0, wall = 0, measured_cpu = 0;
  int64_t measured_threads = 0, measured = 0;
  for (const MeasuredWorker& worker : workers) {
    paths += worker.paths;
    times.cpu_seconds += worker.cpu_seconds;
    if (worker.threads == 0) continue;
    ++times.workers;
    times.threads += worker.threads;
    if (worker.tasks == 0) continue;
    ++measured;
    measured_threads += worker.threads;
    measured_cpu += worker.cpu_seconds;
    wall += worker.wall_seconds * static_cast<double>(worker.per_task);
  }
  if (times.cpu_seconds <= 0 || times.threads == 0)
    throw NoQuote("no quote: the results were there already, and what they cost was not kept; quote for this machine");
  const double mean = times.cpu_seconds / paths;
  times.seconds_per_path = mean;
  if (measured_cpu > 0) times.stretch = std::max(1.0, wall / measured_cpu);

  double between = 0, lowest = mean, highest = mean, speed = 0, tasks = 0;
  bool differ = false;
  for (const MeasuredWorker& worker : workers) {
    if (worker.tasks == 0) continue;
    const double rate = worker.cpu_seconds / worker.paths, off = std::abs(rate - mean);
    between += worker.paths * off * off;
    tasks += static_cast<double>(worker.tasks);
    if (worker.threads == 0) continue;
    speed += static_cast<double>(worker.threads) / rate;
    lowest = std::min(lowest, rate);
    highest = std::max(highest, rate);
    // Parts of the picture cost more than others, which says nothing about the worker; one task alone has no scatter to judge by.
    const double by_chance = worker.deviation / std::sqrt(static_cast<double>(worker.tasks));
    differ = differ || (worker.tasks > 1 && off > kDifference * mean && off > 3 * by_chance);
  }
  // All of the picture was measured: what remains is that the workers may share the tasks in another way next time, by about one each.
  times.deviation = std::sqrt(between / paths) / mean / (tasks / static_cast<double>(std::max<int64_t>(1, measured)));
  if (differ) {
    // Each takes tasks as fast as it is: shares of threads/rate, whose mean rate is this.
    times.seconds_per_path = static_cast<double>(measured_threads) / speed;
    times.deviation = std::max(times.deviation, (highest - lowest) / (4 * mean));
    times.doubt = fmt::format("the workers differ, from {:.3g} to {:.3g} µs of CPU time a sample: what a job costs depends on who takes it",
                              1e6 * lowest, 1e6 * highest);
  } else if (2 * measured_threads < times.threads) {
    times.doubt = fmt::format("only {} of the {} workers was measured", measured, times.workers);
  }
  return times;
}

int64_t render_threads(const v1::WorkerStatus& worker) { return int64_t{worker.slots()} * worker.threads(); }

}  // namespace woodcock
