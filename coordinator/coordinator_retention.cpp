// Jobs that go, by a user or by the limits of retention, and the files that nobody needs any more.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "coordinator/coordinator.h"
#include "coordinator/coordinator_locked.h"
#include "rpc/error.h"
#include "rpc/limits.h"
#include "rpc/manifest.h"

namespace woodcock::coordinator {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

/// Rows that one transaction deletes: some milliseconds of the database.
constexpr int kRowsAStep = 1000;
constexpr int kListedJobs = 1000;
constexpr std::chrono::seconds kUntilReleased{10}, kUntilClean{5};
constexpr Time kBetweenCleanUps = 600 * kSecond;

}  // namespace

bool Coordinator::stopping() const {
  const std::lock_guard lock(mutex_);
  return stopping_;
}

int64_t Coordinator::retention_unix_ms() const {
  return std::min(options_.unix_ms(), started_unix_ms_ + (options_.now() - started_) / 1'000'000);
}

bool Coordinator::take_out(const std::string& id) {
  const std::lock_guard nobody_wakes_it(wake_mutex_);
  {
    const std::lock_guard lock(mutex_);
    if (scheduler_->find(id)) return false;
  }
  if (!store_->read([&](StoreSession& session) { return session.begin_delete(id); })) return false;
  options_.failpoint("job-taken-out");  // a job's own row went, all that belongs to it is still there
  forget_stored();
  return true;
}

void Coordinator::remove(const std::string& id, bool cancel) {
  if (cancel) locked([&] { scheduler_->cancel(id); });
  const auto end = steady_clock::now() + kUntilReleased;
  while (!take_out(id)) {
    std::optional<JobState> state;
    {
      const std::lock_guard lock(mutex_);
      if (const Job* job = scheduler_->find(id)) state = job->row.state;
    }
    if (!state) {
      const std::optional<StoredJob> row = store_->look([&](StoreSession& session) { return session.find_job(id); });
      if (!row) rpc::fail_not_found("there is no job " + id.substr(0, 64) + "; `woodcock jobs` lists them");
      state = row->row.state;
    }
    if (!has_ended(*state))
      rpc::fail_precondition("job " + id + " is " + to_string(*state) + ": cancel it before, or delete it with --cancel");
    // It has ended, and the last of it is on its way to the database.
    if (steady_clock::now() > end || stopping()) throw rpc::RpcError(rpc::Code::kUnavailable, "job " + id + " is just ending; ask again");
    std::this_thread::sleep_for(milliseconds(5));
  }
  spdlog::info("job {} was deleted", id);
  {
    const std::lock_guard lock(mutex_);
    to_purge_ = true;
  }
  wake_housekeeper_.notify_all();
}

void Coordinator::purge(const std::string& id) {
  for (bool gone = false; !gone && !stopping();) {
    gone = store_->read([&](StoreSession& session) { return session.delete_step(id, kRowsAStep); });
    options_.failpoint("job-rows-deleted");  // some or all of its other rows went
  }
}

void Coordinator::purge() {
  while (!stopping()) {
    const std::vector<std::string> going = store_->look([](StoreSession& session) { return session.deletions(100); });
    if (going.empty()) return;
    for (const std::string& id : going) purge(id);
  }
}

std::optional<DigestSet> Coordinator::referenced_digests() {
  DigestSet referenced;
  store_->each_digest([&](const std::string& digest) { referenced.add(digest); });
  for (const std::string& digest : store_->look([](StoreSession& session) { return session.manifests(); })) {
    try {
      referenced.add(digest);
      const v1::SceneManifest manifest = rpc::parse_manifest(blobs_.read(digest, rpc::kMaxManifestBytes));
      for (const v1::SceneFile& file : manifest.files()) referenced.add(file.content_digest());
    } catch (const std::exception& error) {
      spdlog::error("manifest {} cannot be read: {}", digest, error.what());
      return std::nullopt;
    }
  }
  referenced.sort();
  return referenced;
}

size_t Coordinator::sweep() {
  const std::lock_guard one_at_a_time(housekeeping_);
  return remove_unreferenced();
}

size_t Coordinator::remove_unreferenced() {
  const BlobStore::Mark mark = blobs_.begin_mark(options_.now());
  const std::optional<DigestSet> referenced = referenced_digests();
  // What an unreadable manifest lists is unknown: nothing may be removed.
  if (!referenced) {
    spdlog::error("clean-up skipped");
    return 0;
  }
  options_.failpoint("marked");  // a clean-up knows what is referred to, and has removed nothing
  return blobs_.sweep(*referenced, mark, [](const std::string& warning) { spdlog::warn("clean-up: {}", warning); });
}

namespace {

void fill(v1::RetainJobsResponse& response, const RetiredJob& job) {
  response.set_jobs_total(response.jobs_total() + 1);
  response.set_freed_bytes(response.freed_bytes() + job.freed_bytes);
  if (response.jobs_size() >= kListedJobs) return;
  v1::RetiredJob& wire = *response.add_jobs();
  wire.set_job_id(job.id);
  wire.set_name(job.name);
  wire.set_ended_unix_ms(job.ended_unix_ms);
  wire.set_cause(static_cast<v1::RetentionCause>(static_cast<int>(job.cause)));
  wire.set_freed_bytes(job.freed_bytes);
}

}  // namespace

