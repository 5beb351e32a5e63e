// From settled frames to images, and what happens to tiles that are damaged at rest.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>

#include "coordinator/coordinator.h"
#include "coordinator/coordinator_locked.h"
#include "coordinator/job_view.h"
#include "coordinator/preview.h"
#include "rpc/error.h"
#include "rpc/limits.h"

namespace woodcock::coordinator {
namespace {

constexpr int kAttempts = 3;

}  // namespace

/// Of a copy of the frame, `first` its task 0; the job's rounds are [0, base). `tasks` gets the task of each tile.
AssembleRequest Coordinator::assemble_request(const TaskRef& first, const Frame& frame, int64_t base, std::vector<TaskRef>& tasks,
                                              std::vector<TileCost>& costs) {
  AssembleRequest request;
  request.header = frame.pinned_header();
  request.map = frame.settled_map(base);
  store_->each_settled(first, TaskState::Done, true, [&](const SettledTask& row) {
    if (row.number >= frame.tasks.size() || frame.tasks.state(row.number) != TaskState::Done) return;
    const TaskArea area = frame.tasks.area(row.number);
    costs.push_back({area, row.result.cost.cpu_ns, row.reused});
    // Of a pass that is not complete in its block.
    if (area.range.begin >= base && area.range.end > request.map.at(area.rect.x0, area.rect.y0)) return;
    tasks.push_back({first.job, first.frame, row.number});
    request.tile_paths.push_back(blobs_.path(row.result.digest));
  });
  return request;
}

namespace {

/// The CPU time that the workers spent on the samples of each point.
template <typename Costs>
void add_times(const Frame& frame, const Costs& costs, Convergence& record) {
  double earlier = 0;
  for (const auto& tile : costs) {
    if (tile.reused) {
      earlier += static_cast<double>(tile.area.samples());
      continue;
    }
    for (ConvergencePoint& point : record.points)
      if (tile.area.range.end <= point.samples) point.cpu_seconds += 1e-9 * static_cast<double>(tile.cpu_ns);
  }
  record.timed_from = std::llround(earlier / static_cast<double>(frame.spec.header.bounds.area()));
}

}  // namespace

/// Those whose file is gone or has another digest than its name says.
std::vector<TaskRef> Coordinator::damaged_tiles(const std::vector<TaskRef>& tasks, const std::vector<std::string>& paths) const {
  std::vector<TaskRef> damaged;
  for (size_t i = 0; i < tasks.size(); ++i) {
    std::string why;
    if (blobs_.verify(paths[i].substr(paths[i].rfind('/') + 1), &why)) continue;
    damaged.push_back(tasks[i]);
    spdlog::error("the result of task {} is damaged at rest and rendered again: {}", to_string(tasks[i]), why);
  }
  return damaged;
}

void Coordinator::reopen(const std::vector<TaskRef>& tasks, const std::string& reason, bool refused_by_merge) {
  for (const TaskRef& task : tasks) {
    const std::optional<SettledTask> row = store_->look([&](StoreSession& session) { return session.settled(task); });
    if (!row || row->state != TaskState::Done) continue;
    // A good file of this name may have come meanwhile.
    if (refused_by_merge || !blobs_.verify(row->result.digest)) blobs_.remove(row->result.digest);
    locked([&] {
      const bool here = scheduler_->find(task.job) != nullptr;
      const bool reopened = here && (refused_by_merge ? scheduler_->result_refused(task, row->result, reason)
                                                      : scheduler_->reopen(task, row->result, reason));
      if (here && !reopened) return;
      store_->write([task, key = row->result.key, here](StoreSession& session) {
        session.reopen_task(task, key);
        if (!here) session.forget_counts(task.job);
      });
      if (!here) forget_stored();
      ++changes_;
    });
  }
}

bool Coordinator::is_stale(const AssembleJob& work) const {
  const Job* job = scheduler_->find(work.job);
  return !job || job->frames[static_cast<size_t>(work.frame)].revision != work.revision;
}

std::string Coordinator::temporary_file(const std::string& name) {
  const std::lock_guard lock(mutex_);
  return blobs_.temporary(name + std::to_string(++next_temporary_) + ".exr");
}

void Coordinator::merge_failed(const AssembleJob& work, const std::string& error) {
  const bool short_of_room = !blobs_.shortage().empty();
  locked([&] {
    // It is begun again after the next start.
    if (stopping_ || is_stale(work)) return;
    if (short_of_room || work.attempts + 1 < kAttempts) {
      spdlog::warn("merging a frame of job {} failed and is repeated: {}", work.job, error);
      to_assemble_.push_back({work.job, work.frame, work.attempts + (short_of_room ? 0 : 1), options_.now() + kSecond});
    } else {
      scheduler_->frame_failed(work.job, work.frame, "the image could not be merged: " + error);
    }
  });
}

void Coordinator::assemble_one(AssembleJob& work) {
  Frame frame;
  std::optional<SamplingTarget> target;
  std::string reason;
  int64_t base = 0;
  {
    const std::lock_guard lock(mutex_);
    const Job* job = scheduler_->find(work.job);
    if (!job) return;
    frame = job->frames[static_cast<size_t>(work.frame)];
    if (!frame.to_be_assembled()) return;
    work.revision = frame.revision;
    target = job->spec.target;
    base = job->spec.samples();
    if (job->spec.out_of_time()) reason = job->spec.time_limit->reason();
  }
  std::vector<TaskRef> tasks;
  std::vector<TileCost> costs;
  AssembleRequest request = assemble_request({work.job, work.frame, 0}, frame, base, tasks, costs);
  if (reason.empty()) request.target = target;
  request.prefixes = !target;
  request.closed = frame.closed_blocks();
  request.output_path = temporary_file("frame-");
  if (const std::vector<TaskRef> damaged = damaged_tiles(tasks, request.tile_paths); !damaged.empty()) {
    reopen(damaged, "the result was damaged at rest", false);
    return;
  }
  options_.failpoint("before-merge");  // all tasks of a frame are settled
  AssembleResult result = options_.assemble_tiles(request);
  options_.failpoint("after-merge");  // the image is in a temporary file
  // What was extended or reopened meanwhile is merged again.
  if (result.ok && request.target && !result.decision.done()) {
    const bool goes_on = locked([&] {
      ++changes_;
      return is_stale(work) || scheduler_->pass_decided(work.job, work.frame, result.decision, result.statistics, rpc::kMaxTasksPerJob);
    });
    if (goes_on) {
      std::error_code ignored;  // the folder is emptied at the next start
      std::filesystem::remove(request.output_path, ignored);
      return;
    }
    reason = "ended before its target: the job has as many tasks as are allowed";
    spdlog::warn("frame {} of job {} {}", work.frame, work.job, reason);
  }
  std::string digest;
  int64_t bytes = 0;
  const auto hold = std::make_shared<BlobStore::Hold>(blobs_);
  if (result.ok) {
    try {
      digest = blobs_.adopt(request.output_path, options_.now());
      hold->add(digest);
      bytes = blobs_.size(digest).value_or(0);
    } catch (const BlobError& error) {
      result.ok = false;
      result.error = error.what();
    }
  }
  options_.failpoint("after-publish");  // the image is a blob, the frame's row does not name it
  if (!result.damaged.empty()) {
    std::vector<TaskRef> damaged;
    for (const size_t i : result.damaged)
      if (i < tasks.size()) damaged.push_back(tasks[i]);
    spdlog::error("{} results of job {} are refused by the merge: {}", damaged.size(), work.job, result.error);
    reopen(damaged, "the result is not a tile of this frame: " + result.error, true);
    return;
  }
  if (!result.ok) return merge_failed(work, result.error);
  add_times(frame, costs, result.statistics.convergence);
  locked([&] {
    if (!is_stale(work)) scheduler_->frame_assembled(work.job, work.frame, digest, bytes, result.statistics, reason);
  });
  // Until the frame's row is durable.
  store_->write([](StoreSession&) {}, [hold] {});
}

void Coordinator::run_assembler() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    if (!merge_one(lock)) wake_assembler_.wait_for(lock, std::chrono::milliseconds(200));
  }
}

