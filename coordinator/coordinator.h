// Carries the scheduler's actions to store, blobs and assembler, and their answers back. One mutex guards the scheduler; it is
// never held while the disk is written or a service called back.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "coordinator/assembler.h"
#include "coordinator/backup.h"
#include "coordinator/blob_store.h"
#include "coordinator/failpoint.h"
#include "coordinator/retention.h"
#include "coordinator/scheduler.h"
#include "coordinator/store.h"
#include "rpc/error.h"
#include "woodcock/v1/jobs_service.pb.h"
#include "woodcock/v1/scenes_service.pb.h"
#include "woodcock/v1/workers_service.pb.h"

namespace woodcock::coordinator {

struct CoordinatorOptions {
  std::string dir;
  std::string address;  ///< as told to workers; may be set later by set_address
  SchedulerOptions scheduler;
  int64_t min_free_bytes = 64 << 20;
  Time pin = 3600 * kSecond;
  Time sync_hold = 10 * kSecond;      ///< how long an idle worker's call is held
  Time busy_sync_hold = 2 * kSecond;  ///< and that of one that renders, at least: how old its progress may be
  size_t max_backlog = 50'000;        ///< operations that wait for the database
  AssembleFunction assemble_tiles = assemble;
  int merges_at_once = 1;                                   ///< of settled frames
  bool clean_up_by_itself = true;                           ///< every ten minutes; otherwise when clean_up() is called
  RetentionLimits retention;                                ///< of jobs that have ended
  std::string scene_reader;                                 ///< the program `woodcock`; empty: there is none, and no scenes are read
  std::function<Time()> now;                                ///< boot-time clock
  std::function<int64_t()> unix_ms;                         ///< wall clock, for people only
  std::function<void(const std::string& reason)> on_fatal;  ///< must not return
  Failpoint failpoint = [](const char*) {};
  std::function<std::string()> make_id = random_id;  ///< of a new cluster, and of this leader
  /// False: it works when it is called, and its owner calls the steps below; how much one transaction writes is the owner's as well.
  bool own_threads = true;
  size_t store_batch = 512;
  /// Frames of a new job that one transaction writes: some milliseconds of the database.
  size_t frames_a_step = 250;
};

/// CLOCK_BOOTTIME, in nanoseconds.
Time boot_time();
int64_t unix_time_ms();

/// Throws RpcError kNotFound: there is no job of this id; kInvalidArgument where the id is empty.
[[noreturn]] void fail_no_job(const std::string& id);

class Coordinator {
 public:
  /// Opens the folder and recovers what is in it. Throws std::runtime_error with a sentence for people.
  explicit Coordinator(const CoordinatorOptions& options);
  /// Ends held calls with UNAVAILABLE, writes what is queued.
  ~Coordinator();

  BlobStore& blobs() { return blobs_; }
  Time now() const { return options_.now(); }
  void set_address(const std::string& address);

  // What JobsService offers. They block until all that the answer tells is durable, and throw RpcError.
  v1::SubmitJobResponse submit(const v1::SubmitJobRequest& request);
  v1::Job job(const std::string& id);
  v1::ListJobsResponse list(int page_size, const std::string& page_token);
  v1::ListResultsResponse results(const std::string& id, int page_size, const std::string& page_token);
  v1::ListWorkersResponse list_workers(int page_size, const std::string& page_token);
  v1::Job cancel(const std::string& id);
  v1::Job set_paused(const std::string& id, bool paused);
  v1::Job extend(const std::string& id, int64_t samples, std::optional<double> target_error, double max_seconds = 0);
  v1::RepinJobResponse repin(const std::string& id);
  v1::GetFrameResponse frame(const std::string& id, uint64_t frame, bool partial);
  /// The picture of a finished frame as a blob, with its size. Throws as frame() does.
  std::pair<std::string, int64_t> picture(const std::string& id, uint64_t frame);
  /// Reads a scene and submits it (scene_reader.h).
  v1::SubmitSceneResponse submit_scene(const v1::SubmitSceneRequest& request);
  v1::ListEventsResponse events(const std::string& id, int page_size, const std::string& page_token);
  /// Forgets a job that has ended; with `cancel` it is made to end. Its rows go in the background, its files by the next clean-ups.
  void remove(const std::string& id, bool cancel);
  /// What goes by the limits of retention; without a dry run it goes now.
  v1::RetainJobsResponse retain(const v1::RetainJobsRequest& request);
  std::vector<v1::TaskAttempt> task_log(const std::string& job_id, const std::string& task_id);
  /// Events after the cursor, at most 1000, and the job now. `finished`: it has ended and there are no more events.
  v1::WatchJobResponse watch(const std::string& id, int64_t after_event, bool& finished);

