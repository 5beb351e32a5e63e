// The slots of the supervisor: each renders one task at a time in a child process of its own.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>

#include "rpc/convert.h"
#include "rpc/error.h"
#include "rpc/failure.h"
#include "rpc/scene_paths.h"
#include "worker/supervisor.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using Lock = std::unique_lock<std::mutex>;

constexpr milliseconds kIdleTick{100};
constexpr milliseconds kStartTimeout{60'000};
constexpr milliseconds kFirstRestart{200}, kLastRestart{10'000};
constexpr uint64_t kLogBytes = 256 * 1024;
constexpr size_t kLogsKept = 200;

/// Removes the oldest files of the folder so that one more fits.
void make_room_for_log(const fs::path& folder) {
  std::vector<std::pair<fs::file_time_type, fs::path>> logs;
  std::error_code ignored;
  fs::create_directories(folder, ignored);
  for (fs::directory_iterator it(folder, ignored), end; !ignored && it != end; it.increment(ignored)) {
    std::error_code unknown;
    logs.emplace_back(it->last_write_time(unknown), it->path());
  }
  if (logs.size() < kLogsKept) return;
  std::sort(logs.begin(), logs.end());
  for (size_t i = 0; i <= logs.size() - kLogsKept; ++i) fs::remove_all(logs[i].second, ignored);
}

}  // namespace

std::string Supervisor::log_path(const v1::TaskSpec& task, uint64_t epoch) const {
  return folder_.logs() / fmt::format("{}-{}.log", task.task_id(), epoch);
}

RenderCommand Supervisor::command_for(const v1::LeaseGrant& grant, uint64_t attempt) const {
  const v1::TaskSpec& task = grant.task();
  RenderCommand command;
  command.attempt = attempt;
  command.scene_path = folder_.assets() / "scenes" / task.manifest_digest() / task.scene_file();
  command.scene_digest = task.header().scene_digest();
  command.settings = rpc::from_wire(task.settings(), task.header().frame());
  const PixelRect rect = rpc::from_wire(task.rect(), "rect");
  command.x0 = rect.x0, command.y0 = rect.y0, command.x1 = rect.x1, command.y1 = rect.y1;
  const SampleRange range = rpc::from_wire(task.range(), "range");
  command.sample_begin = range.begin, command.sample_end = range.end;
  command.threads = options_.threads;
  command.output_path = spool_.tile_path(task.result_key());
  command.result_key = task.result_key();
  command.header = task.header().SerializeAsString();
  return command;
}

bool Supervisor::start_child(int slot, std::unique_ptr<ChildProcess>& child) {
  AttemptLog log(folder_.logs() / fmt::format("slot-{}-start.log", slot), kLogBytes);
  std::optional<ChildIdentity> identity;
  try {
    child = std::make_unique<ChildProcess>(options_.child_program, options_.child_arguments);
    identity = child->wait_until_ready(kStartTimeout, log);
  } catch (const std::system_error& error) {
    spdlog::error("slot {}: {}", slot, error.what());
  }
  const Lock lock(mutex_);
  if (!identity) {
    child.reset();
    spdlog::error("slot {}: the render process does not start; its last output: {}", slot, log.tail());
    return false;
  }
  if (!identity_) {
    identity_ = identity;
    spdlog::info("render build {}, arithmetic class {}", identity->render_build, identity->arithmetic_class);
    changed_.notify_all();
  } else if (identity_->render_build != identity->render_build || identity_->arithmetic_class != identity->arithmetic_class) {
    end(1, "the program was replaced while this worker runs: start the worker again");
    child.reset();
    return false;
  }
  return true;
}

void Supervisor::slot_loop(int slot) {
  std::unique_ptr<ChildProcess> child;
  milliseconds restart = kFirstRestart;
  Lock lock(mutex_);
  while (!finished_) {
    if (!child || !child->alive()) {
      lock.unlock();
      const bool started = start_child(slot, child);
      lock.lock();
      if (started) {
        restart = kFirstRestart;
        continue;
      }
      // What waits for this slot must not wait for ever.
      if (const auto grant = book_.next_to_render())
        book_.failed(*grant, {FailureCause::kCrash, "the render process does not start on this worker"}, "");
      pause(lock, restart);
      restart = std::min(2 * restart, kLastRestart);
      continue;
    }
    const auto grant = book_.next_to_render();
    if (!grant) {
      changed_.wait_for(lock, kIdleTick);
      continue;
    }
    lock.unlock();
    render(slot, *child, *grant);
    lock.lock();
  }
}

AttemptOutcome Supervisor::attempt(ChildProcess& child, const v1::LeaseGrant& grant, AttemptLog& log) {
  uint64_t attempt = 0;
  {
    const Lock lock(mutex_);
    attempt = ++attempts_;
  }
  const auto should_stop = [&] {
    const Lock lock(mutex_);
    return finished_ || book_.should_stop(grant.lease_id(), boot_now());
  };
  const auto progressed = [&](const ChildProgress& progress) {
    const Lock lock(mutex_);
    book_.progressed(grant.lease_id(), progress);
  };
  try {
    spool_.make_room(grant.task().result_key());
    return child.run(command_for(grant, attempt), options_.limits, log, should_stop, progressed);
  } catch (const rpc::RpcError& error) {
    // The task itself is malformed: rpc::from_wire says how.
    return AttemptFailure{FailureCause::kMismatch, error.what()};
  } catch (const std::exception& error) {
    return AttemptFailure{FailureCause::kOutput, error.what()};
  }
}

void Supervisor::render(int slot, ChildProcess& child, const v1::LeaseGrant& grant) {
  const v1::TaskSpec& task = grant.task();
  const fs::path scene = folder_.assets() / "scenes" / task.manifest_digest();
  make_room_for_log(folder_.logs());
  AttemptLog log(log_path(task, grant.epoch()), kLogBytes);
  AttemptOutcome outcome = attempt(child, grant, log);
  bool scene_checked = false;
  if (const auto* failure = std::get_if<AttemptFailure>(&outcome)) {
    spdlog::warn("slot {}: task {} failed ({}): {}", slot, task.task_id(), to_string(failure->cause), failure->reason);
    if (failure->cause == FailureCause::kScene || failure->cause == FailureCause::kMismatch) {
      // Before the scene is blamed: are these its bytes?
      const Lock store_lock(store_mutex_);
      std::string why;
      const auto error = rpc::failure_of([&] { scene_checked = store_.check(task.manifest_digest(), why); });
      if (error || !scene_checked) {
        why = "the scene is damaged in this worker's cache, and is fetched again: " + error.value_or(why);
        spdlog::error("slot {}: {}", slot, why);
        outcome = AttemptFailure{FailureCause::kTransfer, why};
      }
    }
  }
  const Lock lock(mutex_);
  try {
    if (const auto* tile = std::get_if<RenderedTile>(&outcome))
      book_.rendered(grant, *tile);
    else if (const auto* failure = std::get_if<AttemptFailure>(&outcome))
      book_.failed(grant, {failure->cause, rpc::without_folder(failure->reason, scene)}, rpc::without_folder(log.tail(), scene),
                   scene_checked);
    else
      book_.stopped(grant);
  } catch (const std::exception& error) {
    book_.failed(grant, {FailureCause::kOutput, error.what()}, "");
  }
  changed_.notify_all();
}

}  // namespace woodcock