v1::RetainJobsResponse Coordinator::apply_limits() {
  v1::RetainJobsResponse response;
  response.set_keep_seconds(options_.retention.keep_seconds);
  response.set_keep_bytes(options_.retention.keep_bytes);
  if (!options_.retention.any()) return response;
  const std::optional<DigestSet> referenced = referenced_digests();
  if (!referenced) return response;  // sizes are unknown
  const RetentionOptions options{options_.retention, retention_unix_ms(), options_.pin / 1'000'000, false};
  RetentionPlan plan(*store_, blobs_, options, blobs_.bytes(*referenced));
  response.set_bytes_before(plan.bytes());
  const auto free_unused = [&](int64_t until_ms) {
    const int64_t before = store_->look([](StoreSession& session) { return session.unused_bytes(); });
    while (!stopping() && store_->read([&](StoreSession& session) { return session.delete_unused(until_ms, kRowsAStep); }) == kRowsAStep)
      continue;
    plan.free_unused(before - store_->look([](StoreSession& session) { return session.unused_bytes(); }));
  };
  if (options.limits.keep_seconds > 0) free_unused(options.unix_ms - 1000 * options.limits.keep_seconds);
  if (plan.over_size()) free_unused(options.unix_ms);
  while (!stopping()) {
    const std::optional<RetiredJob> job = plan.next();
    if (!job) break;
    // One that came back to memory meanwhile runs.
    if (!take_out(job->id)) continue;
    purge(job->id);
    fill(response, *job);
    spdlog::info("job {} goes: {}", job->id,
                 job->cause == RetentionCause::Age ? "it ended longer ago than jobs are kept" : "jobs have more bytes than are kept");
  }
  response.set_bytes_after(plan.bytes());
  return response;
}

v1::RetainJobsResponse Coordinator::clean_up() {
  const std::lock_guard one_at_a_time(housekeeping_);
  return clean_up_alone();
}

v1::RetainJobsResponse Coordinator::clean_up_alone() {
  // Shown is what is counted: jobs that nobody has asked for since.
  for (const std::string& id : store_->look([](StoreSession& session) { return session.jobs_without_counts(100); }))
    if (const auto error = rpc::failure_of([&] { stored(id); })) spdlog::warn("job {} is not counted: {}", id, *error);
  purge();
  v1::RetainJobsResponse went = apply_limits();
  if (const size_t removed = remove_unreferenced(); removed > 0) spdlog::info("clean-up removed {} files", removed);
  return went;
}

v1::RetainJobsResponse Coordinator::retain(const v1::RetainJobsRequest& request) {
  const bool own = !request.has_keep_seconds() && !request.has_keep_bytes();
  if (!request.dry_run()) {
    if (!own) rpc::fail_invalid("keep_seconds, keep_bytes: only with dry_run; the limits that hold are options of the coordinator");
  } else if (request.keep_seconds() < 0 || request.keep_bytes() < 0) {
    rpc::fail_invalid("keep_seconds, keep_bytes: expected 0 for no limit, or more");
  }
  const std::unique_lock one_at_a_time(housekeeping_, kUntilClean);
  if (!one_at_a_time) throw rpc::RpcError(rpc::Code::kUnavailable, "a clean-up or a back-up is under way; ask again");
  if (!request.dry_run()) return clean_up_alone();
  // What was deleted before does not count.
  purge();
  RetentionOptions options{options_.retention, retention_unix_ms(), options_.pin / 1'000'000, true};
  if (!own) options.limits = {request.keep_seconds(), request.keep_bytes()};
  const std::optional<DigestSet> referenced = referenced_digests();
  if (!referenced) rpc::fail_precondition("the list of a scene's files cannot be read, see the coordinator's log: nothing is cleaned up");
  RetentionPlan plan(*store_, blobs_, options, blobs_.bytes(*referenced));
  v1::RetainJobsResponse response;
  response.set_keep_seconds(options.limits.keep_seconds);
  response.set_keep_bytes(options.limits.keep_bytes);
  response.set_bytes_before(plan.bytes());
  if (plan.over_size()) plan.free_unused(store_->look([](StoreSession& session) { return session.unused_bytes(); }));
  while (const std::optional<RetiredJob> job = plan.next()) fill(response, *job);
  response.set_bytes_after(plan.bytes());
  return response;
}

void Coordinator::run_housekeeper() {
  Time next_clean_up = options_.now() + options_.pin;
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    wake_housekeeper_.wait_for(lock, milliseconds(200), [&] { return stopping_ || to_purge_; });
    if (stopping_) return;
    const bool to_purge = std::exchange(to_purge_, false);
    lock.unlock();
    if (to_purge) {
      const auto delete_rows = [&] {
        const std::lock_guard one_at_a_time(housekeeping_);
        purge();
      };
      if (const auto error = rpc::failure_of(delete_rows)) spdlog::error("deleting the rows of jobs failed: {}", *error);
    }
    if (const Time now = options_.now(); options_.clean_up_by_itself && now >= next_clean_up) {
      next_clean_up = now + kBetweenCleanUps;
      if (const auto error = rpc::failure_of([&] { clean_up(); })) spdlog::error("the clean-up failed: {}", *error);
    }
    lock.lock();
  }
}

}  // namespace woodcock::coordinator