  // What WorkersService offers. `done` is called exactly once, from any thread, unless cancel_sync returns true.
  using SyncDone = std::function<void(const rpc::Outcome&, const v1::SyncResponse&)>;
  uint64_t sync(const v1::SyncRequest& request, SyncDone done);
  bool cancel_sync(uint64_t token);
  /// Answers all held calls with UNAVAILABLE and refuses new ones.
  void stop_syncs();

  /// A blob could not be handed out. Unless it can be read after all it is thrown away, so that it is asked for again, and jobs whose
  /// scene it belongs to say what they wait for.
  void blob_lost(const std::string& digest);

  /// What the coordinator does every ten minutes: finishes deletions, lets jobs go by the limits of retention, removes blobs that nothing
  /// needs. Says which jobs went.
  v1::RetainJobsResponse clean_up();
  /// Removes blobs that nothing needs.
  size_t sweep();
  /// Writes database and blobs, as they are at one moment, to a new folder (backup.h) while everything goes on. Throws std::runtime_error.
  BackupRecord back_up(const std::string& target);

  // What its threads do, for who drives it without them. False where there was nothing to do.
  /// The database writes one transaction.
  bool step_store() { return store_->step(); }
  /// One frame is merged.
  bool step_merge();
  /// Expires what is over; about once a second.
  void tick();
  /// Answers held calls whose time is over; about ten times a second.
  void answer_overdue();

 private:
  friend class CoordinatorInside;  // of tests that compare what is in memory with the database
  struct HeldSync {
    uint64_t token = 0;
    uint64_t sequence = 0;
    std::vector<Offer> offers;
    std::vector<bool> present;                                  ///< parallel to offers: whether the blob is here
    std::shared_ptr<BlobStore::Hold> hold;                      ///< of their blobs
    std::vector<bool> asked;                                    ///< parallel to offers: the database is asked
    std::vector<std::pair<OfferStatus, std::string>> verdicts;  ///< parallel to offers
    Time deadline = 0;
    uint64_t tried = 0;  ///< value of changes_ when grants were last tried
    bool retry_later = false;
    SyncDone done;
  };
  struct AssembleJob {
    std::string job;
    int frame = 0;
    int attempts = 0;
    Time not_before = 0;
    uint64_t revision = 0;  ///< of the frame when its merge began
  };
  /// What a tile of a frame cost.
  struct TileCost {
    TaskArea area;
    int64_t cpu_ns = 0;
    bool reused = false;
  };
  /// A frame at one moment.
  struct FrameSeen {
    v1::FrameStatus status;
    Frame frame;
    int index = 0;
  };
  using Completions = std::vector<std::function<void()>>;

