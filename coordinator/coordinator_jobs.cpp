// What the client asks for.
#include <algorithm>
#include <charconv>
#include <limits>

#include "coordinator/coordinator.h"
#include "coordinator/coordinator_locked.h"
#include "coordinator/job_view.h"
#include "coordinator/scene_reader.h"
#include "coordinator/submit.h"
#include "coordinator/task_grid.h"
#include "rpc/convert.h"
#include "rpc/error.h"
#include "rpc/limits.h"

namespace woodcock::coordinator {

void fail_no_job(const std::string& id) {
  if (id.empty()) rpc::fail_invalid("job_id: found an empty text, expected the id of a job; `woodcock jobs` lists them");
  rpc::fail_not_found("there is no job " + id.substr(0, 64) + "; `woodcock jobs` lists them");
}

const Job& Coordinator::must_find(const std::string& id) const {
  const Job* job = scheduler_->find(id);
  if (!job) fail_no_job(id);
  return *job;
}

std::shared_ptr<const Job> Coordinator::stored(const std::string& id) {
  uint64_t seen = 0;
  {
    const std::lock_guard lock(last_stored_mutex_);
    if (last_stored_ && last_stored_->spec.id == id) return last_stored_;
    seen = woken_;
  }
  std::optional<LoadedJob> found = store_->load_job(id);
  if (!found) fail_no_job(id);
  const auto job = std::make_shared<Job>(std::move(found->job));
  if (!found->counted) {
    store_->load_tasks(*job);
    std::vector<FrameCounts> frames;
    for (Frame& frame : job->frames) frames.push_back(static_cast<FrameCounts&>(frame) = counts_of(*job, frame));
    if (!has_ended(job->row.state)) return job;
    store_->write_counts(id, summary_of(*job), frames);
    for (Frame& frame : job->frames) frame.tasks = {};
  }
  const std::lock_guard lock(last_stored_mutex_);
  if (woken_ == seen) last_stored_ = job;
  return job;
}

void Coordinator::forget_stored() {
  const std::lock_guard lock(last_stored_mutex_);
  last_stored_.reset();
  ++woken_;
}

Job Coordinator::stored_with_tasks(const std::string& id) {
  std::optional<LoadedJob> loaded = store_->load_job(id);
  if (!loaded) fail_no_job(id);
  store_->load_tasks(loaded->job);
  return std::move(loaded->job);
}

void Coordinator::must_exist(const std::string& id) {
  if (!store_->look([&](StoreSession& session) { return session.find_job(id); })) fail_no_job(id);
}

namespace {

/// Those that are not done yet. Throws RpcError kNotFound for one that does not exist, kFailedPrecondition for one that ended otherwise.
std::vector<std::string> jobs_to_wait_for(StoreSession& session, const std::vector<std::string>& after) {
  std::vector<std::string> open;
  for (const std::string& id : after) {
    const std::optional<StoredJob> job = session.find_job(id);
    if (!job) rpc::fail_not_found("policy.after: there is no job " + id + "; `woodcock jobs` lists them");
    if (job->row.state == JobState::Done) continue;
    if (has_ended(job->row.state))
      rpc::fail_precondition("policy.after: job " + id + " is " + to_string(job->row.state) +
                             ", and a job begins only after jobs that are done; extend it, or submit without it");
    open.push_back(id);
  }
  return open;
}

}  // namespace

bool Coordinator::insert_job(NewJob& rows) {
  const JobSpec& spec = rows.spec;
  // The database decides who was first.
  std::optional<StoredJob> earlier;
  bool being_deleted = false, being_submitted = false;
  const auto is_first = [&](StoreSession& session) {
    earlier = session.find_job(spec.id);
    being_deleted = session.is_being_deleted(spec.id);
    being_submitted = session.is_being_submitted(spec.id);
    if (earlier || being_deleted || being_submitted) return false;
    rows.spec.policy.waits_for = jobs_to_wait_for(session, spec.policy.after);
    return true;
  };
  bool inserted = false;
  if (rows.frames() <= options_.frames_a_step) {
    inserted = store_->read([&](StoreSession& session) { return is_first(session) && session.insert_job(rows); });
  } else {
    // Who reads waits for a step, not for the whole job.
    const bool begun = store_->read([&](StoreSession& session) {
      const bool first = is_first(session);
      if (first) session.begin_job(spec.id);
      return first;
    });
    if (begun) inserted = insert_in_steps(rows);
  }
  if (inserted) return true;
  const auto ask_again = [&](const char* what) {
    throw rpc::RpcError(rpc::Code::kUnavailable, "the job of request id " + spec.request_id + " is just being " + what + "; submit again");
  };
  if (being_deleted) ask_again("deleted");
  if (being_submitted) ask_again("submitted");
  if (!earlier || earlier->spec.request_digest != spec.request_digest)
    throw rpc::RpcError(rpc::Code::kAlreadyExists, "request id " + spec.request_id + " was used for another submit; make a new one");
  return false;
}

bool Coordinator::insert_in_steps(NewJob& rows) {
  const auto give_up = [&] {
    store_->write([id = rows.spec.id](StoreSession& session) { session.give_job_up(id); });
    {
      const std::lock_guard lock(mutex_);
      to_purge_ = true;
    }
    wake_housekeeper_.notify_all();
  };
  try {
    for (size_t next = 0; next < rows.frames();) {
      next = store_->read([&](StoreSession& session) { return session.insert_frames(rows, next, options_.frames_a_step); });
      options_.failpoint("frames-written");  // some or all frames of a job are durable, the job is not there
    }
    const bool inserted = store_->read([&](StoreSession& session) {
      rows.spec.policy.waits_for = jobs_to_wait_for(session, rows.spec.policy.after);
      return session.insert_job(rows, rows.frames());
    });
    if (!inserted) give_up();
    return inserted;
  } catch (...) {
    give_up();
    throw;
  }
}

/// That a job is on its way from its rows to the scheduler.
class Coordinator::Arrival {
 public:
  Arrival(Coordinator& coordinator, const std::string& id) : coordinator_(coordinator) {
    const std::lock_guard lock(coordinator.mutex_);
    place_ = coordinator.arriving_.insert(id);
  }
  ~Arrival() {
    {
      const std::lock_guard lock(coordinator_.mutex_);
      coordinator_.arriving_.erase(place_);
    }
    coordinator_.arrived_.notify_all();
  }
  Arrival(const Arrival&) = delete;
  Arrival& operator=(const Arrival&) = delete;

