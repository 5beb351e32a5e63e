// How a frame is cut into parts that can be rendered apart: by a local render and by the coordinator alike.
#pragma once

#include <vector>

#include "renderer/film/dyadic.h"
#include "renderer/film/tile.h"

namespace woodcock {

/// The part of a tile inside `rect`, which it contains.
Tile cut(const Tile& tile, PixelRect rect);

/// Puts a tile's pixels into another one, which contains it.
void paste(const Tile& part, Tile& whole);

/// Puts the next node behind the others of one rectangle: siblings become their parent.
void append_node(std::vector<Tile>& nodes, Tile node);

/// The tiles of `bounds` on the grid of squares of `tile_size` pixels whose origin is pixel 0,0, row by row.
std::vector<PixelRect> tile_grid(PixelRect bounds, int tile_size);

/// The maximal dyadic nodes of `range`, those longer than `max_length` (a power of two) cut into nodes of this length.
std::vector<SampleRange> bounded_nodes(SampleRange range, int64_t max_length);

}  // namespace woodcock