bool Coordinator::step_merge() {
  std::unique_lock lock(mutex_);
  return merge_one(lock);
}

bool Coordinator::merge_one(std::unique_lock<std::mutex>& lock) {
  const Time now = options_.now();
  // A frame that was extended while it is merged is merged again afterwards.
  const auto ready = std::find_if(to_assemble_.begin(), to_assemble_.end(), [&](const AssembleJob& job) {
    return job.not_before <= now && !being_assembled_.contains({job.job, job.frame});
  });
  if (ready == to_assemble_.end()) return false;
  AssembleJob job = *ready;
  to_assemble_.erase(ready);
  being_assembled_.emplace(job.job, job.frame);
  lock.unlock();
  if (const auto error = rpc::failure_of([&] { assemble_one(job); })) {
    if (const auto again = rpc::failure_of([&] { merge_failed(job, *error); }))
      spdlog::error("a frame of job {} is not merged: {}; {}", job.job, *error, *again);
  }
  lock.lock();
  being_assembled_.erase({job.job, job.frame});
  return true;
}

void Coordinator::check_image(const std::string& id, int index, const std::string& digest) {
  std::string why;
  if (blobs_.verify(digest, &why)) return;
  spdlog::error("an image of job {} is damaged at rest and merged again: {}", id, why);
  bool lost = false;
  wake(id, [&](const Job& job) {
    // Two who ask at once see the same damage.
    const FrameRow& row = job.frames[static_cast<size_t>(index)].row;
    if (row.image_digest != digest || row.state == FrameState::Assembling) return;
    scheduler_->image_lost(id, index);
    lost = true;
    ++changes_;
  });
  if (lost && !blobs_.verify(digest)) blobs_.remove(digest);
  throw rpc::RpcError(rpc::Code::kUnavailable, "the image was damaged at rest and is merged again; ask again");
}

