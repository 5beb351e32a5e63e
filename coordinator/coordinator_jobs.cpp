// What the client asks for.
#include <algorithm>
#include <charconv>

#include "coordinator/coordinator.h"
#include "coordinator/coordinator_locked.h"
#include "coordinator/job_view.h"
#include "coordinator/scene_reader.h"
#include "coordinator/submit.h"
#include "coordinator/task_grid.h"
#include "rpc/error.h"
#include "rpc/limits.h"

namespace woodcock::coordinator {

const Job& Coordinator::must_find(const std::string& id) const {
  const Job* job = scheduler_->find(id);
  if (!job) rpc::fail_not_found("there is no job " + id.substr(0, 64) + "; `woodcock jobs` lists them");
  return *job;
}

v1::Job Coordinator::view(const std::string& id, bool with_frames) const {
  const auto last = last_event_.find(id);
  return job_view(*scheduler_, must_find(id), last == last_event_.end() ? 0 : last->second, with_frames, options_.now());
}

v1::SubmitJobResponse Coordinator::submit(const v1::SubmitJobRequest& request) {
  if (store_->backlog() > options_.max_backlog) rpc::fail_exhausted("the coordinator's database is behind; submit again later");
  if (const std::string shortage = blobs_.shortage(); !shortage.empty()) rpc::fail_exhausted(shortage);
  const JobSpec spec = check_submit(request, blobs_, options_.now(), options_.unix_ms());
  const bool repeated = locked([&] {
    if (const Job* job = scheduler_->find(spec.id)) {
      if (job->spec.request_digest != spec.request_digest)
        throw rpc::RpcError(rpc::Code::kAlreadyExists, "request id " + spec.request_id + " was used for another submit; make a new one");
      return true;
    }
    scheduler_->add_job(spec);
    ++changes_;
    store_->write([this, spec](StoreSession& session) {
      if (!session.insert_job(spec)) options_.on_fatal("job " + spec.id + " is in the database and not in memory");
    });
    carry_out(action::LogEvent{spec.id, {0, 0, EventKind::Submitted, {}, "", "", spec.name}});
    return false;
  });
  store_->flush();
  v1::SubmitJobResponse response;
  response.set_job_id(spec.id);
  response.set_repeated_request(repeated);
  return response;
}

v1::SubmitSceneResponse Coordinator::submit_scene(const v1::SubmitSceneRequest& request) {
  if (const std::string shortage = blobs_.shortage(); !shortage.empty()) rpc::fail_exhausted(shortage);
  v1::SubmitSceneResponse response = read_handed_in_scene(request, options_.scene_reader, blobs_, options_.now());
  const v1::SubmitJobResponse submitted = submit(response.resolved());
  response.set_job_id(submitted.job_id());
  response.set_repeated_request(submitted.repeated_request());
  return response;
}

v1::Job Coordinator::job(const std::string& id) {
  v1::Job seen;
  {
    const std::lock_guard lock(mutex_);
    seen = view(id, true);
  }
  // What was seen was queued before: nothing is told that a crash could take back.
  store_->flush();
  return seen;
}

namespace {

size_t page_limit(int page_size) {
  if (page_size < 0 || page_size > 1000) rpc::fail_invalid("page_size: expected 1 to 1000, or 0 for 100");
  return page_size == 0 ? 100 : static_cast<size_t>(page_size);
}

}  // namespace

v1::ListJobsResponse Coordinator::list(int page_size, const std::string& page_token) {
  const size_t limit = page_limit(page_size);
  std::unique_lock lock(mutex_);
  std::vector<std::pair<int64_t, std::string>> order;
  for (const auto& [id, job] : scheduler_->jobs()) order.emplace_back(-job.spec.submitted_unix_ms, id);
  std::sort(order.begin(), order.end());
  size_t begin = 0;
  if (!page_token.empty()) {
    const auto last = std::find_if(order.begin(), order.end(), [&](const auto& item) { return item.second == page_token; });
    if (last == order.end()) rpc::fail_invalid("page_token: not one of an earlier answer");
    begin = static_cast<size_t>(last - order.begin()) + 1;
  }
  v1::ListJobsResponse response;
  for (size_t i = begin; i < std::min(begin + limit, order.size()); ++i) *response.add_jobs() = view(order[i].second, false);
  if (begin + limit < order.size()) response.set_next_page_token(order[begin + limit - 1].second);
  lock.unlock();
  store_->flush();
  return response;
}

v1::ListResultsResponse Coordinator::results(const std::string& id, int page_size, const std::string& page_token) {
  const size_t limit = page_limit(page_size);
  TaskRef next{id, 0, 0};
  if (!page_token.empty()) {
    const std::optional<TaskRef> parsed = parse_task_id(page_token);
    if (!parsed || parsed->job != id) rpc::fail_invalid("page_token: not one of an earlier answer");
    next = *parsed;
  }
  v1::ListResultsResponse response;
  {
    const std::lock_guard lock(mutex_);
    const Job& job = must_find(id);
    for (; static_cast<size_t>(next.frame) < job.frames.size(); ++next.frame, next.number = 0) {
      const std::vector<Task>& tasks = job.frames[static_cast<size_t>(next.frame)].tasks;
      for (; static_cast<size_t>(next.number) < tasks.size(); ++next.number) {
        const Task& task = tasks[static_cast<size_t>(next.number)];
        if (task.state != TaskState::Done) continue;
        if (static_cast<size_t>(response.results_size()) == limit) {
          response.set_next_page_token(to_string(next));
          break;
        }
        *response.add_results() = result_view(next, task);
      }
      if (!response.next_page_token().empty()) break;
    }
  }
  store_->flush();
  return response;
}

v1::ListWorkersResponse Coordinator::list_workers(int page_size, const std::string& page_token) {
  const size_t limit = page_limit(page_size);
  v1::ListWorkersResponse response;
  const std::lock_guard lock(mutex_);
  const std::vector<WorkerView> workers = scheduler_->list_workers(page_token, limit + 1, options_.now());
  for (size_t i = 0; i < std::min(limit, workers.size()); ++i) *response.add_workers() = to_wire(workers[i]);
  if (workers.size() > limit) response.set_next_page_token(workers[limit - 1].last->worker_id);
  return response;
}

v1::Job Coordinator::cancel(const std::string& id) {
  locked([&] {
    must_find(id);
    scheduler_->cancel(id);
  });
  return job(id);
}

v1::Job Coordinator::set_paused(const std::string& id, bool paused) {
  locked([&] {
    const Job& job = must_find(id);
    if (!scheduler_->set_paused(id, paused)) rpc::fail_precondition("job " + id + " has ended: " + to_string(job.row.state));
  });
  return job(id);
}

v1::Job Coordinator::extend(const std::string& id, int64_t samples, std::optional<double> target_error, double max_seconds) {
  const std::optional<double> seconds = checked_seconds(max_seconds);
  locked([&] {
    const Job& job = must_find(id);
    if (target_error || seconds || job.spec.target) {
      if (!scheduler_->set_target(id, extended_target(job.spec, samples, target_error, seconds.has_value()), seconds))
        rpc::fail_precondition("job " + id + " is " + to_string(job.row.state) + " and cannot be extended");
      return;
    }
    if (samples < job.spec.samples() || samples > rpc::kMaxSamplesPerPixel)
      rpc::fail_invalid("samples: the job has " + std::to_string(job.spec.samples()) + " per pixel, more can be added but none taken away");
    int64_t tasks = 0;
    for (const Frame& frame : job.frames)
      tasks += static_cast<int64_t>(frame.tasks.size()) +
               task_count(frame.spec.header.bounds, job.spec.tile_size, {job.spec.samples(), samples}, job.spec.range_length);
    if (tasks > rpc::kMaxTasksPerJob)
      rpc::fail_exhausted("the job would have more than 1000000 tasks; submit it anew with the full number of samples");
    if (!scheduler_->extend(id, samples))
      rpc::fail_precondition("job " + id + " is " + to_string(job.row.state) + " and cannot be extended");
  });
  return job(id);
}

v1::RepinJobResponse Coordinator::repin(const std::string& id) {
  v1::RepinJobResponse response;
  locked([&] {
    const Job& job = must_find(id);
    if (has_ended(job.row.state)) rpc::fail_precondition("job " + id + " has ended: " + to_string(job.row.state));
    if (scheduler_->connected_workers(options_.now()) == 0)
      rpc::fail_precondition("no worker is connected: start those that are to render it");
    const std::optional<int64_t> frames = scheduler_->repin(id, options_.now());
    if (!frames) throw rpc::RpcError(rpc::Code::kUnavailable, "a result of job " + id + " is just being committed; ask again");
    if (*frames == 0) rpc::fail_precondition("nothing of job " + id + " starts again: a worker of its build is connected");
    response.set_frames(*frames);
  });
  *response.mutable_job() = job(id);
  return response;
}

std::vector<v1::TaskAttempt> Coordinator::task_log(const std::string& job_id, const std::string& task_id) {
  const std::optional<TaskRef> task = parse_task_id(task_id);
  {
    const std::lock_guard lock(mutex_);
    const Job& job = must_find(job_id);
    if (!task || task->job != job_id || static_cast<size_t>(task->frame) >= job.frames.size() ||
        static_cast<size_t>(task->number) >= job.frames[static_cast<size_t>(task->frame)].tasks.size())
      rpc::fail_not_found("job " + job_id + " has no task " + task_id.substr(0, 64));
  }
  std::vector<v1::TaskAttempt> attempts;
  for (const AttemptRecord& attempt : store_->read([task](StoreSession& session) { return session.attempts(*task); }))
    attempts.push_back(to_wire(attempt));
  return attempts;
}

v1::WatchJobResponse Coordinator::watch(const std::string& id, int64_t after_event, bool& finished) {
  v1::WatchJobResponse response;
  {
    const std::lock_guard lock(mutex_);
    *response.mutable_job() = view(id, false);
  }
  store_->flush();
  if (response.job().last_event() > after_event) {
    for (const JobEvent& event : store_->read([id, after_event](StoreSession& session) { return session.events(id, after_event, 1000); }))
      *response.add_events() = to_wire(event);
  }
  const int64_t seen = response.events().empty() ? after_event : response.events().rbegin()->number();
  finished = response.job().state() >= v1::JOB_STATE_DONE && seen >= response.job().last_event();
  return response;
}

}  // namespace woodcock::coordinator
