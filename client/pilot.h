// A short render that tells what a long one will cost.
#pragma once

#include <atomic>
#include <functional>
#include <optional>

#include "renderer/accuracy/cost_model.h"
#include "renderer/frame/frame_renderer.h"

namespace woodcock {

struct PilotOptions {
  double max_cpu_seconds = 20;
  std::optional<double> error;  ///< what is to be quoted: the pilot ends when it knows that to 6 %, or has reached it
  int threads = 1;
};

/// Renders the samples [0, n) of all pixels, or, where 64 samples of them would take more than half of the time, of blocks of 8 × 8
/// pixels chosen by a hash of their place: at least 64 of them. n grows until it is 64 and an eighth of what is quoted, and what
/// is asked is known, or the time is over. The clock starts after the first 4 samples: they also warm the caches. `stop` ends it
/// early.
Pilot run_pilot(const FrameRenderer& frame, const PilotOptions& options, const std::atomic<bool>& stop);

}  // namespace woodcock
