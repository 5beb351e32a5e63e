// The database: what survives a crash. One thread, one connection; everything that waits is written in one transaction, in the
// order it was queued, and callbacks run when that transaction is durable.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include "coordinator/failpoint.h"
#include "coordinator/job.h"

namespace soci {
class session;
}

namespace woodcock::coordinator {

/// A new job in the form of its rows, which takes a while to make where it has many frames.
struct NewJob {
  explicit NewJob(const JobSpec& job);

  JobSpec spec;
  std::string settings;
  std::vector<std::string> headers;  ///< of its frames

  size_t frames() const { return headers.size(); }
};

/// A job's row.
struct StoredJob {
  JobSpec spec;  ///< without frames
  JobRow row;
  std::optional<JobSummary> summary;  ///< of a job that has ended
};

/// A job with its frames, without tasks.
struct LoadedJob {
  Job job;
  bool counted = false;  ///< it has ended, and its frames have their counts as they were kept
};

/// Which tasks of a job are done, or settled otherwise, and what those that are done cost.
struct DoneTasks {
  std::vector<std::pair<int, int64_t>> numbers;    ///< frame and number, in this order
  std::vector<std::pair<int, FrameCounts>> costs;  ///< sums of a frame: processor time and health
};

/// Of a row: a text and two numbers, those that its table has.
struct TableKey {
  std::string text;
  int64_t frame = -1, number = -1;
};

/// A job that has ended, as retention sees it.
struct EndedJob {
  std::string id, name;
  int64_t ended_unix_ms = 0;
};

/// The statements, inside a transaction of the store's thread. SQL that SQLite and PostgreSQL both take.
class StoreSession {
 public:
  explicit StoreSession(soci::session& sql) : sql_(sql) {}

  // Jobs and frames.
  /// With its frames from `first` on: those before were inserted. Nothing when its id or request id is taken, or while the rows of a job
  /// of this id are still going: then returns false.
  bool insert_job(const NewJob& job, size_t first = 0);
  bool insert_job(const JobSpec& job) { return insert_job(NewJob(job)); }
  // The frames of a large job come before it, in transactions of their own: nobody finds frames without a job, and `submissions`
  // remembers them until it is there. What a crash leaves of them goes at the next start.
  void begin_job(const std::string& job_id);
  bool is_being_submitted(const std::string& job_id);
  /// At most `limit`, from `first` on. Returns which comes next.
  size_t insert_frames(const NewJob& job, size_t first, size_t limit);
  /// The job does not come: its frames are to be deleted.
  void give_job_up(const std::string& job_id);
  void save_job(const std::string& job_id, const JobAim& aim, const JobRow& row);
  void save_frame(const std::string& job_id, int frame, const FrameRow& row);
  /// Of a job that has ended: what it shows. Its frames' counts first.
  void save_frame_counts(const std::string& job_id, size_t first, const std::vector<FrameCounts>& frames);
  void save_summary(const std::string& job_id, const JobSummary& summary);
  /// A job that has ended is counted anew when it is shown.
  void forget_counts(const std::string& job_id);
  std::optional<StoredJob> find_job(const std::string& job_id);
  /// At most `limit` jobs, newest first, of one time by id: those after the job `after` of that time.
  std::vector<StoredJob> list_jobs(int64_t submitted_ms, const std::string& after, int limit);
  /// In the order of their submits.
  std::vector<std::string> running_jobs();
  /// Some that ended under an older program, or in a crash, or whose counts were forgotten.
  std::vector<std::string> jobs_without_counts(int limit);
  /// Without frames.
  std::optional<LoadedJob> load_job(const std::string& job_id);
  /// Adds the next frames, at most `limit`. Returns whether there may be more.
  bool load_frames(LoadedJob& loaded, int limit);

