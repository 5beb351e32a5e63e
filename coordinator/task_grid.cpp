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

int64_t task_count(PixelRect bounds, int tile_size, SampleRange range, int64_t max_length) {
  const auto cells = [&](int begin, int end) { return int64_t{(end - 1) / tile_size - begin / tile_size + 1}; };
  int64_t ranges = 0;
  for (const SampleRange node : dyadic_nodes(range)) ranges += std::max<int64_t>(1, node.size() / max_length);
  const int64_t tiles = cells(bounds.x0, bounds.x1) * cells(bounds.y0, bounds.y1);
  return ranges > kMaxSamples / tiles ? kMaxSamples : tiles * ranges;
}

std::vector<TaskArea> pass_tasks(const SampleMap& before, const std::vector<int64_t>& after, int tile_size) {
  constexpr int64_t kShort = 64;
  std::vector<TaskArea> tasks;
  const BlockGrid grid = before.grid();
  for (size_t b = 0; b < grid.size(); ++b) {
    if (after[b] <= before.counts[b]) continue;
    const int64_t length = std::max(kShort, static_cast<int64_t>(std::bit_floor(static_cast<uint64_t>(after[b]))) / 4);
    for (const SampleRange range : bounded_nodes({before.counts[b], after[b]}, length))
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
