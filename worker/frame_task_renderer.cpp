#include "worker/frame_task_renderer.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <fstream>
#include <new>
#include <span>

#include "renderer/film/atomic_file.h"
#include "renderer/film/exr.h"
#include "rpc/convert.h"
#include "rpc/manifest.h"

namespace woodcock {
namespace {

/// User and system time of all threads of this process, seconds.
double cpu_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// What tells worlds apart. The number of samples is no part of it: a task says which of them it wants. Of a seed that is given it does
/// not matter which.
std::string world_key(RenderCommand command) {
  command.settings.samples.reset();
  if (command.settings.seed) command.settings.seed = 0;
  const nlohmann::json message = to_json(command);
  return command.scene_digest + command.scene_path + message.at("settings").dump();
}

void check_identity(const FrameHeader& loaded, const RenderCommand& command, const std::string& key) {
  if (command.header.empty()) return;
  v1::FrameHeader wire;
  if (!wire.ParseFromString(command.header)) throw TaskFailure(FailureCause::kMismatch, "the task's header cannot be read");
  const std::string difference = header_difference(rpc::from_wire(wire), "the job", loaded, "this worker");
  if (!difference.empty()) throw TaskFailure(FailureCause::kMismatch, "what was loaded is not what the job says: " + difference);
  if (key != command.result_key)
    throw TaskFailure(FailureCause::kMismatch, fmt::format("the result's key is {}, the coordinator expects {}", key, command.result_key));
}

void write_tile(const std::string& path, const std::string& bytes) {
  try {
    AtomicFile file(path);
    std::ofstream out(file.path(), std::ios::binary);
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    out.close();
    if (!out) throw FilmError(path, "cannot be written: is the disk full?");
    file.commit();
  } catch (const FilmError& error) {
    throw TaskFailure(FailureCause::kOutput, error.what());
  }
}

}  // namespace

void FrameTaskRenderer::begin() {
  progress_ = std::make_unique<RenderProgress>();
  phase_ = "loading";
}

ChildProgress FrameTaskRenderer::progress() const { return {phase_.load(), progress_->samples, progress_->bounces}; }

const FrameRenderer& FrameTaskRenderer::renderer_for(const RenderCommand& command, bool& reused) {
  const std::string key = world_key(command);
  for (auto it = worlds_.begin(); it != worlds_.end(); ++it) {
    if (it->key != key) continue;
    reused = true;
    worlds_.splice(worlds_.begin(), worlds_, it);
    std::optional<FrameRenderer>& renderer = worlds_.front().renderer;
    if (const auto seed = command.settings.seed; seed && *seed != renderer->header().seed) {
      FrameRenderer other = renderer->with_seed(*seed);
      renderer.emplace(std::move(other));
    }
    return *renderer;
  }
  reused = false;
  // Before the new one is built, so that no more than kWorlds are ever in memory.
  while (worlds_.size() >= kWorlds) worlds_.pop_back();
  FrameSettings settings = command.settings;
  settings.samples.reset();
  ReadOptions options;
  options.allow_unsupported = settings.allow_unsupported;
  options.warn = [](const std::string& line) { std::fprintf(stderr, "%s\n", line.c_str()); };
  const auto build = [&] { return FrameRenderer(command.scene_path, settings, options, [this](const char* phase) { phase_ = phase; }); };
  try {
    worlds_.push_front({key, build()});
  } catch (const std::bad_alloc&) {
    if (worlds_.empty()) throw;
    worlds_.clear();
    worlds_.push_front({key, build()});
  }
  return *worlds_.front().renderer;
}

std::optional<RenderedTile> FrameTaskRenderer::render(const RenderCommand& command) {
  RenderedTile result;
  const FrameRenderer& renderer = renderer_for(command, result.world_reused);
  const PixelRect rect{command.x0, command.y0, command.x1, command.y1};
  const SampleRange range{command.sample_begin, command.sample_end};
  result.result_key = result_key(renderer.header(), rect, range);
  check_identity(renderer.header(), command, result.result_key);

  phase_ = "rendering";
  const double cpu_begin = cpu_seconds();
  const auto begin = std::chrono::steady_clock::now();
  const std::optional<Tile> tile = renderer.render(rect, range, command.threads, *progress_);
  if (!tile) return std::nullopt;
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  result.cpu_seconds = cpu_seconds() - cpu_begin;
  result.samples = progress_->samples;
  result.bounces = progress_->bounces;
  {
    const std::lock_guard lock(progress_->counters_mutex);
    const PathCounters& counters = progress_->counters;
    result.nonfinite = counters.nonfinite;
    result.clamped = counters.clamped;
    result.majorant_violations = counters.majorant_violations;
    result.truncated = counters.truncated;
    const uint64_t bad = counters.nonfinite;
    if (bad > 0)
      std::fprintf(stderr, "%llu of %llu samples are not finite\n", static_cast<unsigned long long>(bad),
                   static_cast<unsigned long long>(result.samples));
    if (2 * bad > result.samples)
      throw TaskFailure(FailureCause::kNonFinite, fmt::format("{} of {} samples are not finite", bad, result.samples));
  }
  const std::string bytes = encode_exr(renderer.header(), std::span(&*tile, 1));
  result.path = command.output_path;
  result.bytes = bytes.size();
  result.digest = rpc::blob_digest(bytes);
  write_tile(command.output_path, bytes);
  return result;
}

}  // namespace woodcock