  void recover();
  Time sync_hold(bool busy) const;  // mutex_ held
  Completions pump();               // mutex_ held: carries out actions, answers held calls; the caller runs the result unlocked
  void carry_out(const Action& action);
  bool try_answer(const std::string& worker_id, HeldSync& held, Completions& completions);
  void decide_offers(const std::string& worker_id, HeldSync& held);
  void ask_store(const std::string& worker_id, HeldSync& held, size_t offer);
  void tell_committed(const action::CommitTask& commit);
  std::shared_ptr<BlobStore::Hold> hold_of(const std::string& worker_id) const;
  void raise_alarm(const TaskRef& task, const std::string& worker_id, const std::string& message);
  void find_results(const action::FindResults& find);
  void find_job(const std::string& id);
  void release(const std::string& job);
  /// Refuses by name a worker that believes to talk to another coordinator than this one: nothing of its report concerns us.
  bool meets_a_stranger(const v1::SyncRequest& request, const SyncDone& done);
  template <typename Work>
  auto locked(Work work);
  /// mutex_ held. Throws RpcError kNotFound where it is not in memory: see wake() for jobs that have ended.
  const Job& must_find(const std::string& id) const;
  /// A job of the database as it shows itself, without tasks. The last one is kept: who fetches a sequence asks for its frames one by
  /// one. Throws RpcError kNotFound.
  std::shared_ptr<const Job> stored(const std::string& id);
  void forget_stored();
  Job stored_with_tasks(const std::string& id);
  /// Makes a new job durable, one of many frames in steps. False where an earlier request did. Throws RpcError.
  bool insert_job(NewJob& rows);
  bool insert_in_steps(NewJob& rows);
  class Arrival;
  void must_exist(const std::string& id);
  /// Runs `work` with the mutex held and the job in memory, read from the database where it has ended. Throws RpcError kNotFound.
  template <typename Work>
  void wake(const std::string& id, Work work);
  /// Runs `work` with the mutex held and the job in memory. Throws RpcError kFailedPrecondition where it has ended, kNotFound.
  template <typename Work>
  void while_running(const std::string& id, Work work);
  std::vector<TaskRef> damaged_tiles(const std::vector<TaskRef>& tasks, const std::vector<std::string>& paths) const;
  FrameSeen see_frame(const std::string& id, uint64_t number);
  std::string temporary_file(const std::string& name);
  void reopen(const std::vector<TaskRef>& tasks, const std::string& reason, bool refused_by_merge);
  AssembleRequest assemble_request(const TaskRef& first, const Frame& frame, int64_t base, std::vector<TaskRef>& tasks,
                                   std::vector<TileCost>& costs);
  void assemble_one(AssembleJob& job);
  /// mutex_ held. Whether the frame was extended, reopened or ended since its merge began.
  bool is_stale(const AssembleJob& job) const;
  void merge_failed(const AssembleJob& job, const std::string& error);
  /// A sentence when a file of the scene, or the manifest itself, is not here.
  std::string lacking(const std::string& manifest_digest) const;
  void look_for_lost_scenes();
  /// Throws RpcError kUnavailable, and has the image merged again, when its file is damaged.
  void check_image(const std::string& job, int frame, const std::string& digest);
  void run_assembler();
  /// Takes a frame that is to be merged, and merges it without the lock. False where none is ready.
  bool merge_one(std::unique_lock<std::mutex>& lock);
  void run_ticker();
  void run_housekeeper();
  bool stopping() const;
  /// A wall clock that does not jump ahead: what is counted in days must not go because of one.
  int64_t retention_unix_ms() const;
  /// What rows and manifests refer to, and since when that was looked for.
  struct Referenced {
    BlobStore::Mark mark;
    DigestSet digests;
    /// Of some scenes the list of files cannot be read: what was written before may be one of them. 0: all lists were read.
    int64_t keep_before_unix_ms = 0;
  };
  Referenced find_referenced();
  /// True: nobody finds the job any more. False where it is in memory, or does not exist, or runs.
  bool take_out(const std::string& id);
  /// Deletes what is left of jobs that were taken out.
  void purge();
  void purge(const std::string& id);
  /// housekeeping_ held for these.
  /// With the bytes that jobs have where `measure` asks for them, or a limit does.
  v1::RetainJobsResponse clean_up_alone(bool measure);
  /// Replaces `referenced` where something went.
  v1::RetainJobsResponse apply_limits(Referenced& referenced);
  size_t remove_unreferenced(const Referenced& referenced);

  const CoordinatorOptions options_;
  BlobStore blobs_;
  std::unique_ptr<Store> store_;

  std::mutex last_stored_mutex_;  // taken last
  // Guarded by last_stored_mutex_:
  std::shared_ptr<const Job> last_stored_;
  uint64_t woken_ = 0;             ///< times that a job came back from the database, or its rows changed there
  std::timed_mutex housekeeping_;  // taken first: one clean-up or back-up at a time
  std::mutex wake_mutex_;          // taken before mutex_: one job at a time comes back to memory, or goes for ever
  mutable std::mutex mutex_;
  std::condition_variable wake_assembler_;
  std::condition_variable wake_ticker_;
  std::condition_variable wake_housekeeper_;
  std::condition_variable arrived_;
  // Guarded by mutex_:
  std::unique_ptr<Scheduler> scheduler_;
  std::multiset<std::string> arriving_;  ///< jobs whose rows are being written, and which are not in the scheduler yet
  std::map<std::string, HeldSync> held_;
  std::map<std::string, std::shared_ptr<BlobStore::Hold>> answered_holds_;  ///< by worker, of the calls that one pump answers
  std::deque<AssembleJob> to_assemble_;
  std::set<std::pair<std::string, int>> being_assembled_;  // job and frame
  std::string address_;
  uint64_t next_token_ = 0;
  uint64_t changes_ = 1;
  uint64_t next_temporary_ = 0;
  bool stopping_ = false;
  bool to_purge_ = true;   // jobs were taken out, or may have been before the start
  std::string leader_id_;  // of this start; constant
  Time started_ = 0;
  int64_t started_unix_ms_ = 0;
  std::string shortage_;  // of room on the disk, as the ticker saw it last; its own

  std::vector<std::thread> assemblers_;
  std::thread ticker_;
  std::thread housekeeper_;
};

}  // namespace woodcock::coordinator
