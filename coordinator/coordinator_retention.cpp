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
/// How far the clocks of a job's submit and of its files' writing may differ.
constexpr int64_t kClockMarginMs = 86'400'000;

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
      if (!row) fail_no_job(id);
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

Coordinator::Referenced Coordinator::find_referenced() {
  Referenced found{blobs_.begin_mark(options_.now()), {}, 0};
  store_->each_digest([&](const std::string& digest) { found.digests.add(digest); });
  int64_t unread = 0;
  std::string first_error;
  for (const std::string& digest : store_->look([](StoreSession& session) { return session.manifests(); })) {
    found.digests.add(digest);
    v1::SceneManifest manifest;
    const auto error = rpc::failure_of([&] { manifest = rpc::parse_manifest(blobs_.read(digest, rpc::kMaxManifestBytes)); });
    for (const v1::SceneFile& file : manifest.files()) found.digests.add(file.content_digest());
    if (!error) continue;
    // Its files are unknown, and were here when a job with it was submitted. A job that is on its way holds its own.
    const auto submitted = store_->look([&](StoreSession& session) { return session.last_submit_with_manifest(digest); });
    if (!submitted) continue;
    const int64_t written = blobs_.written_unix_ms(digest).value_or(0);
    found.keep_before_unix_ms = std::max(found.keep_before_unix_ms, std::max(*submitted, written) + kClockMarginMs);
    if (unread++ == 0) first_error = *error;
  }
  if (unread > 0)
    spdlog::error("clean-up: the lists of files of {} scenes cannot be read, so that files as old as these scenes stay; the first: {}",
                  unread, first_error);
  found.digests.sort();
  return found;
}

size_t Coordinator::sweep() {
  const std::lock_guard one_at_a_time(housekeeping_);
  return remove_unreferenced(find_referenced());
}

size_t Coordinator::remove_unreferenced(const Referenced& referenced) {
  options_.failpoint("marked");  // a clean-up knows what is referred to, and has removed nothing
  return blobs_.sweep(
      referenced.digests, referenced.mark, [](const std::string& warning) { spdlog::warn("clean-up: {}", warning); },
      referenced.keep_before_unix_ms);
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

v1::RetainJobsResponse Coordinator::apply_limits(Referenced& referenced) {
  v1::RetainJobsResponse response;
  const RetentionOptions options{options_.retention, retention_unix_ms(), options_.pin / 1'000'000, false};
  RetentionPlan plan(*store_, blobs_, options, blobs_.bytes(referenced.digests));
  response.set_bytes_before(plan.bytes());
  bool changed = false;
  const auto free_unused = [&](int64_t until_ms) {
    const int64_t before = store_->look([](StoreSession& session) { return session.unused_bytes(); });
    while (!stopping() && store_->read([&](StoreSession& session) { return session.delete_unused(until_ms, kRowsAStep); }) == kRowsAStep)
      continue;
    const int64_t freed = before - store_->look([](StoreSession& session) { return session.unused_bytes(); });
    changed = changed || freed > 0;
    plan.free_unused(freed);
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
  if (changed || response.jobs_total() > 0) referenced = find_referenced();
  return response;
}

v1::RetainJobsResponse Coordinator::clean_up() {
  const std::lock_guard one_at_a_time(housekeeping_);
  return clean_up_alone(false);
}

v1::RetainJobsResponse Coordinator::clean_up_alone(bool measure) {
  // Shown is what is counted: jobs that nobody has asked for since.
  for (const std::string& id : store_->look([](StoreSession& session) { return session.jobs_without_counts(100); }))
    if (const auto error = rpc::failure_of([&] { stored(id); })) spdlog::warn("job {} is not counted: {}", id, *error);
  purge();
  Referenced referenced = find_referenced();
  v1::RetainJobsResponse went;
  // The size of every file is asked for only where somebody wants to know.
  if (measure || options_.retention.any()) went = apply_limits(referenced);
  went.set_keep_seconds(options_.retention.keep_seconds);
  went.set_keep_bytes(options_.retention.keep_bytes);
  if (const size_t removed = remove_unreferenced(referenced); removed > 0) spdlog::info("clean-up removed {} files", removed);
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
  if (!request.dry_run()) return clean_up_alone(true);
  // What was deleted before does not count.
  purge();
  RetentionOptions options{options_.retention, retention_unix_ms(), options_.pin / 1'000'000, true};
  if (!own) options.limits = {request.keep_seconds(), request.keep_bytes()};
  RetentionPlan plan(*store_, blobs_, options, blobs_.bytes(find_referenced().digests));
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
