#include "coordinator/store.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <soci/soci.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <cstdio>
#include <random>
#include <stdexcept>

#include "coordinator/statement_cache.h"
#include "rpc/failure.h"

namespace woodcock::coordinator {
namespace {

/// The first schema; a new database starts with it too, and then goes through every upgrade.
constexpr const char* kFirstSchema[] = {
    "create table schema_version (version bigint not null)",
    "create table leader (id bigint primary key, term bigint not null, address text not null)",
    "create table jobs (job_id text primary key, request_id text not null unique, request_digest text not null, name text not null,"
    " settings text not null, tile_size bigint not null, range_length bigint not null, rounds text not null, priority bigint not null,"
    " submitted_ms bigint not null, state bigint not null, reason text not null, paused bigint not null, ended_ms bigint not null,"
    " last_event bigint not null)",
    "create table frames (job_id text not null, frame bigint not null, header text not null, manifest_digest text not null,"
    " scene_file text not null, pinned bigint not null, build text not null, class text not null, state bigint not null,"
    " image_digest text not null, image_bytes bigint not null, statistics text not null, reason text not null, primary key (job_id, "
    "frame))",
    // An open task has no row: inserting it is the compare-and-set.
    "create table settled (job_id text not null, frame bigint not null, number bigint not null, state bigint not null, result_key text not "
    "null,"
    " digest text not null, bytes bigint not null, cpu_ns bigint not null, wall_ns bigint not null, samples bigint not null,"
    " first_part bigint not null, error text not null, primary key (job_id, frame, number))",
    "create table results (result_key text primary key, digest text not null, bytes bigint not null, cpu_ns bigint not null,"
    " wall_ns bigint not null, samples bigint not null)",
    "create table attempts (job_id text not null, frame bigint not null, number bigint not null, epoch bigint not null, worker_id text not "
    "null,"
    " host_name text not null, unix_ms bigint not null, message text not null, log_excerpt text not null,"
    " primary key (job_id, frame, number, epoch))",
    "create table leases (lease_id text primary key, job_id text not null, frame bigint not null, number bigint not null,"
    " worker_id text not null, epoch bigint not null)",
    "create table events (job_id text not null, number bigint not null, unix_ms bigint not null, kind bigint not null, frame bigint not "
    "null,"
    " task_id text not null, worker_id text not null, message text not null, primary key (job_id, number))",
};

/// Element i leads from version i + 1 to i + 2.
const std::vector<std::vector<const char*>> kUpgrades{
    {"alter table settled add column nonfinite bigint not null default 0",
     "alter table settled add column clamped bigint not null default 0",
     "alter table settled add column majorant_violations bigint not null default 0",
     "alter table settled add column truncated bigint not null default 0",
     "alter table results add column nonfinite bigint not null default 0",
     "alter table results add column clamped bigint not null default 0",
     "alter table results add column majorant_violations bigint not null default 0",
     "alter table results add column truncated bigint not null default 0"},
    {"alter table jobs add column target text not null default ''", "alter table frames add column passes text not null default ''"},
    {"alter table jobs add column quote text not null default ''", "alter table settled add column worker_id text not null default ''",
     "alter table settled add column reused bigint not null default 0",
     // Until now what an earlier job rendered was kept without its cost.
     "update settled set reused = 1 where state = 2 and cpu_ns = 0", "alter table results add column worker_id text not null default ''"},
    {"alter table leader add column cluster_id text not null default ''"},
    // What has ended is shown from these, and found by them.
    {"alter table jobs add column summary text not null default ''", "alter table frames add column counts text not null default ''",
     "create index jobs_by_time on jobs (submitted_ms desc, job_id)", "create index jobs_running on jobs (submitted_ms) where state < 4",
     "create index jobs_uncounted on jobs (job_id) where state >= 4 and summary = ''",
     "create index settled_not_done on settled (job_id, frame, number) where state > 2"},
    // Who has a result is counted, so that it can go with the last one. Jobs are deleted in steps.
    {"alter table results add column uses bigint not null default 0", "alter table results add column freed_ms bigint not null default 0",
     "create index upgrade_keys on settled (result_key)",
     "update results set uses = (select count(*) from settled where settled.result_key = results.result_key and settled.state = 2)",
     "drop index upgrade_keys", "create index results_unused on results (freed_ms) where uses <= 0",
     "create index jobs_ended on jobs (ended_ms, job_id) where state >= 4", "create index frames_by_image on frames (image_digest)",
     "create index frames_by_manifest on frames (manifest_digest)", "create table deletions (job_id text primary key)"},
    {"alter table jobs add column policy text not null default ''"},
    // Frames of a large job are written before it.
    {"create table submissions (job_id text primary key)"},
};

[[noreturn]] void refuse(const std::string& message) { throw std::runtime_error(message); }

}  // namespace

void throw_on_if_the_database_failed() {
  try {
    throw;
  } catch (const soci::soci_error&) {
    throw;
  } catch (...) {
  }
}

std::string random_id() {
  std::random_device random;
  std::string id;
  while (id.size() < 32) {
    char digits[9];
    std::snprintf(digits, sizeof digits, "%08x", static_cast<unsigned>(random()));
    id += digits;
  }
  return id;
}

Store::Store(const StoreOptions& options) : options_(options) {
  const std::string lock_path = options.dir + "/lock";
  lock_fd_ = ::open(lock_path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (lock_fd_ < 0 || ::flock(lock_fd_, LOCK_EX | LOCK_NB) != 0) {
    if (lock_fd_ >= 0) ::close(lock_fd_);
    refuse("the folder " + options.dir +
           " is in use by another coordinator (its lock file is locked); stop that one or give another --dir");
  }
  try {
    sql_ = std::make_unique<soci::session>(caching_sqlite3(), "db=" + options.dir + "/woodcock.sqlite timeout=5");
    soci::session& sql = *sql_;
    // WAL has a corruption bug in this SQLite with several connections; DELETE does not sync the directory.
    std::string mode;
    int synchronous = 0;
    sql << "pragma journal_mode = truncate", soci::into(mode);
    sql << "pragma synchronous = full";
    sql << "pragma synchronous", soci::into(synchronous);
    if (mode != "truncate" || synchronous != 2) refuse("SQLite did not accept journal_mode=TRUNCATE and synchronous=FULL");

    soci::transaction transaction(sql);
    int tables = 0;
    sql << "select count(*) from sqlite_master where type = 'table' and name = 'schema_version'", soci::into(tables);
    if (tables == 0) {
      for (const char* statement : kFirstSchema) sql << statement;
      sql << "insert into schema_version (version) values (1)";
      sql << "insert into leader (id, term, address) values (1, 0, '')";
    }
    int version = 0;
    sql << "select version from schema_version", soci::into(version);
    const int newest = static_cast<int>(kUpgrades.size()) + 1;
    if (version < 1 || version > newest)
      refuse("the database has schema " + std::to_string(version) + ", this program knows schema " + std::to_string(newest) +
             "; use a matching program");
    for (; version < newest; ++version)
      for (const char* statement : kUpgrades[static_cast<size_t>(version) - 1]) sql << statement;
    sql << "update schema_version set version = :v", soci::use(version);
    // Jobs that were being submitted when the program ended: whoever did so was told nothing.
    sql << "delete from frames where job_id in (select job_id from submissions)";
    sql << "delete from submissions";
    long long term = 0;
    sql << "update leader set term = term + 1, address = :a where id = 1", soci::use(options.address);
    sql << "select term, cluster_id from leader where id = 1", soci::into(term), soci::into(cluster_id_);
    if (cluster_id_.empty()) {
      cluster_id_ = options.make_id();
      sql << "update leader set cluster_id = :c where id = 1", soci::use(cluster_id_);
    }
    transaction.commit();
    term_ = static_cast<uint64_t>(term);
  } catch (...) {
    sql_.reset();
    ::close(lock_fd_);
    throw;
  }
  if (options.own_thread) thread_ = std::thread([this] { work_off(); });
}

Store::~Store() {
  stop();
  sql_.reset();
  ::close(lock_fd_);
}

void Store::stop() {
  if (!options_.own_thread) {
    while (step()) {
    }
    return;
  }
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void Store::write(std::function<void(StoreSession&)> work, std::function<void()> done) { queue({std::move(work), std::move(done), true}); }

void Store::queue(Operation operation) {
  {
    const std::lock_guard lock(mutex_);
    queue_.push_back(std::move(operation));
    ++queued_;
  }
  wake_.notify_one();
}

void Store::raise_term(uint64_t above, std::function<void()> done) {
  auto raised = std::make_shared<uint64_t>(0);
  write(
      [this, above, raised](StoreSession& session) {
        if (above < term_) return;
        *raised = above + 1;
        session.set_term(*raised);
      },
      [this, raised, done = std::move(done)] {
        // Before the next transaction, whose fence asks for it.
        if (*raised > 0) term_ = *raised;
        done();
      });
}

void Store::step_until_idle() {
  if (options_.own_thread) return;
  while (step()) {
  }
  const std::lock_guard lock(mutex_);
  if (failed_) throw std::runtime_error("the database failed");
}

void Store::flush() {
  step_until_idle();
  std::unique_lock lock(mutex_);
  const uint64_t target = queued_;
  flushed_.wait(lock, [&] { return durable_ >= target || failed_; });
  if (durable_ < target) throw std::runtime_error("the database failed");
}

size_t Store::backlog() const {
  const std::lock_guard lock(mutex_);
  return queue_.size();
}

void Store::work_off() {
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [&] { return stopping_ || copy_ || !queue_.empty(); });
      if (queue_.empty() && stopping_ && !copy_) return;
    }
    if (!step()) return;
  }
}

