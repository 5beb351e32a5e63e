#include "coordinator/task_grid.h"

#include <algorithm>
#include <bit>

#include "renderer/film/split.h"

namespace woodcock::coordinator {

std::vector<TaskArea> task_list(PixelRect bounds, int tile_size, SampleRange range, int64_t max_length) {
  const std::vector<PixelRect> tiles = tile_grid(bounds, tile_size);
  std::vector<TaskArea> tasks;
  for (const SampleRange part : bounded_nodes(range, max_length))
    for (const PixelRect tile : tiles) tasks.push_back({tile, part});
  return tasks;
}

int64_t pass_length(int64_t count) {
  constexpr int64_t kShort = 64;
  return std::max(kShort, static_cast<int64_t>(std::bit_floor(static_cast<uint64_t>(count))) / 4);
}

int64_t tile_count(PixelRect bounds, int tile_size) {
  const auto cells = [&](int begin, int end) { return int64_t{(end - 1) / tile_size - begin / tile_size + 1}; };
  return cells(bounds.x0, bounds.x1) * cells(bounds.y0, bounds.y1);
}

PixelRect tile_at(PixelRect bounds, int tile_size, int64_t index) {
  const int across = (bounds.x1 - 1) / tile_size - bounds.x0 / tile_size + 1;
  const int x = (bounds.x0 / tile_size + static_cast<int>(index % across)) * tile_size;
  const int y = (bounds.y0 / tile_size + static_cast<int>(index / across)) * tile_size;
  return {std::max(x, bounds.x0), std::max(y, bounds.y0), std::min(x + tile_size, bounds.x1), std::min(y + tile_size, bounds.y1)};
}

SampleRange bounded_node(SampleRange range, int64_t max_length, int64_t index) {
  for (const SampleRange node : dyadic_nodes(range)) {
    const int64_t step = std::min(node.size(), max_length), parts = node.size() / step;
    if (index < parts) return {node.begin + index * step, node.begin + (index + 1) * step};
    index -= parts;
  }
  return {};
}

int64_t task_count(PixelRect bounds, int tile_size, SampleRange range, int64_t max_length) {
  int64_t ranges = 0;
  for (const SampleRange node : dyadic_nodes(range)) ranges += std::max<int64_t>(1, node.size() / max_length);
  const int64_t tiles = tile_count(bounds, tile_size);
  return ranges > kMaxSamples / tiles ? kMaxSamples : tiles * ranges;
}

int64_t pass_task_count(const SampleMap& before, const std::vector<int64_t>& after, int tile_size) {
  int64_t tasks = 0;
  const BlockGrid grid = before.grid();
  for (size_t b = 0; b < grid.size(); ++b)
    if (after[b] > before.counts[b])
      tasks += task_count(grid.block(b), std::min(tile_size, kBlockEdge), {before.counts[b], after[b]}, pass_length(after[b]));
  return tasks;
}

std::vector<TaskArea> pass_tasks(const SampleMap& before, const std::vector<int64_t>& after, int tile_size) {
  std::vector<TaskArea> tasks;
  const BlockGrid grid = before.grid();
  for (size_t b = 0; b < grid.size(); ++b) {
    if (after[b] <= before.counts[b]) continue;
    for (const SampleRange range : bounded_nodes({before.counts[b], after[b]}, pass_length(after[b])))
      for (const PixelRect tile : tile_grid(grid.block(b), std::min(tile_size, kBlockEdge))) tasks.push_back({tile, range});
  }
  return tasks;
}

std::vector<TaskArea> split_task(const TaskArea& task) {
  const PixelRect r = task.rect;
  if (std::max(r.width(), r.height()) > kMinTileEdge) {
    const auto cuts = [](int begin, int end) {
      std::vector<int> positions{begin};
      if (end - begin > kMinTileEdge) positions.push_back(begin + ((end - begin) / 2 + 1) / 2 * 2);
      positions.push_back(end);
      return positions;
    };
    const std::vector<int> xs = cuts(r.x0, r.x1), ys = cuts(r.y0, r.y1);
    std::vector<TaskArea> parts;
    for (size_t y = 0; y + 1 < ys.size(); ++y)
      for (size_t x = 0; x + 1 < xs.size(); ++x) parts.push_back({{xs[x], ys[y], xs[x + 1], ys[y + 1]}, task.range});
    return parts;
  }
  if (task.range.size() > kMinRangeLength) return {{r, left_child(task.range)}, {r, right_child(task.range)}};
  return {};
}

}  // namespace woodcock::coordinator
