// The client's side of the service: where the coordinator is, and its calls with deadlines.
#pragma once

#include <grpcpp/client_context.h>
#include <CLI/CLI.hpp>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "rpc/channel.h"
#include "rpc/limits.h"
#include "rpc/status.h"
#include "rpc/text_fields.h"
#include "woodcock/v1/blobs_service.grpc.pb.h"
#include "woodcock/v1/jobs_service.grpc.pb.h"

namespace woodcock {

struct ServiceOptions {
  std::string coordinator = rpc::kDefaultAddress;
};

/// Adds --coordinator, which WOODCOCK_COORDINATOR presets.
void add_service_options(CLI::App& command, ServiceOptions& options);

/// Why a text of the command line cannot be a job's id; empty where it may be one.
std::string problem_of_job_id(const std::string& text);

/// A connected coordinator.
class Service {
 public:
  /// Throws rpc::RpcError with a sentence for the user when nobody answers within 3 s.
  explicit Service(const ServiceOptions& options);

  /// From now on calls wait for the coordinator as long as it is away, until the user interrupts: for who waits for a job anyway.
  void wait_for_ever() { patience_ = std::chrono::hours(24 * 365); }
  std::chrono::seconds patience() const { return patience_; }

  v1::JobsService::Stub& jobs() { return *jobs_; }
  v1::BlobsService::Stub& blobs() { return *blobs_; }
  const std::string& address() const { return address_; }

  /// A job with its frames. Throws rpc::RpcError.
  v1::Job job(const std::string& job_id);

  /// One call of JobsService that answers at once, e.g. call(&v1::JobsService::Stub::PauseJob, request, response, "pausing").
  /// Repeats it for 30 s, or as wait_for_ever() says, while the coordinator is away: all of them are idempotent. Throws rpc::RpcError.
  template <typename Method, typename Request, typename Response>
  void call(Method method, const Request& request, Response& response, const std::string& what,
            std::chrono::milliseconds deadline = rpc::kCallDeadline) {
    rpc::check_text_fields(request);
    repeat(
        [&] {
          grpc::ClientContext context;
          rpc::set_deadline(context, deadline);
          return (jobs_.get()->*method)(&context, request, &response);
        },
        what);
  }

  /// Every item of a list that comes in pages, e.g. list(&v1::JobsService::Stub::ListJobs, v1::ListJobsRequest(),
  /// &v1::ListJobsResponse::jobs, "listing the jobs"). Throws rpc::RpcError.
  template <typename Request, typename Response, typename Item>
  std::vector<Item> list(grpc::Status (v1::JobsService::Stub::*method)(grpc::ClientContext*, const Request&, Response*), Request request,
                         const google::protobuf::RepeatedPtrField<Item>& (Response::*items)() const, const std::string& what) {
    constexpr int kPage = 1000;
    std::vector<Item> all;
    request.set_page_size(kPage);
    do {
      Response response;
      call(method, request, response, what);
      all.insert(all.end(), (response.*items)().begin(), (response.*items)().end());
      request.set_page_token(response.next_page_token());
    } while (!request.page_token().empty());
    return all;
  }

 private:
  void repeat(const std::function<grpc::Status()>& attempt, const std::string& what);

  std::string address_;
  std::chrono::seconds patience_{30};
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::JobsService::Stub> jobs_;
  std::unique_ptr<v1::BlobsService::Stub> blobs_;
};

}  // namespace woodcock
