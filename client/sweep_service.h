// The rendering of a sweep by the workers of a coordinator.
#pragma once

#include <string>

#include "client/service.h"
#include "client/sweep_run.h"

namespace woodcock {

/// Each run is a job, which grows by `extend`: the coordinator leases the difference only, and a result that any job has
/// rendered already is not rendered again. CPU time is that of the workers for the job's samples.
class ServiceSweep : public SweepEngine {
 public:
  /// Throws rpc::RpcError when the coordinator does not answer.
  ServiceSweep(const SweepOptions& options, const ServiceOptions& service);

  /// Submits or extends the run's job, so that many are rendered at once.
  void begin(const SweepRun& run, const SweepStore& store, RunRecord& record) override;
  /// Waits for the job and fetches its node file. False when interrupted; the job goes on and is found again later. Throws
  /// std::runtime_error where the job fails.
  bool finish(const SweepRun& run, const SweepStore& store, RunRecord& record, const MeasurePicture& measure) override;

 private:
  void submit(const SweepRun& run, const SweepStore& store, RunRecord& record);

  const SweepOptions& options_;
  Service service_;
};

}  // namespace woodcock
