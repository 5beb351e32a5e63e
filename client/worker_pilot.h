// What a frame's samples cost on the workers of a coordinator, measured by them.
#pragma once

#include <cstdint>
#include <vector>

#include "client/service.h"
#include "client/submission.h"
#include "client/worker_times.h"

namespace woodcock {

struct WorkerPilotOptions {
  int64_t samples = 64;  ///< a power of two: of every pixel
  int tile = 64;         ///< edge in pixels, made smaller where workers would get too few
  double wait_seconds = 300;
  bool quiet = false;  ///< no progress
};

/// The workers that are ready. Waits 10 s for one; then, or on Ctrl-C, throws NoQuote.
std::vector<v1::WorkerStatus> ready_workers(Service& service);

/// Lets the workers render few samples of the first frame of `submission`, as a job of its own whose results later jobs find. A job that
/// takes longer than `wait_seconds` is cancelled, and so by Ctrl-C. Throws NoQuote and rpc::RpcError.
WorkerTimes measure_workers(Service& service, const Submission& submission, const WorkerPilotOptions& options);

}  // namespace woodcock
