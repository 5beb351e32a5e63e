// How a frame is cut into tasks. Pure functions: a restart computes the same list.
#pragma once

#include <cstdint>
#include <vector>

#include "coordinator/model.h"

namespace woodcock::coordinator {

inline constexpr int kMinTileEdge = 4;         ///< pixels: a failing tile is not quartered further
inline constexpr int64_t kMinRangeLength = 8;  ///< samples: a failing range is not halved further

/// tile_grid × bounded_nodes (renderer/film/split.h): all tiles of the first range, then of the next, so that the image is there early.
std::vector<TaskArea> task_list(PixelRect bounds, int tile_size, SampleRange range, int64_t max_length);

/// The number of tasks of `task_list` without making it.
int64_t task_count(PixelRect bounds, int tile_size, SampleRange range, int64_t max_length);

/// The tasks that raise the blocks of a frame from `before` to `after`: for each block its tiles × the nodes of the samples it lacks.
/// A long node is cut so that a block's pass is some two tasks a tile, as long as they are short.
std::vector<TaskArea> pass_tasks(const SampleMap& before, const std::vector<int64_t>& after, int tile_size);

/// The samples of the longest task in a pass that raises a block to `count`.
int64_t pass_length(int64_t count);

/// How many elements `tile_grid` has, and element `index` of it; element `index` of `bounded_nodes`. They make no list.
int64_t tile_count(PixelRect bounds, int tile_size);
PixelRect tile_at(PixelRect bounds, int tile_size, int64_t index);
SampleRange bounded_node(SampleRange range, int64_t max_length, int64_t index);

/// The number of tasks of `pass_tasks` without making it.
int64_t pass_task_count(const SampleMap& before, const std::vector<int64_t>& after, int tile_size);

/// What a failing task is replaced by: four quarters (two where only one edge is long) while an edge is longer than
/// kMinTileEdge, then two halves of the range while it is longer than kMinRangeLength, then nothing. Quarters are cut at
/// even positions of the tile so that equal tiles split alike.
std::vector<TaskArea> split_task(const TaskArea& task);

}  // namespace woodcock::coordinator
