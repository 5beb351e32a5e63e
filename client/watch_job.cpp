#include "client/watch_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>
#include <utility>

#include "client/interrupt.h"
#include "client/job_view.h"
#include "client/print.h"
#include "client/progress_line.h"

namespace woodcock {
namespace {

using std::chrono::milliseconds;
constexpr std::chrono::minutes kStreamDeadline{60};
constexpr milliseconds kFirstPause{300}, kLastPause{5'000};

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

/// Whether the coordinator may answer otherwise later. A call that it cuts off when it stops is CANCELLED, a torn stream INTERNAL.
bool may_pass(rpc::Code code) {
  return rpc::is_retryable(code) || code == rpc::Code::kCancelled || code == rpc::Code::kInternal || code == rpc::Code::kUnknown;
}

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

std::optional<v1::Job> watch_job(Service& service, const std::string& job_id, const JobUpdate& update,
                                 const std::function<void(const std::string&)>& say) {
  int64_t cursor = 0;
  bool away = false;
  milliseconds pause = kFirstPause;
  const auto answers = [&] {
    if (std::exchange(away, false) && say) say("the coordinator answers again");
    pause = kFirstPause;
  };
  const auto is_away = [&](const std::string& why) {
    if (!std::exchange(away, true) && say) say("the coordinator does not answer (" + why + "): waiting for it; the job goes on");
    std::this_thread::sleep_for(pause);
    pause = std::min(2 * pause, kLastPause);
  };
  while (!interrupt_flag()) {
    v1::WatchJobRequest request;
    request.set_job_id(job_id);
    request.set_after_event(cursor);
    rpc::check_text_fields(request);
    grpc::ClientContext context;
    rpc::set_deadline(context, kStreamDeadline);
    grpc::Status status;
    {
      const CancelOnInterrupt guard(context);
      const auto reader = service.jobs().WatchJob(&context, request);
      v1::WatchJobResponse response;
      while (reader->Read(&response)) {
        answers();
        for (const v1::JobEvent& event : response.events()) cursor = std::max(cursor, event.number());
        update(response);
      }
      status = reader->Finish();
    }
    if (interrupt_flag()) break;
    if (!status.ok()) {
      if (!may_pass(rpc::from_grpc(status.error_code()))) rpc::throw_if_failed(status, "watching job " + job_id);
      // The stream has its own deadline, and is begun again then.
      if (status.error_code() != grpc::StatusCode::DEADLINE_EXCEEDED) is_away(status.error_message());
      continue;
    }
    try {
      const v1::Job job = service.job(job_id);
      answers();
      if (has_ended(job.state())) return job;
      std::this_thread::sleep_for(kFirstPause);
    } catch (const rpc::RpcError& error) {
      if (!may_pass(error.code())) throw;
      is_away(error.what());
    }
  }
  return std::nullopt;
}

std::optional<v1::Job> watch_job_on_terminal(Service& service, const std::string& job_id, bool quiet) {
  ProgressLine line("job " + job_id, quiet);
  v1::JobState state = v1::JOB_STATE_UNSPECIFIED;
  std::string reason;
  const auto show = [&](const v1::WatchJobResponse& update) {
    if (quiet) return;
    for (const v1::JobEvent& event : update.events()) {
      if (!is_remarkable(event.kind())) continue;
      line.finish();
      note("{}\n", event.message());
    }
    const v1::Job& job = update.job();
    // What it waits for may change without its state.
    if (job.state() != state || (job.state_reason() != reason && !job.state_reason().empty())) {
      line.finish();
      note("job {} is {}{}{}\n", job_id, state_name(job.state()), job.state_reason().empty() ? "" : ": ", job.state_reason());
      state = job.state();
    }
    reason = job.state_reason();
    const v1::Progress& progress = job.progress();
    if (progress.samples_total() <= 0) return;
    const double done = static_cast<double>(progress.samples_done() + progress.samples_in_flight());
    line.show(std::min(1.0, done / static_cast<double>(progress.samples_total())),
              format_count(progress.samples_per_second()) + (job.has_target() ? "samples/s, this pass" : "samples/s"));
  };
  auto job = watch_job(service, job_id, show, [&](const std::string& text) {
    if (quiet) return;
    line.finish();
    note("{}\n", text);
  });
  line.finish();
  if (!job && !quiet) note("stopped watching; the job goes on: woodcock watch {}\n", job_id);
  return job;
}

}  // namespace woodcock
