#include "client/worker_pilot.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "client/interrupt.h"
#include "client/job_view.h"
#include "client/progress_line.h"
#include "client/workers.h"
#include "renderer/film/split.h"
#include "rpc/convert.h"

namespace woodcock {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::seconds kWorkerWait{10};
constexpr std::chrono::milliseconds kPoll{200};
/// So many tasks for each slot, that a worker which is twice as slow still gets some.
constexpr size_t kTasksPerSlot = 4;
constexpr int kMinTile = 8;

/// A job of `samples` of the first frame alone.
v1::SubmitJobRequest pilot_request(const v1::SubmitJobRequest& job, int64_t samples, int tile) {
  v1::SubmitJobRequest request = job;
  request.set_request_id(random_request_id());
  request.set_name(("quote of " + job.name()).substr(0, rpc::kMaxNameBytes));
  request.clear_target();
  request.clear_quote();
  // It is measured now.
  request.mutable_policy()->clear_after();
  request.mutable_frames()->DeleteSubrange(1, request.frames_size() - 1);
  request.mutable_settings()->set_samples(samples);
  request.mutable_settings()->set_tile_size(static_cast<uint32_t>(tile));
  return request;
}

/// Whether the worker has what a job asks for.
bool may_render(const v1::WorkerStatus& worker, const v1::JobPolicy& policy) {
  const auto has = [&](const std::string& tag) {
    return std::find(worker.tags().begin(), worker.tags().end(), tag) != worker.tags().end();
  };
  return std::all_of(policy.required_tags().begin(), policy.required_tags().end(), has) &&
         policy.memory_bytes() <= worker.memory_bytes() / std::max<int64_t>(1, worker.slots());
}

void cancel(Service& service, const std::string& job) {
  v1::CancelJobRequest request;
  request.set_job_id(job);
  v1::CancelJobResponse response;
  service.call(&v1::JobsService::Stub::CancelJob, request, response, "cancelling the quote's job " + job);
}

/// The job when it has ended well; cancels one that takes too long.
v1::Job wait_for(Service& service, const std::string& id, const WorkerPilotOptions& options) {
  const auto deadline = steady_clock::now() + std::chrono::duration<double>(options.wait_seconds);
  ProgressLine line("the workers' pilot", options.quiet);
  while (true) {
    const v1::Job job = service.job(id);
    if (job.state() == v1::JOB_STATE_DONE) return job;
    if (has_ended(job.state()))
      throw NoQuote(
          fmt::format("no quote: the workers could not render its job {}, it is {}: {}", id, state_name(job.state()), job.state_reason()));
    const double done =
        static_cast<double>(job.progress().samples_done()) / std::max(1.0, static_cast<double>(job.progress().samples_total()));
    if (interrupt_flag() || steady_clock::now() > deadline) {
      cancel(service, id);
      if (interrupt_flag()) throw NoQuote("interrupted");
      throw NoQuote(
          fmt::format("no quote: the workers had {:.0f} % of its job {} after {} s{}; it is cancelled. Give them longer "
                      "with --quote-wait, or quote for this machine",
                      100 * done, id, options.wait_seconds, job.state_reason().empty() ? "" : " (" + job.state_reason() + ")"));
    }
    line.show(done, format_count(job.progress().samples_per_second()) + "samples/s");
    std::this_thread::sleep_for(kPoll);
  }
}

std::vector<v1::TaskResult> results_of(Service& service, const std::string& job) {
  v1::ListResultsRequest request;
  request.set_job_id(job);
  return service.list(&v1::JobsService::Stub::ListResults, request, &v1::ListResultsResponse::results, "asking what job " + job + " cost");
}

}  // namespace

std::vector<v1::WorkerStatus> ready_workers(Service& service) {
  const auto deadline = steady_clock::now() + kWorkerWait;
  while (true) {
    std::vector<v1::WorkerStatus> workers = list_workers(service);
    const size_t connected = workers.size();
    std::erase_if(workers, [](const v1::WorkerStatus& w) { return w.condition() != v1::WORKER_CONDITION_READY; });
    if (!workers.empty()) return workers;
    if (interrupt_flag()) throw NoQuote("interrupted");
    if (steady_clock::now() > deadline)
      throw NoQuote(
          fmt::format("no quote: {} at {}, and none came within {} s; start one with `woodcock-worker --dir DIR --coordinator {}`, "
                      "or quote for this machine",
                      connected == 0 ? "no worker is connected" : "every connected worker is draining or quarantined", service.address(),
                      kWorkerWait.count(), service.address()));
    std::this_thread::sleep_for(kPoll);
  }
}

WorkerTimes measure_workers(Service& service, const Submission& submission, const WorkerPilotOptions& options) {
  std::vector<v1::WorkerStatus> present = ready_workers(service);
  std::erase_if(present, [&](const v1::WorkerStatus& w) { return !may_render(w, submission.request.policy()); });
  if (present.empty()) throw NoQuote("no quote: no ready worker has the tags and the memory that the job asks for");
  size_t slots = 0;
  for (const v1::WorkerStatus& worker : present) slots += worker.slots();
  const PixelRect bounds = rpc::from_wire(submission.request.frames(0).header().pixel_bounds(), "pixel_bounds");
  int tile = options.tile;
  while (tile > kMinTile && tile_grid(bounds, tile).size() < kTasksPerSlot * slots) tile /= 2;

  upload_missing(service, submission, options.quiet);
  v1::SubmitJobResponse response;
  service.call(&v1::JobsService::Stub::SubmitJob, pilot_request(submission.request, options.samples, tile), response,
               "submitting the pilot of a quote");
  const v1::FrameHeader header = wait_for(service, response.job_id(), options).frames(0).header();
  const size_t ready = present.size();
  std::erase_if(
      present, [&](const v1::WorkerStatus& w) { return w.build() != header.build() || w.arithmetic_class() != header.arithmetic_class(); });
  WorkerTimes times = judge_workers(by_worker(present, results_of(service, response.job_id())));
  times.others = static_cast<int64_t>(ready - present.size());
  times.samples = options.samples;
  times.job = response.job_id();
  return times;
}

}  // namespace woodcock