 private:
  Coordinator& coordinator_;
  std::multiset<std::string>::iterator place_;
};

v1::SubmitJobResponse Coordinator::submit(const v1::SubmitJobRequest& request) {
  if (store_->backlog() > options_.max_backlog) rpc::fail_exhausted("the coordinator's database is behind; submit again later");
  if (const std::string shortage = blobs_.shortage(); !shortage.empty()) rpc::fail_exhausted(shortage);
  BlobStore::Hold hold(blobs_);
  const JobSpec spec = check_submit(request, blobs_, hold, options_.now(), options_.unix_ms());
  // The database has the job before anybody renders it.
  NewJob rows(spec);
  Job job = make_job(spec);  // before it is inserted: who lists waits from then on
  const Arrival arrival(*this, spec.id);
  const bool repeated = !insert_job(rows);
  if (!repeated) {
    options_.failpoint("job-inserted");  // durable, who submitted it does not know
    job.spec.policy = std::move(rows.spec.policy);
    locked([&] {
      if (!scheduler_->find(spec.id)) scheduler_->add_job(std::move(job));
      ++changes_;
    });
    arrived_.notify_all();
    store_->flush();
  }
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
  std::optional<v1::Job> seen;
  {
    const std::lock_guard lock(mutex_);
    if (const Job* job = scheduler_->find(id)) seen = job_view(*scheduler_, *job, true, options_.now());
  }
  if (!seen) return job_view(*stored(id));
  // What was seen was queued before: nothing is told that a crash could take back.
  store_->flush();
  return std::move(*seen);
}

namespace {

size_t page_limit(int page_size) {
  if (page_size < 0 || page_size > 1000) rpc::fail_invalid("page_size: expected 1 to 1000, or 0 for 100");
  return page_size == 0 ? 100 : static_cast<size_t>(page_size);
}

}  // namespace

v1::ListJobsResponse Coordinator::list(int page_size, const std::string& page_token) {
  const size_t limit = page_limit(page_size);
  // Time and id of the last job: it may have been deleted since.
  int64_t submitted_ms = std::numeric_limits<int64_t>::max();
  std::string last;
  if (!page_token.empty()) {
    const char* const end = page_token.data() + page_token.size();
    const auto [p, error] = std::from_chars(page_token.data(), end, submitted_ms);
    if (error != std::errc() || p == end || *p != '.' || !rpc::is_identifier(std::string(p + 1, end)))
      rpc::fail_invalid("page_token: not one of an earlier answer");
    last.assign(p + 1, end);
  }
  std::vector<StoredJob> page =
      store_->look([&](StoreSession& session) { return session.list_jobs(submitted_ms, last, static_cast<int>(limit) + 1); });
  v1::ListJobsResponse response;
  if (page.size() > limit) {
    page.resize(limit);
    response.set_next_page_token(std::to_string(page.back().spec.submitted_unix_ms) + "." + page.back().spec.id);
  }
  // Those that run are shown as they are now. One that went meanwhile is in the database as it ended.
  std::vector<std::pair<v1::Job*, std::string>> gone;
  for (const StoredJob& row : page) {
    v1::Job& view = *response.add_jobs();
    std::unique_lock lock(mutex_);
    // Its rows were just committed. To read all of a large job would take longer than until it is in memory.
    if (!has_ended(row.row.state)) arrived_.wait(lock, [&] { return scheduler_->find(row.spec.id) || !arriving_.contains(row.spec.id); });
    if (const Job* job = scheduler_->find(row.spec.id))
      view = job_view(*scheduler_, *job, false, options_.now());
    else if (row.summary)
      view = job_view(row.spec, row.row, *row.summary);
    else
      gone.emplace_back(&view, row.spec.id);
  }
  for (const auto& [view, id] : gone) {
    *view = job_view(*stored(id));
    view->clear_frames();
  }
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
  must_exist(id);
  v1::ListResultsResponse response;
  for (const SettledTask& row : store_->look(
           [&](StoreSession& session) { return session.settled_from(next, TaskState::Done, false, static_cast<int>(limit) + 1); })) {
    const TaskRef ref{id, row.frame, row.number};
    if (static_cast<size_t>(response.results_size()) == limit)
      response.set_next_page_token(to_string(ref));
    else
      *response.add_results() = result_view(ref, row);
  }
  return response;
}

v1::ListEventsResponse Coordinator::events(const std::string& id, int page_size, const std::string& page_token) {
  const size_t limit = page_limit(page_size);
  int64_t after = 0;
  if (!page_token.empty()) {
    const char* const end = page_token.data() + page_token.size();
    const auto [p, error] = std::from_chars(page_token.data(), end, after);
    if (error != std::errc() || p != end || after < 0) rpc::fail_invalid("page_token: not one of an earlier answer");
  }
  must_exist(id);
  v1::ListEventsResponse response;
  for (const JobEvent& event :
       store_->look([&](StoreSession& session) { return session.events(id, after, static_cast<int>(limit) + 1); })) {
    if (static_cast<size_t>(response.events_size()) == limit)
      response.set_next_page_token(std::to_string(response.events().rbegin()->number()));
    else
      *response.add_events() = to_wire(event);
  }
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
  locked([&] { scheduler_->cancel(id); });
  return job(id);
}

v1::Job Coordinator::set_paused(const std::string& id, bool paused) {
  while_running(id, [&](const Job& job) {
    if (!scheduler_->set_paused(id, paused)) rpc::fail_precondition("job " + id + " has ended: " + to_string(job.row.state));
  });
  return job(id);
}

namespace {

void check_total(const Job& job, int64_t samples) {
  double pixels = 0;
  for (const Frame& frame : job.frames) pixels += static_cast<double>(frame.spec.header.bounds.area());
  check_sample_total(pixels, samples, "samples");
}

}  // namespace

v1::Job Coordinator::extend(const std::string& id, int64_t samples, std::optional<double> target_error, double max_seconds) {
  const std::optional<double> seconds = checked_seconds(max_seconds);
  wake(id, [&](const Job& job) {
    if (target_error || seconds || job.spec.target) {
      const SamplingTarget target = extended_target(job.spec, samples, target_error, seconds.has_value());
      check_total(job, target.max_samples);
      if (!scheduler_->set_target(id, target, seconds))
        rpc::fail_precondition("job " + id + " is " + to_string(job.row.state) + " and cannot be extended");
      return;
    }
    if (samples < job.spec.samples() || samples > rpc::kMaxSamplesPerPixel)
      rpc::fail_invalid("samples: the job has " + std::to_string(job.spec.samples()) + " per pixel, more can be added but none taken away");
    check_total(job, samples);
    int64_t tasks = 0;
    for (const Frame& frame : job.frames)
      tasks = capped_sum(tasks + frame.tasks.size(),
                         task_count(frame.spec.header.bounds, job.spec.tile_size, {job.spec.samples(), samples}, job.spec.range_length));
    if (tasks > rpc::kMaxTasksPerJob)
      rpc::fail_exhausted("the job would have more than 1000000 tasks; submit it anew with the full number of samples");
    if (!scheduler_->extend(id, samples))
      rpc::fail_precondition("job " + id + " is " + to_string(job.row.state) + " and cannot be extended");
  });
  return job(id);
}

v1::RepinJobResponse Coordinator::repin(const std::string& id) {
  v1::RepinJobResponse response;
  while_running(id, [&](const Job& job) {
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
  const auto has_task = [&](const Job& job) {
    return task && task->job == job_id && static_cast<size_t>(task->frame) < job.frames.size() &&
           task->number < job.frames[static_cast<size_t>(task->frame)].tasks.size();
  };
  std::optional<bool> found;
  {
    const std::lock_guard lock(mutex_);
    if (const Job* job = scheduler_->find(job_id)) found = has_task(*job);
  }
  if (!found) found = has_task(stored_with_tasks(job_id));
  if (!*found) rpc::fail_not_found("job " + job_id + " has no task " + task_id.substr(0, 64));
  std::vector<v1::TaskAttempt> attempts;
  for (const AttemptRecord& attempt : store_->look([task](StoreSession& session) { return session.attempts(*task); }))
    attempts.push_back(to_wire(attempt));
  return attempts;
}

v1::WatchJobResponse Coordinator::watch(const std::string& id, int64_t after_event, bool& finished) {
  v1::WatchJobResponse response;
  bool here = false;
  {
    const std::lock_guard lock(mutex_);
    if (const Job* job = scheduler_->find(id)) {
      *response.mutable_job() = job_view(*scheduler_, *job, false, options_.now());
      here = true;
    }
  }
  if (!here) {
    const std::optional<StoredJob> row = store_->look([&](StoreSession& session) { return session.find_job(id); });
    if (row && row->summary) {
      *response.mutable_job() = job_view(row->spec, row->row, *row->summary);
    } else {
      *response.mutable_job() = job_view(*stored(id));
      response.mutable_job()->clear_frames();
    }
  }
  store_->flush();
  if (response.job().last_event() > after_event) {
    for (const JobEvent& event : store_->look([id, after_event](StoreSession& session) { return session.events(id, after_event, 1000); }))
      *response.add_events() = to_wire(event);
  }
  const int64_t seen = response.events().empty() ? after_event : response.events().rbegin()->number();
  finished = response.job().state() >= v1::JOB_STATE_DONE && seen >= response.job().last_event();
  return response;
}

}  // namespace woodcock::coordinator
