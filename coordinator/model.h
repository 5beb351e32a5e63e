// What the parts of the coordinator tell each other: plain data.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "coordinator/policy.h"
#include "coordinator/quote.h"
#include "renderer/accuracy/adaptive.h"
#include "renderer/accuracy/convergence.h"
#include "renderer/film/tile.h"
#include "renderer/frame/settings.h"

namespace woodcock::coordinator {

/// Nanoseconds of the boot-time clock, passed in wherever time matters.
using Time = int64_t;
inline constexpr Time kSecond = 1'000'000'000;

/// One task: frame and number count from 0, the number within the frame. Its wire form is "JOB.FRAME.NUMBER".
struct TaskRef {
  std::string job;
  int frame = 0;
  int64_t number = 0;

  friend bool operator==(const TaskRef&, const TaskRef&) = default;
};
std::string to_string(const TaskRef& task);
/// The inverse; nullopt for anything else.
std::optional<TaskRef> parse_task_id(const std::string& id);

struct TaskArea {
  PixelRect rect;
  SampleRange range;

  int64_t samples() const { return rect.area() * range.size(); }
  friend bool operator==(const TaskArea&, const TaskArea&) = default;
};

struct FrameSpec {
  FrameHeader header;  ///< without build and class
  std::string manifest_digest;
  std::string scene_file;
};

/// How long an adaptive job may be rendered, in seconds during which a worker holds a lease of it: what it waits or is paused
/// does not count.
struct TimeLimit {
  double seconds = 0;
  double spent = 0;  ///< saved with each pass: a crash of the coordinator gives back what the last one took

  bool over() const { return spent >= seconds; }
  /// "ended by its limit of 90 s"
  std::string reason() const;
};

/// What changes of a job after its submit: by an extension, or because a job that it waits for is done.
struct JobAim {
  std::vector<SampleRange> rounds;  ///< [0, n), cut (submit.h), and what each extension added; what follows in an adaptive job are passes
  std::optional<SamplingTarget> target;  ///< of an adaptive job
  std::optional<TimeLimit> time_limit;   ///< only with a target
  std::optional<JobQuote> quote;         ///< what the user was told that it will cost
  JobPolicy policy;

  bool out_of_time() const { return time_limit && time_limit->over(); }
  int64_t samples() const { return rounds.empty() ? 0 : rounds.back().end; }
};

struct JobSpec : JobAim {
  std::string id;
  std::string request_id;
  std::string request_digest;  ///< of the whole request: a request id is not used twice
  std::string name;
  FrameSettings settings;
  int tile_size = 64;         ///< pixels
  int64_t range_length = 64;  ///< samples of the longest task, a power of two
  int priority = 0;
  std::vector<FrameSpec> frames;  ///< empty in a `Job`, whose frames hold them
  int64_t submitted_unix_ms = 0;
};

// The database keeps these numbers.
enum class JobState { Queued = 0, Running = 1, Paused = 2, Assembling = 3, Done = 4, Partial = 5, Failed = 6, Cancelled = 7 };
enum class FrameState { Queued = 0, Running = 1, Assembling = 2, Done = 3, Partial = 4, Failed = 5, Cancelled = 6 };
enum class TaskState { Open = 0, Committing = 1, Done = 2, Split = 3, GivenUp = 4 };
const char* to_string(JobState state);
const char* to_string(FrameState state);
inline bool has_ended(JobState s) { return s >= JobState::Done; }
inline bool has_ended(FrameState s) { return s >= FrameState::Done; }

struct TaskCost {
  int64_t cpu_ns = 0, wall_ns = 0, samples = 0;
};

/// What went wrong in a render, by cause: see renderer/transport/counters.h.
struct HealthCounts {
  int64_t nonfinite = 0, clamped = 0, majorant_violations = 0, truncated = 0;

