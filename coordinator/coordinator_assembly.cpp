// From settled frames to images, and what happens to tiles that are damaged at rest.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <filesystem>

#include "coordinator/coordinator.h"
#include "coordinator/coordinator_locked.h"
#include "coordinator/job_view.h"
#include "rpc/error.h"
#include "rpc/limits.h"

namespace woodcock::coordinator {
namespace {

constexpr int kAttempts = 3;

}  // namespace

/// mutex_ held. `tasks` gets the task of each tile.
AssembleRequest Coordinator::assemble_request(const Job& job, const Frame& frame, std::vector<TaskRef>& tasks) const {
  AssembleRequest request;
  request.header = frame.pinned_header();
  request.map = frame.settled_map(job.spec.samples());
  const auto index = static_cast<int>(&frame - job.frames.data());
  for (size_t i = 0; i < frame.tasks.size(); ++i) {
    const TaskArea& area = frame.tasks[i].area;
    if (frame.tasks[i].state != TaskState::Done) continue;
    // Of a pass that is not complete in its block.
    if (area.range.begin >= job.spec.samples() && area.range.end > request.map.at(area.rect.x0, area.rect.y0)) continue;
    tasks.push_back({job.spec.id, index, static_cast<int64_t>(i)});
    request.tile_paths.push_back(blobs_.path(frame.tasks[i].digest));
  }
  return request;
}

/// Those whose file is gone or has another digest than its name says.
std::vector<TaskRef> Coordinator::damaged_tiles(const std::vector<TaskRef>& tasks, const std::vector<std::string>& paths) const {
  std::vector<TaskRef> damaged;
  for (size_t i = 0; i < tasks.size(); ++i)
    if (!blobs_.verify(paths[i].substr(paths[i].rfind('/') + 1))) damaged.push_back(tasks[i]);
  return damaged;
}

void Coordinator::reopen(const std::vector<TaskRef>& tasks, const std::string& reason, bool refused_by_merge) {
  locked([&] {
    for (const TaskRef& task : tasks) {
      const Frame& frame = must_find(task.job).frames[static_cast<size_t>(task.frame)];
      const Task& state = frame.tasks[static_cast<size_t>(task.number)];
      if (state.state != TaskState::Done) continue;
      blobs_.remove(state.digest);
      const std::string key = result_key(frame.pinned_header(), state.area.rect, state.area.range);
      store_->write([task, key](StoreSession& session) { session.reopen_task(task, key); });
      if (refused_by_merge)
        scheduler_->result_refused(task, reason);
      else
        scheduler_->reopen(task, reason);
    }
    ++changes_;
  });
}

void Coordinator::assemble_one(const AssembleJob& work) {
  AssembleRequest request;
  std::vector<TaskRef> tasks;
  uint64_t revision = 0;
  std::string reason;
  {
    const std::lock_guard lock(mutex_);
    const Job* job = scheduler_->find(work.job);
    if (!job) return;
    const Frame& frame = job->frames[static_cast<size_t>(work.frame)];
    if (!frame.to_be_assembled()) return;
    request = assemble_request(*job, frame, tasks);
    revision = frame.revision;
    if (job->spec.out_of_time())
      reason = job->spec.time_limit->reason();
    else
      request.target = job->spec.target;
    request.prefixes = !job->spec.target;
    request.closed = frame.closed_blocks();
    request.output_path = blobs_.temporary("frame-" + std::to_string(++next_temporary_) + ".exr");
  }
  if (const std::vector<TaskRef> damaged = damaged_tiles(tasks, request.tile_paths); !damaged.empty()) {
    spdlog::error("{} tiles of job {} are damaged at rest: they are rendered again", damaged.size(), work.job);
    reopen(damaged, "the result was damaged at rest", false);
    return;
  }
  options_.failpoint("before-merge");
  AssembleResult result = options_.assemble_tiles(request);
  options_.failpoint("after-merge");
  // mutex_ held. What was extended or reopened meanwhile is merged again.
  const auto stale = [&] {
    const Job* job = scheduler_->find(work.job);
    return !job || job->frames[static_cast<size_t>(work.frame)].revision != revision;
  };
  if (result.ok && request.target && !result.decision.done()) {
    const bool goes_on = locked([&] {
      ++changes_;
      return stale() || scheduler_->pass_decided(work.job, work.frame, result.decision, result.statistics, rpc::kMaxTasksPerJob);
    });
    if (goes_on) {
      std::filesystem::remove(request.output_path);
      return;
    }
    reason = "ended before its target: the job has as many tasks as are allowed";
    spdlog::warn("frame {} of job {} {}", work.frame, work.job, reason);
  }
  std::string digest;
  int64_t bytes = 0;
  if (result.ok) {
    try {
      digest = blobs_.adopt(request.output_path, options_.now());
      bytes = blobs_.size(digest).value_or(0);
    } catch (const BlobError& error) {
      result.ok = false;
      result.error = error.what();
    }
  }
  options_.failpoint("after-publish");
  if (!result.damaged.empty()) {
    std::vector<TaskRef> damaged;
    for (const size_t i : result.damaged)
      if (i < tasks.size()) damaged.push_back(tasks[i]);
    spdlog::error("{} results of job {} are refused by the merge: {}", damaged.size(), work.job, result.error);
    reopen(damaged, "the result is not a tile of this frame: " + result.error, true);
    return;
  }
  const bool short_of_room = !blobs_.shortage().empty();
  locked([&] {
    if (stale()) return;
    if (result.ok) {
      scheduler_->frame_assembled(work.job, work.frame, digest, bytes, result.statistics, reason);
    } else if (short_of_room || work.attempts + 1 < kAttempts) {
      spdlog::warn("merging a frame of job {} failed and is repeated: {}", work.job, result.error);
      to_assemble_.push_back({work.job, work.frame, work.attempts + (short_of_room ? 0 : 1), options_.now() + kSecond});
    } else {
      scheduler_->frame_failed(work.job, work.frame, "the image could not be merged: " + result.error);
    }
  });
}

void Coordinator::run_assembler() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    const Time now = options_.now();
    const auto ready =
        std::find_if(to_assemble_.begin(), to_assemble_.end(), [&](const AssembleJob& job) { return job.not_before <= now; });
    if (ready == to_assemble_.end()) {
      wake_assembler_.wait_for(lock, std::chrono::milliseconds(200));
      continue;
    }
    const AssembleJob job = *ready;
    to_assemble_.erase(ready);
    lock.unlock();
    assemble_one(job);
    lock.lock();
  }
}

