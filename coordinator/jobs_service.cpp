#include "coordinator/services.h"
#include "rpc/status.h"

namespace woodcock::coordinator {
namespace {

template <typename Work>
grpc::Status answer(Work work) {
  try {
    work();
    return grpc::Status::OK;
  } catch (...) {
    return rpc::status_of_current_exception();
  }
}

}  // namespace

Admission::Ticket::Ticket(Admission& admission, const char* what) : admission_(admission) {
  if (--admission.free_ >= 0) return;
  ++admission.free_;
  rpc::fail_exhausted(std::string("too many ") + what + " at once; try again later");
}

grpc::Status JobsService::SubmitJob(grpc::ServerContext*, const v1::SubmitJobRequest* request, v1::SubmitJobResponse* response) {
  return answer([&] { *response = coordinator_.submit(*request); });
}
grpc::Status JobsService::GetJob(grpc::ServerContext*, const v1::GetJobRequest* request, v1::GetJobResponse* response) {
  return answer([&] { *response->mutable_job() = coordinator_.job(request->job_id()); });
}
grpc::Status JobsService::ListJobs(grpc::ServerContext*, const v1::ListJobsRequest* request, v1::ListJobsResponse* response) {
  return answer([&] { *response = coordinator_.list(request->page_size(), request->page_token()); });
}
grpc::Status JobsService::CancelJob(grpc::ServerContext*, const v1::CancelJobRequest* request, v1::CancelJobResponse* response) {
  return answer([&] { *response->mutable_job() = coordinator_.cancel(request->job_id()); });
}
grpc::Status JobsService::PauseJob(grpc::ServerContext*, const v1::PauseJobRequest* request, v1::PauseJobResponse* response) {
  return answer([&] { *response->mutable_job() = coordinator_.set_paused(request->job_id(), true); });
}
grpc::Status JobsService::ResumeJob(grpc::ServerContext*, const v1::ResumeJobRequest* request, v1::ResumeJobResponse* response) {
  return answer([&] { *response->mutable_job() = coordinator_.set_paused(request->job_id(), false); });
}
grpc::Status JobsService::ExtendJob(grpc::ServerContext*, const v1::ExtendJobRequest* request, v1::ExtendJobResponse* response) {
  return answer([&] {
    *response->mutable_job() =
        coordinator_.extend(request->job_id(), request->samples(),
                            request->has_target_error() ? std::optional(request->target_error()) : std::nullopt, request->max_seconds());
  });
}
grpc::Status JobsService::RepinJob(grpc::ServerContext*, const v1::RepinJobRequest* request, v1::RepinJobResponse* response) {
  return answer([&] { *response = coordinator_.repin(request->job_id()); });
}
grpc::Status JobsService::ListResults(grpc::ServerContext*, const v1::ListResultsRequest* request, v1::ListResultsResponse* response) {
  return answer([&] { *response = coordinator_.results(request->job_id(), request->page_size(), request->page_token()); });
}
grpc::Status JobsService::ListWorkers(grpc::ServerContext*, const v1::ListWorkersRequest* request, v1::ListWorkersResponse* response) {
  return answer([&] { *response = coordinator_.list_workers(request->page_size(), request->page_token()); });
}
grpc::Status JobsService::DeleteJob(grpc::ServerContext*, const v1::DeleteJobRequest* request, v1::DeleteJobResponse*) {
  return answer([&] { coordinator_.remove(request->job_id(), request->cancel()); });
}
grpc::Status JobsService::ListEvents(grpc::ServerContext*, const v1::ListEventsRequest* request, v1::ListEventsResponse* response) {
  return answer([&] { *response = coordinator_.events(request->job_id(), request->page_size(), request->page_token()); });
}
grpc::Status JobsService::RetainJobs(grpc::ServerContext*, const v1::RetainJobsRequest* request, v1::RetainJobsResponse* response) {
  return answer([&] {
    const Admission::Ticket ticket(retentions_, "questions about retention");
    *response = coordinator_.retain(*request);
  });
}
grpc::Status JobsService::GetFrame(grpc::ServerContext*, const v1::GetFrameRequest* request, v1::GetFrameResponse* response) {
  return answer([&] {
    // An image that is there waits for nobody.
    std::optional<Admission::Ticket> ticket;
    if (request->partial()) ticket.emplace(merges_, "previews are merged");
    *response = coordinator_.frame(request->job_id(), request->frame(), request->partial());
  });
}
grpc::Status JobsService::GetTaskLog(grpc::ServerContext*, const v1::GetTaskLogRequest* request, v1::GetTaskLogResponse* response) {
  return answer([&] {
    for (v1::TaskAttempt& attempt : coordinator_.task_log(request->job_id(), request->task_id()))
      *response->add_attempts() = std::move(attempt);
  });
}

grpc::ServerWriteReactor<v1::WatchJobResponse>* JobsService::WatchJob(grpc::CallbackServerContext*, const v1::WatchJobRequest* request) {
  return watchers_.watch(*request);
}

}  // namespace woodcock::coordinator
