#include "client/sweep_service.h"

#include <fmt/format.h>

#include <stdexcept>

#include "client/fetch_frames.h"
#include "client/job_view.h"
#include "client/policy_options.h"
#include "client/submission.h"
#include "client/watch_job.h"

namespace woodcock {

ServiceSweep::ServiceSweep(const SweepOptions& options, const ServiceOptions& service) : options_(options), service_(service) {}

void ServiceSweep::submit(const SweepRun& run, const SweepStore& store, RunRecord& record) {
  Submission submission;
  FrameSettings settings = run.settings;
  settings.samples = run.samples;
  submission.request.set_request_id(random_request_id());
  submission.request.set_name("sweep " + run.id);
  submission.request.mutable_policy()->set_user(login_name());
  add_frame(options_.scene, settings, 0, submission);
  upload_missing(service_, submission, true);
  v1::SubmitJobResponse response;
  service_.call(&v1::JobsService::Stub::SubmitJob, submission.request, response, "submitting " + run.id);
  record.job = response.job_id();
  store.save(run.id, record);
}

void ServiceSweep::begin(const SweepRun& run, const SweepStore& store, RunRecord& record) {
  if (!record.job.empty()) {
    try {
      v1::ExtendJobRequest request;
      request.set_job_id(record.job);
      request.set_samples(run.samples);
      v1::ExtendJobResponse response;
      service_.call(&v1::JobsService::Stub::ExtendJob, request, response, "extending " + run.id);
      return;
    } catch (const rpc::RpcError& error) {
      // A job that is gone, or has ended badly, is submitted again: what was rendered is known by its key.
      if (error.code() != rpc::Code::kNotFound && error.code() != rpc::Code::kFailedPrecondition) throw;
    }
  }
  submit(run, store, record);
}

bool ServiceSweep::finish(const SweepRun& run, const SweepStore& store, RunRecord& record, const MeasurePicture& measure) {
  const auto job = watch_job(service_, record.job, [](const v1::WatchJobResponse&) {});
  if (!job) return false;
  if (job->state() != v1::JOB_STATE_DONE)
    throw std::runtime_error(fmt::format("job {} of {} is {}: {}", record.job, run.id, state_name(job->state()), job->state_reason()));
  v1::GetFrameRequest request;
  request.set_job_id(record.job);
  v1::GetFrameResponse response;
  service_.call(&v1::JobsService::Stub::GetFrame, request, response, "asking for the picture of " + run.id, std::chrono::minutes(10));
  const std::string name = picture_name(run, run.samples);
  download_frame(service_, response.image_digest(), store.picture(name));
  record.cpu_seconds = job->progress().result_seconds();
  add_point(run, store, record, name, measure);
  return true;
}

}  // namespace woodcock
