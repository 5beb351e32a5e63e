#include "client/service.h"

#include <fmt/format.h>

#include <chrono>
#include <thread>

#include "client/interrupt.h"
#include "rpc/address.h"

namespace woodcock {
namespace {

constexpr std::chrono::seconds kConnect{3};

}  // namespace

void add_service_options(CLI::App& command, ServiceOptions& options) {
  command.add_option("--coordinator", options.coordinator, "HOST:PORT of the coordinator")
      ->envname("WOODCOCK_COORDINATOR")
      ->check(rpc::problem_of_address)
      ->capture_default_str();
}

std::string problem_of_job_id(const std::string& text) {
  return text.empty() ? "found an empty text, expected a job's id, as `woodcock submit` or `woodcock jobs` prints it" : "";
}

Service::Service(const ServiceOptions& options) : address_(options.coordinator), channel_(rpc::make_channel(options.coordinator)) {
  if (!channel_->WaitForConnected(std::chrono::system_clock::now() + kConnect))
    throw rpc::RpcError(rpc::Code::kUnavailable,
                        fmt::format("no coordinator answers at {}: start one with `woodcock up`, or say where it is with --coordinator or "
                                    "WOODCOCK_COORDINATOR",
                                    address_));
  jobs_ = v1::JobsService::NewStub(channel_);
  blobs_ = v1::BlobsService::NewStub(channel_);
}

void Service::repeat(const std::function<grpc::Status()>& attempt, const std::string& what) {
  const auto deadline = std::chrono::steady_clock::now() + patience_;
  while (true) {
    const grpc::Status status = attempt();
    if (status.error_code() != grpc::StatusCode::UNAVAILABLE || std::chrono::steady_clock::now() > deadline || interrupt_flag())
      return rpc::throw_if_failed(status, what);
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
  }
}

v1::Job Service::job(const std::string& job_id) {
  v1::GetJobRequest request;
  request.set_job_id(job_id);
  v1::GetJobResponse response;
  call(&v1::JobsService::Stub::GetJob, request, response, "asking for job " + job_id);
  return response.job();
}

}  // namespace woodcock
