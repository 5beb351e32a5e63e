// Who renders what, when: a state machine without clock, thread, file or network. Events go in with the time they happened;
// what must be done about them comes out of take_actions(), in order. docs/architecture.md tells the rules.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "coordinator/job.h"
#include "coordinator/run_queue.h"

namespace woodcock::coordinator {

struct SchedulerOptions {
  uint64_t leader_term = 1;
  std::string leader_id;  ///< part of the ids of leases: leases of two leaders with one term never have the same
  Time lease = 30 * kSecond;
  Time grace = 10 * kSecond;
  Time worker_timeout = 60 * kSecond;  ///< a worker not heard of for so long is not counted as available
  int poison_workers = 3;              ///< distinct workers that must fail a task before it is split
  int max_splits_per_frame = 64;
  int max_damages = 5;              ///< of one task's result at rest, before its frame fails
  int quarantine_after = 3;         ///< tasks failed here and done elsewhere, without a success of its own
  Time first_probe = 10 * kSecond;  ///< of a quarantined worker; doubled up to 5 minutes
  Time copy_after = 5 * kSecond;    ///< a running task is not copied to an idle worker before this
  Time copy_queued_after = 2 * kSecond;
  Time forget_worker = 24 * 3600 * kSecond;  ///< of a worker that is gone for so long nothing is remembered
  Time log_wait_after = 10 * kSecond;        ///< a job that waits for so long says so in its events
  Time repin_after = 0;                      ///< a frame whose build no connected worker has starts again by itself after so long; 0: never
  RunQueue::Shares shares;
};

struct LeaseReport {
  std::string lease_id, task_id;
  uint64_t epoch = 0, renewal_counter = 0;
  int phase = 0;
  int64_t samples_done = 0;
};
struct Offer {
  std::string lease_id, task_id;
  uint64_t epoch = 0;
  ResultRecord result;
};
enum class FailureCause { Crash, OutOfMemory, Hang, SceneError, SceneMismatch, Transfer, Other };
const char* to_string(FailureCause cause);
struct FailureReport {
  std::string lease_id, task_id;
  uint64_t epoch = 0;
  FailureCause cause = FailureCause::Other;
  std::string message, log_excerpt;
  bool scene_checked = true;  ///< of a scene error: the files that the worker read have their digests
};
struct LeaseRelease {
  std::string lease_id;
  uint64_t epoch = 0;
};
/// One Sync request without its offers, which are decided one by one.
struct WorkerReport {
  std::string worker_id, host_name, build, arithmetic_class;
  uint64_t incarnation = 0, sequence = 0;
  int slots = 1, threads = 1;
  bool draining = false;
  std::vector<LeaseReport> leases;
  std::vector<std::string> offered_leases;
  std::vector<FailureReport> failures;
  std::vector<LeaseRelease> releases;
  std::vector<std::string> tags;  ///< in order, each once
  int64_t memory = 0;             ///< bytes, for all slots together; 0: not known
  bool left = false;              ///< this is its last report
};

enum class ReportStatus { Accepted, OlderIncarnation, OlderSequence };
/// Settled: what became of the task is not in memory; `verdict_of_settled` decides from its row.
enum class OfferStatus { Committed, AlreadyCommitted, UploadNeeded, Refused, Pending, Settled };
struct OfferDecision {
  OfferStatus status;
  std::string reason;
  bool alarm = false;  ///< two results of one key differ: `reason` is what to log
};
/// What an offer for a task is worth whose row this is, or that has none although its job has ended.
OfferDecision verdict_of_settled(const std::optional<SettledTask>& row, const Offer& offer);
enum class CancelReason { JobEnded = 1, TaskSettled, LeaseExpired, UnknownLease, StaleEpoch };
struct Grant {
  std::string lease_id;
  uint64_t epoch = 0;
  TaskRef task;
  TaskArea area;
  std::string result_key;
};
struct Answer {
  std::vector<Grant> grants;
  std::vector<std::pair<std::string, CancelReason>> cancellations;
  std::string notice;
};

enum class WorkerCondition { Ready = 1, Draining, Quarantined, Left };
/// A worker that was heard of within the time-out, as it reported itself and as it is treated.
struct WorkerView {
  const WorkerReport* last = nullptr;
  WorkerCondition condition = WorkerCondition::Ready;
  size_t leases = 0;
  Time silent = 0;  ///< since its last report
};

struct Progress {
  int64_t tasks_total = 0, tasks_done = 0, tasks_leased = 0, tasks_failed = 0;
  int64_t samples_total = 0, samples_done = 0, samples_in_flight = 0;
  double worker_seconds = 0, result_seconds = 0, samples_per_second = 0;
  std::optional<double> eta_seconds;
};

/// Without what is under way.
Progress progress_of(const FrameCounts& counts);

class Scheduler {
 public:
  explicit Scheduler(const SchedulerOptions& options) : options_(options), queue_(options.shares) {}