  // Jobs that go. A job is taken out in one transaction, and its other rows in steps; `deletions` remembers it until the last is gone.
  /// True: nobody finds the job any more. False where there is no such job, or it has not ended.
  bool begin_delete(const std::string& job_id);
  bool is_being_deleted(const std::string& job_id);
  std::vector<std::string> deletions(int limit);
  /// Deletes at most `limit` rows of a job that was taken out, and the results that no other job has. True when none was left.
  bool delete_step(const std::string& job_id, int limit);
  /// At most `limit` jobs that have ended, those that ended first before the others, of one time by id: those after `after`.
  std::vector<EndedJob> ended_jobs(const EndedJob& after, int limit);
  /// Bytes of the results that no task has any more.
  int64_t unused_bytes();
  /// Deletes at most `limit` of those whose last task went at that time or earlier. Returns how many.
  int64_t delete_unused(int64_t freed_unix_ms, int limit);
  /// How many tasks have the result; 0 where there is none of this key.
  int64_t uses_of_result(const std::string& key);
  int64_t frames_with_image(const std::string& digest);
  int64_t frames_with_manifest(const std::string& digest);
  /// When the last job was submitted that has a frame with this manifest; nothing where none is there.
  std::optional<int64_t> last_submit_with_manifest(const std::string& digest);
  /// Image, its bytes, and manifest of the frames of a job, from one on, at most `limit`.
  struct FrameBlobs {
    int frame = 0;
    std::string image, manifest;
    int64_t image_bytes = 0;
  };
  std::vector<FrameBlobs> frame_blobs(const std::string& job_id, int from, int limit);

  // Tasks.
  /// Forgets which of its tasks are settled, and how. Results stay, those that no task has any more from this time on.
  void reset_frame(const std::string& job_id, int frame, int64_t unix_ms);
  /// Compare-and-set: inserts the row of an open task and its result. False when the task is settled already, or is a part of
  /// a task that is not split. `parent` is -1 for a task of the grid.
  bool commit_task(const TaskRef& task, int64_t parent, const ResultRecord& result);
  bool settle_task(const TaskRef& task, const SettledTask& row);
  /// The task is open again, its result forgotten.
  void reopen_task(const TaskRef& task, const std::string& result_key);
  std::optional<ResultRecord> find_result(const std::string& key);
  std::optional<SettledTask> settled(const TaskRef& task);
  /// At most `limit` that settled, in this state or in any, from a task on, by frame and number: of all frames, or of its own.
  std::vector<SettledTask> settled_from(const TaskRef& from, std::optional<TaskState> state, bool one_frame, int limit);
  /// Of the frames from `first` to `last`; where that is one frame, of its tasks from `from` on and before `to`.
  DoneTasks done_tasks(const std::string& job_id, int first, int last, int64_t from, int64_t to);
  /// Of all frames of a job.
  std::vector<SplitRow> splits(const std::string& job_id);
  void add_attempt(const TaskRef& task, const AttemptRecord& attempt);
  std::vector<AttemptRecord> attempts(const TaskRef& task);
  void save_lease(const LeaseRow& lease);
  void drop_lease(const std::string& lease_id);
  /// Number 0: the next one of the job.
  void append_event(const std::string& job_id, const JobEvent& event);
  std::vector<JobEvent> events(const std::string& job_id, int64_t after, int limit);
  /// At most `limit` rows of a table that name blobs, those whose key comes after `after`. Each gives its key and its digest.
  enum class Table { Results, Settled, Frames };
  std::vector<std::pair<TableKey, std::string>> digests(Table table, const TableKey& after, int limit);
  void set_term(uint64_t term);
  std::set<std::string> manifests();

  std::vector<LeaseRow> load_leases();

 private:
  void load_failures(const Job& job, Frame& frame);
  bool insert_settled(const TaskRef& task, const SettledTask& row);

  soci::session& sql_;
};

/// Inside a catch block: throws the exception on when it is one of the database.
void throw_on_if_the_database_failed();

/// 32 random hexadecimal digits.
std::string random_id();

struct StoreOptions {
  std::string dir;                                          ///< must exist
  std::string address;                                      ///< of this leader, for its row
  std::function<void(const std::string& reason)> on_fatal;  ///< must not return
  size_t batch = 512;                                       ///< operations of one transaction
  std::function<std::string()> make_id = random_id;         ///< for a new database
  std::chrono::milliseconds longest_batch{20};              ///< after so long a transaction takes no further operation
  bool own_thread = true;                                   ///< false: whoever has the store calls step(), and so does who waits for it
  Failpoint failpoint = [](const char*) {};
};

class Store {
 public:
  /// Locks the folder, opens or makes the database, takes the leadership (term + 1). Throws std::runtime_error with a
  /// sentence for people: folder in use, newer schema, settings that do not hold.
  explicit Store(const StoreOptions& options);
  ~Store();
  /// Writes what is queued, callbacks and what they queue included. Nothing may be queued afterwards.
  void stop();
  /// Writes the next batch and runs its callbacks. False where nothing waits, or the database has failed. The thread calls it; without
  /// one the owner does.
  bool step();

