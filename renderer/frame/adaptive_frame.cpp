#include "renderer/frame/adaptive_frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <mutex>

#include "renderer/accuracy/error_summary.h"
#include "renderer/film/exr.h"
#include "renderer/film/merge.h"
#include "renderer/film/picture_file.h"
#include "renderer/film/split.h"
#include "renderer/frame/run_units.h"

namespace woodcock {

namespace {

/// Where few blocks are left for many threads, each takes a small part of one.
constexpr int kSmallTile = 16;

/// What one thread renders at once: a part of a block, with all samples it lacks.
struct Unit {
  size_t job;  ///< of the pass
  PixelRect rect;
};

/// A block to be raised: the nodes of the samples it lacks, filled part by part.
struct BlockJob {
  size_t block;
  std::vector<Tile> nodes;
  int open = 0;  ///< units that are not done
};

std::vector<PixelStats> fold_block(const std::vector<Tile>& nodes) {
  std::vector<SampleRange> ranges;
  for (const Tile& node : nodes) ranges.push_back(node.range);
  std::vector<PixelStats> picture(nodes.front().pixels.size()), one(nodes.size());
  for (size_t p = 0; p < picture.size(); ++p) {
    for (size_t i = 0; i < nodes.size(); ++i) one[i] = nodes[i].pixels[p];
    picture[p] = fold(ranges, one);
  }
  return picture;
}

}  // namespace

BlockFrame::BlockFrame(PixelRect bounds) : map{bounds, {}} {
  const size_t size = map.grid().size();
  map.counts.assign(size, 0);
  nodes.resize(size);
  picture.resize(size);
  for (size_t b = 0; b < size; ++b) picture[b].resize(static_cast<size_t>(map.grid().block(b).area()));
}

BlockFrame read_blocks(const std::filesystem::path& nodes, const FrameHeader& header) {
  ExrReader reader(nodes);
  const NodeFileInfo& info = reader.info();
  const auto refuse = [&](const std::string& why) { throw FilmError(nodes.string(), "cannot be resumed: " + why); };
  if (const std::string other = header_difference(info.header, nodes.string(), header, "this render"); !other.empty()) refuse(other);
  if (!(info.rect == header.bounds)) refuse("it holds a part of the frame only");
  if (info.samples.begin != 0) refuse(fmt::format("its samples begin at {}, not at 0", info.samples.begin));
  if (info.samples.end > kMaxMapSamples) refuse(fmt::format("it has more than {} samples per pixel", kMaxMapSamples));
  if (info.missing_pixels > 0) refuse(fmt::format("{} pixels miss samples; render it again", info.missing_pixels));
  BlockFrame blocks(header.bounds);
  const BlockGrid grid = blocks.map.grid();
  for (size_t n = 0; n < info.nodes.size(); ++n)
    for (int row = 0; row < grid.down(); ++row) {
      const size_t first = static_cast<size_t>(row) * static_cast<size_t>(grid.across());
      const PixelRect left = grid.block(first);
      const Tile rows{{info.rect.x0, left.y0, info.rect.x1, left.y1}, info.nodes[n], reader.node_rows(n, left.y0, left.y1)};
      for (size_t b = first; b < first + static_cast<size_t>(grid.across()); ++b)
        if (holds_node(info.count_of_block(b), info.nodes[n])) blocks.nodes[b].push_back(cut(rows, grid.block(b)));
    }
  for (size_t b = 0; b < grid.size(); ++b) {
    blocks.map.counts[b] = info.count_of_block(b);
    if (!blocks.nodes[b].empty()) blocks.picture[b] = fold_block(blocks.nodes[b]);
  }
  return blocks;
}

ErrorEstimate write_blocks(const std::filesystem::path& picture, const FrameHeader& header, const BlockFrame& blocks) {
  const auto shared = std::make_shared<const FrameHeader>(header);
  std::vector<MergeInput> inputs;
  std::vector<const Tile*> tiles;
  for (const std::vector<Tile>& nodes : blocks.nodes)
    for (const Tile& node : nodes) {
      inputs.push_back({"a block", shared, node.rect, node.range});
      tiles.push_back(&node);
    }
  if (tiles.empty()) throw FilmError(picture.string(), "cannot be written: not one block is rendered");
  ErrorEstimate error;
  const PictureSummary summary = error_summary(error);
  merge_tiles(
      inputs, [&](size_t i) { return *tiles[i]; }, nodes_path(picture), {{}, {}, blocks.map}, &summary, picture);
  return error;
}

bool render_pass(const FrameRenderer& frame, const std::vector<int64_t>& counts, const PassSetting& setting, RenderProgress& progress,
                 BlockFrame& blocks, double& cpu_seconds) {
  const BlockGrid grid = blocks.map.grid();
  std::vector<BlockJob> jobs;
  for (size_t b = 0; b < grid.size(); ++b) {
    if (counts.at(b) <= blocks.map.counts[b]) continue;
    BlockJob& job = jobs.emplace_back(BlockJob{b, {}, 0});
    const PixelRect rect = grid.block(b);
    for (const SampleRange range : dyadic_nodes({blocks.map.counts[b], counts[b]}))
      job.nodes.push_back({rect, range, std::vector<PixelStats>(static_cast<size_t>(rect.area()))});
  }
  const bool few = jobs.size() < 2 * static_cast<size_t>(setting.threads) && setting.threads > 1;
  const int edge = std::min(setting.tile_size, few ? kSmallTile : kBlockEdge);
  std::vector<Unit> units;
  for (size_t j = 0; j < jobs.size(); ++j)
    for (const PixelRect rect : tile_grid(grid.block(jobs[j].block), edge)) {
      units.push_back({j, rect});
      ++jobs[j].open;
    }
  std::mutex mutex;
  const auto render_unit = [&](size_t i) {
    BlockJob& job = jobs[units[i].job];
    for (Tile& node : job.nodes) {
      const auto part = frame.render(units[i].rect, node.range, 1, progress);
      if (!part) return false;
      paste(*part, node);
    }
    const std::lock_guard lock(mutex);
    --job.open;
    return true;
  };
  cpu_seconds += run_units(units.size(), setting.threads, progress.cancel, render_unit, [&] {
    if (setting.stop()) progress.cancel = true;
    setting.tick();
  });
  bool complete = true;
  for (BlockJob& job : jobs) {
    complete = complete && job.open == 0;
    if (job.open > 0) continue;
    for (Tile& node : job.nodes) append_node(blocks.nodes[job.block], std::move(node));
    blocks.map.counts[job.block] = counts[job.block];
    blocks.picture[job.block] = fold_block(blocks.nodes[job.block]);
  }
  return complete;
}

namespace {

/// A pass by the steps of the schedule, all blocks alike: the same bits, and where it is stopped no block is far ahead of the others.
bool render_in_steps(const FrameRenderer& frame, const std::vector<int64_t>& counts, const PassSetting& setting, RenderProgress& progress,
                     BlockFrame& blocks, double& cpu_seconds) {
  while (blocks.map.counts != counts) {
    std::vector<int64_t> step = blocks.map.counts;
    for (size_t b = 0; b < step.size(); ++b) step[b] = next_count(step[b], counts[b]);
    if (!render_pass(frame, step, setting, progress, blocks, cpu_seconds)) return false;
  }
  return true;
}

}  // namespace

AdaptiveProgress render_adaptively(const FrameRenderer& frame, const SamplingTarget& target, const PassSetting& setting,
                                   RenderProgress& progress, BlockFrame& blocks, double& cpu_seconds,
                                   const std::function<void(const AdaptiveProgress&)>& before_pass) {
  AdaptiveProgress state;
  const BlockGrid grid = blocks.map.grid();
  while (true) {
    const Decision decision = decide(blocks.map,
                                     block_statistics(blocks.map,
                                                      [&](const auto& use) {
                                                        for (size_t b = 0; b < grid.size(); ++b) use(grid.block(b), blocks.picture[b]);
                                                      }),
                                     {}, target);
    state.error = decision.error;
    state.active = decision.active;
    state.samples = SampleMap{blocks.map.rect, decision.counts}.samples() - blocks.map.samples();
    state.end =
        decision.done() ? (decision.reached ? EndOfSampling::kTargetReached : EndOfSampling::kSampleLimit) : EndOfSampling::kStopped;
    if (decision.done() || setting.stop()) return state;
    ++state.pass;
    if (before_pass) before_pass(state);
    if (!render_in_steps(frame, decision.counts, setting, progress, blocks, cpu_seconds)) {
      state.end = EndOfSampling::kStopped;
      return state;
    }
  }
}

}  // namespace woodcock