  // Jobs.
  /// A new job. Its id must be new.
  void add_job(Job job);
  void add_job(const JobSpec& spec) { add_job(make_job(spec)); }
  /// A job of the database, laid out and restored, with the leases that were live at a restart.
  void recover_job(Job job, const std::vector<LeaseRow>& leases, Time now);
  /// Gives a job up that has ended and has nothing under way; nothing for any other.
  std::optional<Job> release(const std::string& job_id);
  /// Asks for its release where the job has ended.
  void release_if_ended(const std::string& job_id);
  const Job* find(const std::string& job_id) const;
  const std::map<std::string, Job>& jobs() const { return jobs_; }
  /// These change nothing when the job has ended (extending: when it was cancelled, or failed for another reason than its time),
  /// and then return false. An extension tries failed frames again.
  bool cancel(const std::string& job_id);
  bool set_paused(const std::string& job_id, bool paused);
  bool extend(const std::string& job_id, int64_t samples);
  /// Starts the job's frames again whose build no connected worker has. Returns how many; nothing while one is being pinned or has a
  /// result on its way to the disk.
  std::optional<int64_t> repin(const std::string& job_id, Time now);
  /// Gives a job another target, or its first, and as much time as it takes or as `seconds` say. Frames that had ended are decided
  /// anew.
  bool set_target(const std::string& job_id, const SamplingTarget& target, std::optional<double> seconds = std::nullopt);
  /// For people; 0 while it has not ended.
  void set_ended_time(const std::string& job_id, int64_t unix_ms) { jobs_.at(job_id).row.ended_unix_ms = unix_ms; }

  // Workers.
  ReportStatus report(const WorkerReport& report, Time now);
  OfferDecision offer(const Offer& offer, const std::string& worker_id, bool blob_present, Time now);
  /// What the worker must be told now: grants that it has not reported yet, new ones as long as it has room.
  Answer answer(const std::string& worker_id, Time now);
  /// Expires leases and ends jobs whose time is over. Call it about every second.
  void tick(Time now);
  /// The leader has a higher term now.
  void set_leader_term(uint64_t term) { options_.leader_term = std::max(options_.leader_term, term); }
  /// No new leases while the reason is not empty (disk full).
  void hold_leasing(const std::string& reason) { hold_reason_ = reason; }
  /// Files of a scene are not here; workers that have them go on. `reason` is what its frames wait for.
  void scene_lost(const std::string& manifest_digest, const std::string& reason) { lost_scenes_[manifest_digest] = reason; }
  void scene_found(const std::string& manifest_digest);
  const std::map<std::string, std::string>& lost_scenes() const { return lost_scenes_; }

