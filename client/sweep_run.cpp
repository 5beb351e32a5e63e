#include "client/sweep_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "client/local_render.h"
#include "renderer/accuracy/error_summary.h"
#include "renderer/film/exr.h"
#include "renderer/film/picture_file.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;
constexpr int kTileSize = 16;

}  // namespace

std::string picture_name(const SweepRun& run, int64_t samples) { return fmt::format("{}-{}spp.exr", run.id, samples); }

void replace_nodes(const SweepRun& run, const SweepStore& store, RunRecord& record, const std::string& name) {
  const std::string old = record.nodes;
  record.nodes = name;
  store.save(run.id, record);
  const bool kept = std::any_of(record.points.begin(), record.points.end(), [&](const RunPoint& p) { return p.picture == old; });
  if (old.empty() || old == name || kept) return;
  fs::remove(store.picture(old));
  fs::remove(nodes_path(store.picture(old)));
}

void add_point(const SweepRun& run, const SweepStore& store, RunRecord& record, const std::string& name, const MeasurePicture& measure) {
  const fs::path picture = store.picture(name);
  record.samples = run.samples;
  record.points.push_back(
      {run.samples, record.cpu_seconds, measure(picture), estimate_error(nodes_of(picture)).relative_mse, run.keep ? name : std::string()});
  replace_nodes(run, store, record, name);
}

LocalSweep::LocalSweep(const SweepOptions& options, int threads, const std::atomic<bool>& stop, std::function<void(uint64_t samples)> tick)
    : options_(options), threads_(threads), stop_(stop), tick_(std::move(tick)) {}

const FrameRenderer& LocalSweep::frame(const std::string& curve, const FrameSettings& settings) {
  const auto known = frames_.find(curve);
  if (known != frames_.end()) return known->second;
  ReadOptions read;
  read.allow_outside_files = options_.allow_outside_files;
  return frames_.emplace(curve, FrameRenderer(options_.scene, settings, read)).first->second;
}

bool LocalSweep::finish(const SweepRun& run, const SweepStore& store, RunRecord& record, const MeasurePicture& measure) {
  const FrameRenderer frame = this->frame(run.curve, run.settings).with_seed(*run.settings.seed);
  std::vector<Tile> earlier;
  if (!record.nodes.empty()) earlier = earlier_nodes(nodes_of(store.picture(record.nodes)), frame.header());
  RenderProgress progress;
  uint64_t told = 0;
  const auto tell = [&] {
    const uint64_t now = progress.samples;
    tick_(now - std::exchange(told, now));
  };
  const LocalRender result =
      render_locally(frame, {record.samples, run.samples}, std::move(earlier), kTileSize, threads_, progress, stop_, tell);
  tell();
  // An interrupted first pass is no picture.
  if (result.samples.end == record.samples || result.nodes.empty()) return false;
  const std::string name = picture_name(run, result.samples.end);
  const fs::path picture = store.picture(name);
  write_exr(nodes_path(picture), frame.header(), result.nodes, &kErrorSummary, picture);
  record.cpu_seconds += result.convergence.points.back().cpu_seconds;
  if (result.complete) {
    add_point(run, store, record, name, measure);
  } else {
    record.samples = result.samples.end;
    replace_nodes(run, store, record, name);
  }
  return result.complete;
}

}  // namespace woodcock
