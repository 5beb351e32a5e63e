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

/// The relative MSE of a picture against the reference it belongs to; nothing where it has none.
using MeasurePicture = std::function<std::optional<double>(const std::filesystem::path& exr)>;

/// Who renders the runs.
class SweepEngine {
 public:
  virtual ~SweepEngine() = default;

  /// Called for several runs before the first of them is finished.
  virtual void begin(const SweepRun& run, const SweepStore& store, RunRecord& record) = 0;
  /// Brings the run to its samples from what `record` holds, renders only what is missing, and saves the record with the new
  /// point. False when interrupted: what is finished is saved. Throws FilmError and std::runtime_error.
  virtual bool finish(const SweepRun& run, const SweepStore& store, RunRecord& record, const MeasurePicture& measure) = 0;
};

/// Renders in this process, and keeps the compiled scene of each curve for its next run.
class LocalSweep : public SweepEngine {
 public:
  /// `tick` is called while it renders with the samples (of pixels) rendered since the last call.
  LocalSweep(const SweepOptions& options, int threads, const std::atomic<bool>& stop, std::function<void(uint64_t samples)> tick);

  /// The frame of a curve, compiled where it has not been. Throws what FrameRenderer throws.
  const FrameRenderer& frame(const std::string& curve, const FrameSettings& settings);

  void begin(const SweepRun&, const SweepStore&, RunRecord&) override {}
  bool finish(const SweepRun& run, const SweepStore& store, RunRecord& record, const MeasurePicture& measure) override;

 private:
  const SweepOptions& options_;
  int threads_;
  const std::atomic<bool>& stop_;
  std::function<void(uint64_t)> tick_;
  std::map<std::string, FrameRenderer> frames_;
};

/// Puts the picture `name`, which must be durable with its nodes, in the place of the run's old one, and saves the record; the old
/// files go unless they are the picture of a point.
void replace_nodes(const SweepRun& run, const SweepStore& store, RunRecord& record, const std::string& name);

/// The same for a run that has reached its samples: the picture is measured and becomes a point of the record.
void add_point(const SweepRun& run, const SweepStore& store, RunRecord& record, const std::string& name, const MeasurePicture& measure);

/// The name of a run's picture of so many samples.
std::string picture_name(const SweepRun& run, int64_t samples);

}  // namespace woodcock