  // Answers to actions.
  /// A job of the database, or that it has none of this id: those that wait for it go on or fail, unless it still runs.
  void job_found(const std::string& job_id, std::optional<JobState> state);
  void frame_pinned(const action::PinFrame& pin);
  /// `reused`: those that are settled now.
  void results_found(const action::FindResults& asked, const std::vector<SettledTask>& reused);
  void committed(const action::CommitTask& commit, Time now);
  /// Two results of one key differ. Nothing for a job that is not in memory.
  void alarm(const TaskRef& task, const std::string& worker_id, const std::string& message);
  /// The blob of a committed task is damaged or gone: the task is open again. The frame fails when that happens to one task again
  /// and again: the disk keeps nothing. `result` is what was committed. False, and nothing is done, where the task is not done.
  bool reopen(const TaskRef& task, const ResultRecord& result, const std::string& reason);
  /// The file of a frame's image is damaged or gone: it is merged again.
  void image_lost(const std::string& job_id, int frame);
  /// The merge refused a committed result: open again, for other workers first. The frame fails when a task's
  /// results are refused again and again.
  bool result_refused(const TaskRef& task, const ResultRecord& result, const std::string& reason);
  /// `reason`: what ended the frame before its target, for people.
  void frame_assembled(const std::string& job_id, int frame, const std::string& digest, int64_t bytes, const FrameStatistics& statistics,
                       const std::string& reason = "");
  void frame_failed(const std::string& job_id, int frame, const std::string& reason);
  /// An adaptive frame goes on: the tasks of the next pass. False where the job would have more than `max_tasks`, and nothing is done.
  bool pass_decided(const std::string& job_id, int frame, const Decision& decision, const FrameStatistics& statistics, int64_t max_tasks);

  std::vector<Action> take_actions();

  // What people see.
  Progress progress(const Job& job, Time now) const;
  /// What a frame waits for. Of a frame that has not ended and has no live lease it is never nothing.
  Waiting waiting(const Job& job, const Frame& frame, Time now) const;
  std::string waiting_reason(const Job& job, const Frame& frame, Time now) const { return waiting(job, frame, now).text; }
  /// Of each frame.
  std::vector<Waiting> waiting_of_frames(const Job& job, Time now) const;
  size_t live_leases() const { return leases_.size(); }
  int64_t connected_workers(Time now) const;
  /// Those that are remembered, connected or not.
  size_t known_workers() const { return workers_.size(); }
  /// At most `limit` of them by id, those after `after`. The views hold until the next event.
  std::vector<WorkerView> list_workers(const std::string& after, size_t limit, Time now) const;

 private:
  struct Lease {
    std::string id;
    TaskRef task;
    std::string worker_id;
    uint64_t epoch = 0, counter = 0;
    Time granted = 0, last_change = 0;
    int phase = 0;
    int64_t samples_done = 0;
    int64_t threads = 1;  ///< that the worker gives it
    bool to_send = true;
  };
  struct Worker {
    WorkerReport last;
    Time last_seen = 0;
    std::set<std::string> leases;
    std::map<std::string, CancelReason> ended;  ///< leases it may still work on
    int consecutive_failures = 0, blame = 0;
    Time next_grant = 0, probe_interval = 0;
    bool quarantined = false;
  };

  /// A task of a job in memory.
  struct Place {
    Job* job = nullptr;
    Frame* frame = nullptr;
    explicit operator bool() const { return frame != nullptr; }
  };

  Job& insert(Job added);
  Job* job_of(const std::string& id);
  /// Nothing where the job is not in memory or has no such task.
  Place place_of(const TaskRef& task);
  /// The task's entry where it is open and not being committed, made when it has none; null otherwise.
  ActiveTask* open_task(const TaskRef& task);
  void look_ahead(Job& job, Frame& frame);
  void set_ready(Job& job, const Frame& frame);
  void take_turn(Job& job);
  void wait_for_jobs(Job& job);
  void stop_waiting(const Job& job);
  void tell_dependents(const std::string& job, std::optional<JobState> state);
  void fail_job(Job& job, const std::string& reason);
  void end_leases(Frame& frame, CancelReason reason);
  void save_frame(const Job& job, const Frame& frame);
  void save_job(const Job& job);
  void log(const std::string& job, EventKind kind, std::optional<uint64_t> frame, const std::string& task, const std::string& worker,
           const std::string& message);
  void set_state(Job& job, JobState state, const std::string& reason);
  void update_job(Job& job);
  void check_frame(Job& job, int frame);
  void count_time(Time now);
  void end_by_time(Job& job);
  void wake_frame(Job& job, int frame);
  void fail_frame(Job& job, int frame, const std::string& reason);

