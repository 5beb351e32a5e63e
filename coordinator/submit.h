// A SubmitJob request, checked and turned into a job.
#pragma once

#include "coordinator/blob_store.h"
#include "coordinator/model.h"
#include "woodcock/v1/jobs_service.pb.h"

namespace woodcock::coordinator {

/// Cuts the one round of a job: at 16, 32 and 64 samples, so that the error of so many is known later, unless that makes too many
/// tasks; then chooses the length of its tasks. Throws RpcError RESOURCE_EXHAUSTED where no length is enough.
void cut_rounds(JobSpec& job);

/// Refuses so many samples of so many pixels, of all frames, where counters would overflow: INVALID_ARGUMENT.
void check_sample_total(double pixels, int64_t samples, const char* field);

/// The time limit that a request asks for; none for 0. Throws RpcError INVALID_ARGUMENT.
std::optional<double> checked_seconds(double seconds);

/// The target that an ExtendJob asks for: 0 samples and no error leave these as they are; no error at all is right for a job that is
/// `limited` in time only. Throws RpcError INVALID_ARGUMENT for fewer samples or a larger error than the job has.
SamplingTarget extended_target(const JobSpec& job, int64_t samples, std::optional<double> error, bool limited);

/// Checks every field and that every blob is there, pins them, and holds them in `hold`. Throws RpcError: INVALID_ARGUMENT,
/// FAILED_PRECONDITION naming missing blobs, RESOURCE_EXHAUSTED for too many tasks.
JobSpec check_submit(const v1::SubmitJobRequest& request, BlobStore& blobs, BlobStore::Hold& hold, Time now, int64_t unix_ms);

}  // namespace woodcock::coordinator
