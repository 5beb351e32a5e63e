// The rendering of a sweep in this process.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <string>

#include "client/sweep_plan.h"
#include "client/sweep_store.h"
#include "renderer/frame/frame_renderer.h"

namespace woodcock {

/// The relative MSE of a node file against the reference it belongs to; nothing where it has none.
using MeasurePicture = std::function<std::optional<double>(const std::filesystem::path& exr)>;

/// Renders the runs of a sweep, and keeps the compiled scene of each curve for its next run.
class LocalSweep {
 public:
  /// `tick` is called while it renders with the samples (of pixels) rendered since the last call.
  LocalSweep(const SweepOptions& options, int threads, const std::atomic<bool>& stop, std::function<void(uint64_t samples)> tick);

  /// The frame of a curve, compiled where it has not been. Throws what FrameRenderer throws.
  const FrameRenderer& frame(const std::string& curve, const FrameSettings& settings);

  /// Goes on with the run from what `record` holds, renders only what is missing, and saves the record. When `stop` becomes
  /// true the samples that are finished are saved and the answer is false. Throws FilmError where the record's node file
  /// is not of this frame.
  bool advance(const SweepRun& run, const SweepStore& store, RunRecord& record, const MeasurePicture& measure);

 private:
  const SweepOptions& options_;
  int threads_;
  const std::atomic<bool>& stop_;
  std::function<void(uint64_t)> tick_;
  std::map<std::string, FrameRenderer> frames_;
};

/// Puts a new node file of a run in the place of the old one: its record then names `name`, which must be durable, and
/// the old file goes unless it is the picture of a point.
void replace_nodes(const SweepRun& run, const SweepStore& store, RunRecord& record, const std::string& name);

/// The name of a run's node file of so many samples.
std::string nodes_name(const SweepRun& run, int64_t samples);

}  // namespace woodcock
