// Which pixels of a frame hold how many samples: one count for each block of a fixed grid.
//
// The grid has squares of 32 × 32 pixels whose origin is pixel 0,0 of the full image, cut by the frame's rectangle, so that a
// block is the same whatever the tiles and the crop. A block with count n holds the samples [0, n) of each of its pixels.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "renderer/film/dyadic.h"
#include "renderer/film/tile.h"

namespace woodcock {

/// Edge of a block in pixels.
inline constexpr int kBlockEdge = 32;
/// Counts of a map reach no further: they are exact in float32, and their ranges fit into the parts of a file.
inline constexpr int64_t kMaxMapSamples = int64_t{1} << 24;

/// The blocks that touch `rect` (not empty), row by row.
struct BlockGrid {
  PixelRect rect;

  int across() const { return (rect.x1 - 1) / kBlockEdge - rect.x0 / kBlockEdge + 1; }
  int down() const { return (rect.y1 - 1) / kBlockEdge - rect.y0 / kBlockEdge + 1; }
  size_t size() const { return static_cast<size_t>(across()) * static_cast<size_t>(down()); }
  /// The block of a pixel inside `rect`.
  size_t index(int x, int y) const {
    return static_cast<size_t>(y / kBlockEdge - rect.y0 / kBlockEdge) * static_cast<size_t>(across()) +
           static_cast<size_t>(x / kBlockEdge - rect.x0 / kBlockEdge);
  }
  /// The pixels of block `i` inside `rect`.
  PixelRect block(size_t i) const;
};

/// Calls f(i) for each block of the grid that `rect`, a part of its rectangle, touches.
template <typename F>
void for_each_block(BlockGrid grid, PixelRect rect, F&& f) {
  for (int y = rect.y0; y < rect.y1; y = (y / kBlockEdge + 1) * kBlockEdge)
    for (int x = rect.x0; x < rect.x1; x = (x / kBlockEdge + 1) * kBlockEdge) f(grid.index(x, y));
}

struct SampleMap {
  PixelRect rect;
  std::vector<int64_t> counts;  ///< of each block of the grid of `rect`; 0: its pixels are missing

  BlockGrid grid() const { return {rect}; }
  int64_t at(int x, int y) const { return counts[grid().index(x, y)]; }
  int64_t largest() const;
  /// Every block holds the same: the frame is one of a plain range.
  bool uniform() const;
  /// Sum over the pixels.
  int64_t samples() const;
  friend bool operator==(const SampleMap&, const SampleMap&) = default;
};

/// Pixels that hold the same nodes of the tree.
struct MapCell {
  PixelRect rect;
  int64_t count = 0;
};

/// The map inside `rows`, a part of its rectangle, as rectangles: neighbours of equal count in a row of blocks are one.
std::vector<MapCell> map_cells(const SampleMap& map, PixelRect rows);

/// Whether `range` is one of dyadic_nodes({0, count}).
bool holds_node(int64_t count, SampleRange range);

/// The nodes that some block holds, by begin and then by end. Unlike those of a range they overlap.
std::vector<SampleRange> map_nodes(const SampleMap& map);

/// The counts as text, runs of equal ones as "COUNTxRUN": "16x40,20,24x3".
std::string to_text(std::span<const int64_t> counts);
/// The inverse for `blocks` counts; nullopt for anything else, or a count outside [0, kMaxMapSamples].
std::optional<std::vector<int64_t>> parse_counts(std::string_view text, size_t blocks);

}  // namespace woodcock
