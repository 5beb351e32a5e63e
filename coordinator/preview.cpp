#include "coordinator/preview.h"

#include <algorithm>
#include <map>

namespace woodcock::coordinator {
namespace {

/// Tasks are cut no finer: a cell of so many pixels lies in one task of each range.
constexpr int kCell = 4;

/// How many samples the block shows, from the areas that touch it.
int64_t count_of(PixelRect block, const std::vector<TaskArea>& done, std::vector<size_t> members) {
  std::sort(members.begin(), members.end(), [&](size_t a, size_t b) { return done[a].range.begin < done[b].range.begin; });
  std::map<int64_t, int64_t> pixels;  // that have the first n samples
  for (int y = block.y0; y < block.y1; y = (y / kCell + 1) * kCell)
    for (int x = block.x0; x < block.x1; x = (x / kCell + 1) * kCell) {
      const int x1 = std::min(block.x1, (x / kCell + 1) * kCell), y1 = std::min(block.y1, (y / kCell + 1) * kCell);
      int64_t end = 0;
      for (const size_t i : members) {
        const TaskArea& area = done[i];
        if (area.range.begin != end || !area.rect.contains({x, y, x1, y1})) continue;
        end = area.range.end;
        pixels[end] += int64_t{x1 - x} * (y1 - y);
      }
    }
  int64_t best = 0, most = 0;
  for (const auto& [count, have] : pixels)
    if (have >= most) best = count, most = have;
  return best;
}

}  // namespace

Preview preview_of(PixelRect bounds, const std::vector<TaskArea>& done) {
  Preview preview{{bounds, {}}, {}};
  const BlockGrid grid{bounds};
  for (size_t i = 0; i < done.size(); ++i)
    if (done[i].range.end <= kMaxMapSamples) preview.tiles.push_back(i);
  // A tile is taken whole or not at all: one that reaches beyond what a block shows goes, and the others are counted again.
  for (bool settled = false; !settled;) {
    std::vector<std::vector<size_t>> of_block(grid.size());
    for (const size_t i : preview.tiles) for_each_block(grid, done[i].rect, [&](size_t b) { of_block[b].push_back(i); });
    preview.map.counts.clear();
    for (size_t b = 0; b < grid.size(); ++b) preview.map.counts.push_back(count_of(grid.block(b), done, std::move(of_block[b])));
    settled = std::erase_if(preview.tiles, [&](size_t i) {
                bool fits = true;
                for_each_block(grid, done[i].rect, [&](size_t b) { fits = fits && done[i].range.end <= preview.map.counts[b]; });
                return !fits;
              }) == 0;
  }
  return preview;
}

}  // namespace woodcock::coordinator