v1::GetFrameResponse Coordinator::frame(const std::string& id, uint64_t number, bool partial) {
  v1::GetFrameResponse response;
  AssembleRequest request;
  std::vector<TaskRef> tasks;
  const auto final_image = [&](const Frame& frame) {
    response.set_image_digest(frame.row.image_digest);
    response.set_image_bytes(frame.row.image_bytes);
    *response.mutable_statistics() = to_wire(frame.row.statistics);
    add_convergence(frame.row.statistics.convergence, response);
    blobs_.pin(frame.row.image_digest, options_.now());
  };
  {
    std::unique_lock lock(mutex_);
    const Job& job = must_find(id);
    const auto frame = std::find_if(job.frames.begin(), job.frames.end(), [&](const Frame& f) { return f.spec.header.frame == number; });
    if (frame == job.frames.end()) rpc::fail_not_found("job " + id + " has no frame " + std::to_string(number));
    *response.mutable_frame() = frame_view(*scheduler_, job, *frame, options_.now());
    if (frame->row.state == FrameState::Done || frame->row.state == FrameState::Partial) {
      final_image(*frame);
      lock.unlock();
      store_->flush();
      return response;
    }
    if (frame->row.state == FrameState::Failed) rpc::fail_precondition("frame " + std::to_string(number) + " failed: " + frame->row.reason);
    if (!partial)
      rpc::fail_precondition("frame " + std::to_string(number) + " is " + to_string(frame->row.state) +
                             "; wait for it, or ask for a partial image");
    if (frame->done == 0) rpc::fail_precondition("nothing of frame " + std::to_string(number) + " is rendered yet");
    request = assemble_request(job, *frame, tasks);
    request.output_path = blobs_.temporary("partial-" + std::to_string(++next_temporary_) + ".exr");
  }
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

}  // namespace woodcock::coordinator
