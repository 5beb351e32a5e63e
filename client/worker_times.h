// What a sample costs on the workers of a coordinator, from what results of theirs did cost.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "woodcock/v1/quote.pb.h"
#include "woodcock/v1/worker_status.pb.h"

namespace woodcock {

/// Nothing can be quoted; the message says why and what to do.
struct NoQuote : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct WorkerTimes {
  double seconds_per_path = 0;  ///< CPU time of one sample of one pixel, all threads together
  double deviation = 0;         ///< relative standard deviation of that, were the tasks shared in another way
  double stretch = 1;           ///< wall time of the pilot's tasks × their threads / their CPU time, at least 1
  int64_t workers = 0;          ///< ready, and of the build and class that rendered the pilot
  int64_t threads = 0;          ///< slots × threads of these
  int64_t others = 0;           ///< ready, but of another build or class
  int64_t samples = 0;          ///< of the pilot, of every pixel
  double cpu_seconds = 0;       ///< that its results had cost, also those of an earlier job
  std::string job;              ///< its id
  std::string doubt;            ///< why the times may not hold; empty otherwise
};

/// What a worker's results cost.
struct MeasuredWorker {
  std::string worker_id;
  int64_t threads = 0;   ///< slots × threads of each; 0 for one that is not connected any more
  int64_t per_task = 0;  ///< threads of a task
  double paths = 0, cpu_seconds = 0, wall_seconds = 0;
  double deviation = 0;  ///< standard deviation of CPU time a path between its tasks, weighted by paths
  int64_t tasks = 0;
};

/// Adds a job's results up by worker; `present` are the workers to count on, those without a result included.
std::vector<MeasuredWorker> by_worker(const std::vector<v1::WorkerStatus>& present, const std::vector<v1::TaskResult>& results);

/// The times that follow. Where the workers differ beyond the scatter of their tasks, each counts by the share that it takes of a job.
/// Throws NoQuote where there is no time to go by.
WorkerTimes judge_workers(const std::vector<MeasuredWorker>& workers);

/// Threads that a worker renders with at once: slots × threads of each.
int64_t render_threads(const v1::WorkerStatus& worker);

}  // namespace woodcock