  /// What can be told of workers is the same for all frames of one build whose jobs ask for the same: it is kept in `known`.
  using KnownWaits = std::map<std::tuple<std::string_view, std::string_view, Demands>, Waiting>;
  Waiting waiting(const Job& job, const Frame& frame, Time now, KnownWaits& known) const;
  Waiting waiting_for_workers(const Job& job, const Frame& frame, Time now) const;
  void log_waits(Time now);
  void forget_workers(Time now);
  bool nobody_fits(const Job& job, const Frame& frame, Time now) const;
  bool start_again(Job& job, int frame);
  void repin_overdue(Time now);
  bool meets(const Worker& worker, const Demands& demands) const;
  bool fits(const Worker& worker, const Job& job, const Frame& frame) const;
  bool may_join(const std::string& worker_id, const Job& job) const;
  bool connected(const Worker& worker, Time now) const;
  bool available(const Worker& worker, Time now) const;
  int64_t available_workers(const Job& job, const Frame& frame, Time now) const;
  std::string unmet_demands(const Demands& demands, Time now) const;
  bool may_take(const std::string& worker_id, const Job& job, const Frame& frame, const ActiveTask& task, Time now) const;
  std::optional<int64_t> next_task(const std::string& worker_id, const Job& job, Frame& frame, Time now);
  std::optional<TaskRef> choose(const std::string& worker_id, const Worker& worker, Time now);
  std::vector<std::string> full_jobs_of(const Worker& worker) const;
  void find_stragglers(Time now);
  std::optional<TaskRef> choose_copy(const std::string& worker_id, const Worker& worker, Time now);
  void lease(const TaskRef& task, const std::string& worker_id, Worker& worker, Time now);
  void hold(Lease lease, Worker& worker, double paths);
  void give_back_all(const std::string& worker_id, Worker& worker, const std::string& why);
  void end_lease(const std::string& lease_id, std::optional<CancelReason> tell_worker);
  void requeue(const TaskRef& task);
  void settle(Frame& frame, int64_t number);
  void task_failed(const TaskRef& task, const std::string& worker_id, const std::string& why, bool counts, Time now);
  void ask_another(const TaskRef& task, const std::string& worker_id, const std::string& why);
  void split_or_give_up(const TaskRef& task, const std::string& why);
  bool scene_is_bad(const Job& job, const Frame& frame, Time now) const;
  void blame_others(const ActiveTask& task, const std::string& winner);
  bool adopt(const LeaseReport& report, const std::string& worker_id, Worker& worker, Time now);

  SchedulerOptions options_;
  std::map<std::string, Job> jobs_;                          // that run, and those that have ended and are not released yet
  RunQueue queue_;                                           // of those that have something to lease
  std::map<std::string, std::set<std::string>> dependents_;  // by the job that they wait for
  std::vector<std::string> ended_;                           // whose release is to be asked for
  std::vector<std::string> stragglers_;                      // leases that are worth a copy, the oldest first
  Time stragglers_found_ = 0;
  std::map<std::string, Worker> workers_;
  std::unordered_map<std::string, Lease> leases_;
  uint64_t next_epoch_ = 0;
  Time last_tick_ = 0;
  std::string hold_reason_;
  std::map<std::string, std::string> lost_scenes_;  // by manifest: why its frames wait
  std::vector<Action> actions_;
};

}  // namespace woodcock::coordinator