  /// Made with the database: workers tell by it that they talk to another one.
  const std::string& cluster_id() const { return cluster_id_; }
  uint64_t term() const { return term_; }
  /// Queues a higher term: a worker has seen this one or another leader with it. `done` runs when the new one holds.
  void raise_term(uint64_t above, std::function<void()> done);
  /// Queues `work`. `done` runs on the store's thread once it is durable; neither may call back into write() and wait.
  /// Never blocks: callers look at backlog() before they accept new work.
  void write(std::function<void(StoreSession&)> work, std::function<void()> done = {});
  /// Runs `work` in its turn and waits for the result; what it saw is durable then.
  /// An exception of `work` that is not the database's is the caller's.
  template <typename Work>
  auto read(Work work) {
    return run(std::move(work), true);
  }
  /// The same for `work` that changes nothing: alone in its turn it gives the disk nothing to do.
  template <typename Work>
  auto look(Work work) {
    return run(std::move(work), false);
  }
  /// Waits until everything queued before is durable, without giving the disk more to do. Throws std::runtime_error when the
  /// database has failed. Not for the store's own thread, nor under a lock that a callback takes.
  void flush();
  /// Calls `use_row` for all that settled (see StoreSession::settled_from), read in pages so that others are served in between.
  void each_settled(TaskRef from, std::optional<TaskState> state, bool one_frame, const std::function<void(const SettledTask&)>& use_row);
  /// The digests of results and images that rows speak of, some more than once, in pages.
  void each_digest(const std::function<void(const std::string&)>& use_digest);
  /// Copies the database to a new file, some pages after each transaction, and waits for it: the copy is the database as it was at one
  /// moment of the call. Throws std::runtime_error. Not for the store's own thread.
  void copy_to(const std::string& path);
  /// Reads a job and its frames in pages, so that others are served in between. Nothing where there is none, or it went meanwhile.
  std::optional<LoadedJob> load_job(const std::string& job_id);
  /// Queues what a job that has ended shows, some frames at a time.
  void write_counts(const std::string& job_id, const JobSummary& summary, const std::vector<FrameCounts>& frames);
  /// Lays out the tasks of a job anew, and restores what is settled of them.
  void load_tasks(Job& job);
  /// The same as `flush`, as an operation of its own.
  void barrier() {
    read([](StoreSession&) { return true; });
  }
  size_t backlog() const;

 private:
  struct Operation {
    std::function<void(StoreSession&)> work;
    std::function<void()> done;
    bool changes = true;
  };
  template <typename Work, typename Result = std::invoke_result_t<Work&, StoreSession&>>
  Result run(Work work, bool changes) {
    struct Outcome {
      std::optional<Result> result;
      std::exception_ptr error;
      std::promise<void> durable;
    };
    auto outcome = std::make_shared<Outcome>();
    auto durable = outcome->durable.get_future();
    queue({[outcome, work = std::move(work)](StoreSession& session) {
             try {
               outcome->result.emplace(work(session));
             } catch (...) {
               throw_on_if_the_database_failed();
               outcome->error = std::current_exception();
             }
           },
           [outcome] { outcome->durable.set_value(); }, changes});
    step_until_idle();
    durable.get();
    if (outcome->error) std::rethrow_exception(outcome->error);
    return std::move(*outcome->result);
  }
  struct Copy;
  void queue(Operation operation);
  void work_off();
  void step_copy();
  void end_copy(std::exception_ptr error);
  /// For who waits, where there is no thread. Throws std::runtime_error where the database has failed.
  void step_until_idle();
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
  std::shared_ptr<Copy> copy_;  ///< that is under way
  std::thread thread_;
};

}  // namespace woodcock::coordinator