  bool any() const { return nonfinite > 0 || clamped > 0 || majorant_violations > 0 || truncated > 0; }
  HealthCounts& operator+=(const HealthCounts& o);
  HealthCounts& operator-=(const HealthCounts& o);
  friend bool operator==(const HealthCounts&, const HealthCounts&) = default;
};

/// A committed tile.
struct ResultRecord {
  std::string key;
  std::string digest;
  int64_t bytes = 0;
  TaskCost cost;
  HealthCounts health;
  std::string worker_id{};  ///< who rendered it; empty where that was not kept
};

/// A settled task's row. Done: `result`; split: the number of its first part; given up: the last error.
struct SettledTask {
  int frame = 0;
  int64_t number = 0;
  TaskState state = TaskState::Done;
  ResultRecord result;
  int64_t first_part = 0;
  std::string error;
  bool reused = false;  ///< done: an earlier job rendered it and paid for it
};

/// What error a frame reached: see renderer/accuracy ErrorEstimate.
struct FrameStatistics {
  double image_mean = 0;
  std::optional<double> standard_error, relative_error, relative_error_half_width, firefly_share;
  int64_t samples = 0, pixels = 0, missing_pixels = 0;
  /// The error of the first 16, 32, 64, … samples and of all, with the workers' CPU time. Empty for adaptive frames and for those
  /// with gaps. What an earlier job rendered took no time of this one: the times count from `timed_from` samples on.
  Convergence convergence;
};
std::string to_json(const FrameStatistics& statistics);
/// Throws std::runtime_error on malformed text.
FrameStatistics statistics_from_json(const std::string& text);

/// A frame's row beyond its spec.
struct FrameRow {
  bool pinned = false;
  std::string build, arithmetic_class;
  FrameState state = FrameState::Queued;
  std::string image_digest;
  int64_t image_bytes = 0;
  FrameStatistics statistics;
  std::string reason;
  /// Of an adaptive frame: what each pass raised its blocks to, as decided (renderer/accuracy/adaptive.h). The first pass is the
  /// job's round.
  std::vector<std::vector<int64_t>> passes;
};

/// A job's row beyond its spec.
struct JobRow {
  JobState state = JobState::Queued;
  std::string reason;
  bool paused = false;
  int64_t ended_unix_ms = 0;
  int64_t last_event = 0;
};

struct LeaseRow {
  std::string lease_id;
  TaskRef task;
  std::string worker_id;
  uint64_t epoch = 0;
};

/// The sum of two counts that are not negative, at most the largest that 64 bits hold.
constexpr int64_t capped_sum(int64_t a, int64_t b) {
  constexpr int64_t kLargest = std::numeric_limits<int64_t>::max();
  return a > kLargest - b ? kLargest : a + b;
}

/// What is counted of a frame. It is kept with the frame once its job has ended.
struct FrameCounts {
  int64_t unsettled = 0;  ///< tasks that are open or being committed
  int64_t done = 0, given_up = 0;
  int64_t samples_total = 0, samples_done = 0;
  int64_t cpu_ns = 0;         ///< that this job paid
  int64_t result_cpu_ns = 0;  ///< of the results that are there, whoever paid
  int64_t closed_blocks = 0;  ///< of an adaptive frame whose job has ended
  HealthCounts health;        ///< sum over the tasks done

  FrameCounts& operator+=(const FrameCounts& o);
  friend bool operator==(const FrameCounts&, const FrameCounts&) = default;
};
std::string to_json(const FrameCounts& counts);
/// Throws std::runtime_error on malformed text.
FrameCounts counts_from_json(const std::string& text);

/// What a job shows without its frames. It is kept with the job once that has ended.
struct JobSummary {
  int64_t frames = 0;
  FrameCounts counts;         ///< of all frames
  double pixels = 0;          ///< of all frames
  double error_square = 0;    ///< sum of the squares of the frames' relative errors
  bool errors_known = false;  ///< of every frame