Coordinator::FrameSeen Coordinator::see_frame(const std::string& id, uint64_t number) {
  const auto seen_in = [&](const Job& job) {
    const auto frame = std::find_if(job.frames.begin(), job.frames.end(), [&](const Frame& f) { return f.spec.header.frame == number; });
    if (frame == job.frames.end()) rpc::fail_not_found("job " + id + " has no frame " + std::to_string(number));
    return FrameSeen{frame_view(job, *frame), *frame, static_cast<int>(frame - job.frames.begin())};
  };
  {
    const std::lock_guard lock(mutex_);
    if (const Job* job = scheduler_->find(id)) {
      FrameSeen seen = seen_in(*job);
      set_waiting(seen.status, scheduler_->waiting(*job, job->frames[static_cast<size_t>(seen.index)], options_.now()));
      return seen;
    }
  }
  FrameSeen seen = seen_in(*stored(id));
  if (seen.frame.row.state == FrameState::Done || seen.frame.row.state == FrameState::Partial) return seen;
  return seen_in(stored_with_tasks(id));
}

v1::GetFrameResponse Coordinator::frame(const std::string& id, uint64_t number, bool partial) {
  v1::GetFrameResponse response;
  FrameSeen seen = see_frame(id, number);
  const Frame& frame = seen.frame;
  *response.mutable_frame() = seen.status;
  if (frame.row.state == FrameState::Done || frame.row.state == FrameState::Partial) {
    response.set_image_digest(frame.row.image_digest);
    response.set_image_bytes(frame.row.image_bytes);
    *response.mutable_statistics() = to_wire(frame.row.statistics);
    add_convergence(frame.row.statistics.convergence, response);
    blobs_.pin(frame.row.image_digest, options_.now());
    check_image(id, seen.index, response.image_digest());
    store_->flush();
    return response;
  }
  if (frame.row.state == FrameState::Assembling && !frame.row.image_digest.empty() && !partial)
    throw rpc::RpcError(rpc::Code::kUnavailable, "frame " + std::to_string(number) + " is being merged; ask again");
  if (frame.row.state == FrameState::Failed && (!partial || frame.done == 0))
    rpc::fail_precondition("frame " + std::to_string(number) + " failed: " + frame.row.reason);
  if (!partial)
    rpc::fail_precondition("frame " + std::to_string(number) + " is " + to_string(frame.row.state) +
                           "; wait for it, or ask for a partial image");
  if (frame.done == 0) rpc::fail_precondition("nothing of frame " + std::to_string(number) + " is rendered yet");
  AssembleRequest request;
  std::vector<TaskRef> tasks;
  std::vector<TaskArea> areas;
  std::vector<std::string> paths;
  request.header = frame.pinned_header();
  store_->each_settled({id, seen.index, 0}, TaskState::Done, true, [&](const SettledTask& row) {
    if (row.number >= frame.tasks.size() || frame.tasks.state(row.number) != TaskState::Done) return;
    tasks.push_back({id, seen.index, row.number});
    areas.push_back(frame.tasks.area(row.number));
    paths.push_back(blobs_.path(row.result.digest));
  });
  request.output_path = temporary_file("partial-");
  Preview preview = preview_of(request.header.bounds, areas);
  if (preview.tiles.empty())
    rpc::fail_precondition("nothing of frame " + std::to_string(number) + " can be shown yet: no pixel has its first samples");
  request.map = std::move(preview.map);
  std::vector<TaskRef> shown;
  for (const size_t i : preview.tiles) {
    shown.push_back(tasks[i]);
    request.tile_paths.push_back(paths[i]);
  }
  tasks = std::move(shown);
  if (const std::vector<TaskRef> damaged = damaged_tiles(tasks, request.tile_paths); !damaged.empty()) {
    reopen(damaged, "the result was damaged at rest", false);
    throw rpc::RpcError(rpc::Code::kUnavailable, "some tiles were damaged and are rendered again; ask again");
  }
  const AssembleResult result = options_.assemble_tiles(request);
  if (!result.ok) throw rpc::RpcError(rpc::Code::kInternal, "the partial image could not be merged: " + result.error);
  const std::string digest = blobs_.adopt(request.output_path, options_.now());
  response.set_partial(true);
  response.set_image_digest(digest);
  response.set_image_bytes(blobs_.size(digest).value_or(0));
  *response.mutable_statistics() = to_wire(result.statistics);
  return response;
}

std::pair<std::string, int64_t> Coordinator::picture(const std::string& id, uint64_t number) {
  const std::string nodes = frame(id, number, false).image_digest();
  AssembleRequest request;
  request.picture_of = blobs_.path(nodes);
  request.output_path = temporary_file("picture-");
  const AssembleResult result = options_.assemble_tiles(request);
  if (!result.ok) throw rpc::RpcError(rpc::Code::kInternal, "the picture could not be made: " + result.error);
  const std::string digest = blobs_.adopt(request.output_path, options_.now());
  return {digest, blobs_.size(digest).value_or(0)};
}

}  // namespace woodcock::coordinator
