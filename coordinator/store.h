// The database: what survives a crash. One thread, one connection; everything that waits is written in one transaction, in the
// order it was queued, and callbacks run when that transaction is durable.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "coordinator/model.h"

namespace soci {
class session;
}

namespace woodcock::coordinator {

/// The statements, inside a transaction of the store's thread. SQL that SQLite and PostgreSQL both take.
class StoreSession {
 public:
  explicit StoreSession(soci::session& sql) : sql_(sql) {}

  /// Nothing when its request id is taken: then returns false.
  bool insert_job(const JobSpec& spec);
  /// Of the spec: rounds, target, time limit and quote, which alone may change.
  void save_job(const JobSpec& spec, const JobRow& row);
  void save_frame(const std::string& job_id, int frame, const FrameRow& row);
  /// Forgets which of its tasks are settled, and how. Results stay.
  void reset_frame(const std::string& job_id, int frame);
  /// Compare-and-set: inserts the row of an open task and its result. False when the task is settled already, or is a part of
  /// a task that is not split. `parent` is -1 for a task of the grid.
  bool commit_task(const TaskRef& task, int64_t parent, const ResultRecord& result);
  bool settle_task(const TaskRef& task, const SettledTask& row);
  /// The task is open again, its result forgotten.
  void reopen_task(const TaskRef& task, const std::string& result_key);
  std::optional<ResultRecord> find_result(const std::string& key);
  std::optional<ResultRecord> result_of(const TaskRef& task);
  /// Tiles of a frame: number and digest of each task done, by number.
  std::vector<std::pair<int64_t, std::string>> tiles(const std::string& job_id, int frame);
  void add_attempt(const TaskRef& task, const AttemptRecord& attempt);
  std::vector<AttemptRecord> attempts(const TaskRef& task);
  void save_lease(const LeaseRow& lease);
  void drop_lease(const std::string& lease_id);
  void append_event(const std::string& job_id, const JobEvent& event);
  std::vector<JobEvent> events(const std::string& job_id, int64_t after, int limit);
  /// Digests of blobs that rows speak of: results, images, manifests (not the files the manifests list).
  std::set<std::string> referenced_blobs();
  void set_term(uint64_t term);
  std::set<std::string> manifests();

  std::vector<RecoveredJob> load_jobs();
  std::vector<LeaseRow> load_leases();

 private:
  soci::session& sql_;
};

/// 32 random hexadecimal digits.
std::string random_id();

struct StoreOptions {
  std::string dir;                                          ///< must exist
  std::string address;                                      ///< of this leader, for its row
  std::function<void(const std::string& reason)> on_fatal;  ///< must not return
  size_t batch = 512;                                       ///< operations of one transaction
  std::function<std::string()> make_id = random_id;         ///< for a new database
};

class Store {
 public:
  /// Locks the folder, opens or makes the database, takes the leadership (term + 1). Throws std::runtime_error with a
  /// sentence for people: folder in use, newer schema, settings that do not hold.
  explicit Store(const StoreOptions& options);
  ~Store();
  /// Writes what is queued, callbacks and what they queue included. Nothing may be queued afterwards.
  void stop();

  /// Made with the database: workers tell by it that they talk to another one.
  const std::string& cluster_id() const { return cluster_id_; }
  uint64_t term() const { return term_; }
  /// Queues a higher term: a worker has seen this one or another leader with it. `done` runs when the new one holds.
  void raise_term(uint64_t above, std::function<void()> done);
  /// Queues `work`. `done` runs on the store's thread once it is durable; neither may call back into write() and wait.
  /// Never blocks: callers look at backlog() before they accept new work.
  void write(std::function<void(StoreSession&)> work, std::function<void()> done = {});
  /// Runs `work` in its turn and waits for the result; what it saw is durable then.
  template <typename Work>
  auto read(Work work) {
    using Result = decltype(work(std::declval<StoreSession&>()));
    auto result = std::make_shared<std::optional<Result>>();
    auto promise = std::make_shared<std::promise<Result>>();
    auto future = promise->get_future();
    write([result, work = std::move(work)](StoreSession& session) { result->emplace(work(session)); },
          [result, promise] { promise->set_value(std::move(**result)); });
    return future.get();
  }
  /// Waits until everything queued before is durable, without giving the disk more to do. Throws std::runtime_error when the
  /// database has failed. Not for the store's own thread, nor under a lock that a callback takes.
  void flush();
  /// The same as an operation of its own.
  void barrier() {
    read([](StoreSession&) { return true; });
  }
  size_t backlog() const;

 private:
  struct Operation {
    std::function<void(StoreSession&)> work;
    std::function<void()> done;
  };
  void run();
  void write_batch(std::vector<Operation>& batch);

  const StoreOptions options_;
  int lock_fd_ = -1;
  std::string cluster_id_;
  std::atomic<uint64_t> term_ = 0;      // changed by the thread alone
  std::unique_ptr<soci::session> sql_;  // constructor, then the thread

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::condition_variable flushed_;
  // Guarded by mutex_:
  std::deque<Operation> queue_;
  uint64_t queued_ = 0, durable_ = 0;  ///< operations since the start
  bool stopping_ = false, failed_ = false;
  std::thread thread_;
};

}  // namespace woodcock::coordinator