  friend bool operator==(const JobSummary&, const JobSummary&) = default;
};
std::string to_json(const JobSummary& summary);
/// Throws std::runtime_error on malformed text.
JobSummary summary_from_json(const std::string& text);

/// The database keeps these numbers, and the wire has them too.
enum class EventKind {
  Submitted = 1,
  StateChanged = 2,
  FramePinned = 3,
  FrameDone = 4,
  LeaseGranted = 5,
  LeaseExpired = 6,
  LeaseReleased = 7,
  TaskCommitted = 8,
  TaskFailed = 9,
  TaskSplit = 10,
  TaskGivenUp = 11,
  StragglerCopied = 12,
  DeterminismAlarm = 13,
  Extended = 14,
  ResultRefused = 15,
  TaskReused = 16,
  PassDecided = 17,
  Waiting = 18,
};

struct JobEvent {
  int64_t number = 0;
  int64_t unix_ms = 0;
  EventKind kind = EventKind::Submitted;
  std::optional<uint64_t> frame;  ///< number of the sequence
  std::string task_id, worker_id, message;
};

/// What keeps a frame from being rendered; the wire has these numbers, and docs/operations.md says of each what to do.
enum class WaitingReason {
  None = 0,
  Paused = 1,
  DiskFull = 2,
  SceneMissing = 3,
  NoWorker = 4,
  NoFittingWorker = 5,
  WorkersUnavailable = 6,
  WorkersPause = 7,
  WorkersBusy = 8,
  LookingUp = 9,
  Committing = 10,
  Merging = 11,
  AfterJobs = 12,
  NoSuitableWorker = 13,
  MaxWorkers = 14,
};
/// Whether nothing more of the frame is leased until somebody does something about it, or another job or worker does. From the others it
/// goes on by itself.
inline bool blocks(WaitingReason reason) {
  return reason != WaitingReason::None && reason != WaitingReason::WorkersBusy && reason != WaitingReason::LookingUp &&
         reason != WaitingReason::Committing && reason != WaitingReason::Merging && reason != WaitingReason::MaxWorkers;
}

struct Waiting {
  WaitingReason reason = WaitingReason::None;
  std::string text;  ///< a sentence for people
};

/// What one attempt at a task reported.
struct AttemptRecord {
  std::string worker_id, host_name;
  uint64_t epoch = 0;
  int64_t unix_ms = 0;
  std::string message, log_excerpt;
};

// What the scheduler wants done, with all that it takes. The coordinator carries these out in order.
namespace action {
/// Make the pin durable, then call Scheduler::frame_pinned.
struct PinFrame {
  std::string job;
  int frame = 0;
  FrameRow row;  ///< pinned
};
/// Look up which of these open tasks have a result already, and settle them, then call Scheduler::results_found. The scheduler
/// neither leases nor commits them meanwhile.
struct FindResults {
  std::string job;
  int frame = 0;
  FrameHeader header;  ///< pinned
  std::vector<std::pair<int64_t, TaskArea>> tasks;
};
/// Make the commit durable, then call Scheduler::committed.
struct CommitTask {
  TaskRef task;
  int64_t parent = -1;
  ResultRecord result;
  std::string worker_id;
};
struct SplitTask {
  TaskRef task;
  int64_t first_part = 0;
};
struct GiveUpTask {
  TaskRef task;
  std::string error;
};
struct RecordAttempt {
  TaskRef task;
  AttemptRecord attempt;
};
struct SaveLease {
  LeaseRow lease;
};
struct DropLease {
  std::string lease_id;
};
/// Merge the frame's committed tiles, then call Scheduler::frame_assembled, or Scheduler::pass_decided where more is to be rendered.
struct AssembleFrame {
  std::string job;
  int frame = 0;
};
struct SaveJob {
  std::string job;
  JobAim aim;
  JobRow row;  ///< the time when it ended is the coordinator's to fill
};
struct SaveFrame {
  std::string job;
  int frame = 0;
  FrameRow row;
};
/// Forget what is settled of the frame; its row is that of a new one.
struct ResetFrame {
  std::string job;
  int frame = 0;
  FrameRow row;
};
struct LogEvent {
  std::string job;
  JobEvent event;  ///< the time is the coordinator's to fill
};
/// Call Scheduler::job_found with the state that the database has of this job, for which others wait.
struct FindJob {
  std::string job;
};
/// The job has ended. When everything before is durable call Scheduler::release, and keep what it returns in the database only.
struct ReleaseJob {
  std::string job;
};
}  // namespace action

using Action = std::variant<action::PinFrame, action::FindResults, action::CommitTask, action::SplitTask, action::GiveUpTask,
                            action::RecordAttempt, action::SaveLease, action::DropLease, action::AssembleFrame, action::SaveJob,
                            action::SaveFrame, action::ResetFrame, action::LogEvent, action::ReleaseJob, action::FindJob>;

}  // namespace woodcock::coordinator
