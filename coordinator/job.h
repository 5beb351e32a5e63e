// A job as it is held in memory while it runs. What has ended is in the database only.
#pragma once

#include <deque>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "coordinator/task_table.h"

namespace woodcock::coordinator {

/// What is known of a task that is being worked on, or was and failed. Most tasks have none.
struct ActiveTask {
  bool committing = false;
  bool retry = false;   ///< waits in Frame::retry
  bool repair = false;  ///< its result was damaged after the job's time was over: it may be rendered again all the same
  uint64_t epoch = 0;   ///< of its last lease
  int expirations = 0, refusals = 0, damages = 0;
  std::string error;
  std::vector<std::string> leases;  ///< live attempts
  std::vector<std::string> failed_workers;
};

/// A task that was given up.
struct FailedTask {
  TaskArea area;
  std::string error;
};

struct Frame : FrameCounts {
  FrameSpec spec;
  FrameRow row;
  TaskTable tasks;
  std::map<int64_t, ActiveTask> active;
  std::map<int64_t, FailedTask> failures;  ///< tasks that were given up, the first kListedFailures
  bool pin_pending = false;
  std::string pin_build, pin_class;  ///< of the pin that is pending
  int64_t next_fresh = 0;            ///< tasks before this were leased, settled or put into `retry`
  /// Results that are there already were looked for among the tasks before the first number, and are being looked for before the second.
  int64_t looked_up = 0, looking_up = 0;
  std::set<int64_t> retry;  ///< open tasks to be leased again
  int splits = 0;
  std::map<std::string, int> scene_failures;  ///< how often each worker could not read the scene
  uint64_t revision = 0;                      ///< grows when a merge that is under way is not of the frame any more
  Time unfit_since = 0;                       ///< no connected worker has its build; 0: one has
  bool deciding = false;                      ///< a pass is over, and the next one not decided yet
  std::deque<int64_t> durations;              ///< wall time of the last commits, nanoseconds

  FrameHeader pinned_header() const;
  /// What the tasks raise the blocks to after the first `passes` passes that follow the job's rounds, [0, base).
  SampleMap planned_map(size_t passes, int64_t base) const;
  SampleMap planned_map(int64_t base) const { return planned_map(row.passes.size(), base); }
  /// The samples that each block has for certain: where a task of a pass is not done its block stands where it was before the pass.
  /// The job's rounds, [0, base), count as done: what they lack is a hole of the image.
  SampleMap settled_map(int64_t base) const;
  /// Blocks with a task that was given up.
  std::vector<bool> closed_blocks() const;
  /// With tasks that are not settled: its time was over.
  bool to_be_assembled() const { return row.state == FrameState::Assembling || (unsettled == 0 && deciding); }
  /// Whether its open tasks are given to workers.
  bool being_rendered() const { return !has_ended(row.state) && row.state != FrameState::Assembling; }
  /// Whether results of the task are being looked for.
  bool is_looked_up(int64_t number) const { return number >= looked_up && number < looking_up; }

  /// As in `tasks`, with those that are being committed.
  TaskState state(int64_t number) const;
  const ActiveTask* find_active(int64_t number) const;
  ActiveTask* find_active(int64_t number);
  bool any_committing() const;

  void append_round(const JobSpec& job, SampleRange round);
  void append_pass(const JobSpec& job, size_t pass);
  int64_t append_parts(int64_t number);
  /// An open task is settled, done by this result or given up.
  void add_result(int64_t number, const ResultRecord& result, bool reused);
  void give_up(int64_t number, const std::string& error);
  /// A task that was done by this result is open again.
  void remove_result(int64_t number, const ResultRecord& result);
};

inline constexpr size_t kListedFailures = 1000;

struct Job {
  JobSpec spec;
  JobRow row;
  std::vector<Frame> frames;
  size_t first_unfinished = 0;
  bool leased_ever = false;
  std::deque<std::pair<Time, int64_t>> recent;  ///< commits of the last minute: when, camera paths
  std::set<size_t> ready;                       ///< frames that may have a task to lease, or are to be pinned
  std::set<std::string> leases;                 ///< live ones
  std::map<std::string, int> workers;           ///< those that hold them, and how many each
  WaitingReason waits = WaitingReason::None;    ///< at the last tick
  Time waits_since = 0;
  WaitingReason waits_logged = WaitingReason::None;

  /// Whether no other worker may join those that render it.
  bool is_full() const { return spec.policy.max_workers > 0 && workers.size() >= spec.policy.max_workers; }
  /// Whether there may be something to lease.
  bool is_runnable() const { return !has_ended(row.state) && !row.paused && spec.policy.waits_for.empty() && !ready.empty(); }
};

/// A job as it was submitted.
Job make_job(JobSpec spec);

/// A split: the task and its first part.
struct SplitRow {
  int frame = 0;
  int64_t number = 0, first_part = 0;
};
/// Makes the tasks of a frame that has none yet, as rounds, passes and splits made them one after the other.
void lay_out(const JobSpec& job, Frame& frame, std::vector<SplitRow> splits);
/// Counts a settled task of a frame that is laid out. Splits are part of the layout, and rows of tasks that the frame has not are ignored.
void restore(Frame& frame, const SettledTask& row);

/// The same for one that is done, without what it cost. Nothing where it is settled already.
void restore_done(Frame& frame, int64_t number);

/// The frame's counts as they are kept: with its closed blocks.
FrameCounts counts_of(const Job& job, const Frame& frame);
JobSummary summary_of(const Job& job);

/// Whether a job that has ended may get more samples, a smaller error or more time.
bool can_be_extended(const Job& job);

}  // namespace woodcock::coordinator
