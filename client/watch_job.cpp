#include "client/watch_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>

#include "client/interrupt.h"
#include "client/job_view.h"
#include "client/progress_line.h"

namespace woodcock {
namespace {

using std::chrono::milliseconds;
constexpr std::chrono::minutes kPatience{5};
constexpr std::chrono::minutes kStreamDeadline{60};

/// Cancels a call when the user interrupts, for as long as it lives.
class CancelOnInterrupt {
 public:
  explicit CancelOnInterrupt(grpc::ClientContext& context)
      : watcher_([this, &context] {
          while (!done_) {
            if (interrupt_flag()) return context.TryCancel();
            std::this_thread::sleep_for(milliseconds(50));
          }
        }) {}
  ~CancelOnInterrupt() {
    done_ = true;
    watcher_.join();
  }

 private:
  std::atomic<bool> done_{false};
  std::thread watcher_;
};

/// Whether an event is more than the ordinary course of things.
bool is_remarkable(v1::JobEventKind kind) {
  switch (kind) {
    case v1::JOB_EVENT_KIND_FRAME_DONE:
    case v1::JOB_EVENT_KIND_PASS_DECIDED:
    case v1::JOB_EVENT_KIND_LEASE_EXPIRED:
    case v1::JOB_EVENT_KIND_TASK_FAILED:
    case v1::JOB_EVENT_KIND_TASK_SPLIT:
    case v1::JOB_EVENT_KIND_TASK_GIVEN_UP:
    case v1::JOB_EVENT_KIND_DETERMINISM_ALARM:
    case v1::JOB_EVENT_KIND_RESULT_REFUSED:
      return true;
    default:
      return false;
  }
}

}  // namespace

std::optional<v1::Job> watch_job(Service& service, const std::string& job_id, const JobUpdate& update) {
  int64_t cursor = 0;
  auto last_heard = std::chrono::steady_clock::now();
  while (!interrupt_flag()) {
    v1::WatchJobRequest request;
    request.set_job_id(job_id);
    request.set_after_event(cursor);
    grpc::ClientContext context;
    rpc::set_deadline(context, kStreamDeadline);
    grpc::Status status;
    {
      const CancelOnInterrupt guard(context);
      const auto reader = service.jobs().WatchJob(&context, request);
      v1::WatchJobResponse response;
      while (reader->Read(&response)) {
        last_heard = std::chrono::steady_clock::now();
        for (const v1::JobEvent& event : response.events()) cursor = std::max(cursor, event.number());
        update(response);
      }
      status = reader->Finish();
    }
    if (interrupt_flag()) break;
    if (!status.ok() && !rpc::is_retryable(status)) rpc::throw_if_failed(status, "watching job " + job_id);
    if (status.ok()) {
      const v1::Job job = service.job(job_id);
      if (has_ended(job.state())) return job;
    } else if (std::chrono::steady_clock::now() - last_heard > kPatience) {
      rpc::throw_if_failed(status, "watching job " + job_id + ": the coordinator has been away for five minutes");
    }
    std::this_thread::sleep_for(milliseconds(300));
  }
  return std::nullopt;
}

std::optional<v1::Job> watch_job_on_terminal(Service& service, const std::string& job_id, bool quiet) {
  ProgressLine line("job " + job_id, quiet);
  v1::JobState state = v1::JOB_STATE_UNSPECIFIED;
  const auto show = [&](const v1::WatchJobResponse& update) {
    if (quiet) return;
    for (const v1::JobEvent& event : update.events()) {
      if (!is_remarkable(event.kind())) continue;
      line.finish();
      fmt::print(stderr, "{}\n", event.message());
    }
    const v1::Job& job = update.job();
    if (job.state() != state) {
      line.finish();
      fmt::print(stderr, "job {} is {}{}{}\n", job_id, state_name(job.state()), job.state_reason().empty() ? "" : ": ", job.state_reason());
      state = job.state();
    }
    const v1::Progress& progress = job.progress();
    if (progress.samples_total() <= 0) return;
    const double done = static_cast<double>(progress.samples_done() + progress.samples_in_flight());
    line.show(std::min(1.0, done / static_cast<double>(progress.samples_total())),
              format_count(progress.samples_per_second()) + (job.has_target() ? "samples/s, this pass" : "samples/s"));
  };
  auto job = watch_job(service, job_id, show);
  line.finish();
  if (!job && !quiet) fmt::print(stderr, "stopped watching; the job goes on: woodcock watch {}\n", job_id);
  return job;
}

}  // namespace woodcock