bool Store::step() {
  {
    const std::lock_guard lock(mutex_);
    if ((queue_.empty() && !copy_) || failed_) return false;
  }
  std::vector<Operation> batch;
  try {
    write_batch(batch);
    step_copy();
    {
      const std::lock_guard lock(mutex_);
      durable_ += batch.size();
    }
    flushed_.notify_all();
  } catch (const std::exception& error) {
    {
      const std::lock_guard lock(mutex_);
      failed_ = true;
    }
    flushed_.notify_all();
    end_copy(std::current_exception());
    // What was acknowledged is durable, what was not is repeated by those who asked: the only safe answer is none.
    options_.on_fatal(std::string("the database failed: ") + error.what());
    return false;
  }
  for (Operation& operation : batch)
    if (const auto error = operation.done ? rpc::failure_of(operation.done) : std::nullopt)
      spdlog::error("what follows a commit failed: {}", *error);
  return true;
}

/// Takes what waits, as much as is written within a moment: whoever reads waits for one batch, and its own.
void Store::write_batch(std::vector<Operation>& batch) {
  {
    const std::lock_guard lock(mutex_);
    if (queue_.empty()) return;
  }
  soci::transaction transaction(*sql_);
  StoreSession session(*sql_);
  bool fenced = false;
  const auto end = std::chrono::steady_clock::now() + options_.longest_batch;
  while (batch.size() < options_.batch && (batch.empty() || std::chrono::steady_clock::now() < end)) {
    {
      const std::lock_guard lock(mutex_);
      if (queue_.empty()) break;
      batch.push_back(std::move(queue_.front()));
      queue_.pop_front();
    }
    if (batch.back().changes && !fenced) {
      const auto term = static_cast<long long>(term_.load());
      soci::statement fence = (sql_->prepare << "update leader set term = term where id = 1 and term = :t", soci::use(term));
      fence.execute(true);
      if (fence.get_affected_rows() != 1) throw std::runtime_error("another coordinator took the leadership");
      fenced = true;
    }
    batch.back().work(session);
  }
  options_.failpoint("batch-written");  // what waited is written, its transaction is open
  transaction.commit();
}

}  // namespace woodcock::coordinator
