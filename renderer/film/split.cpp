#include "renderer/film/split.h"

#include <algorithm>

namespace woodcock {

Tile cut(const Tile& tile, PixelRect rect) {
  Tile part{rect, tile.range, {}};
  part.pixels.reserve(static_cast<size_t>(rect.area()));
  for (int y = rect.y0; y < rect.y1; ++y) part.pixels.insert(part.pixels.end(), &tile.at(rect.x0, y), &tile.at(rect.x0, y) + rect.width());
  return part;
}

void paste(const Tile& part, Tile& whole) {
  for (int y = part.rect.y0; y < part.rect.y1; ++y)
    std::copy_n(&part.at(part.rect.x0, y), part.rect.width(),
                whole.pixels.begin() + static_cast<ptrdiff_t>(y - whole.rect.y0) * whole.rect.width() + (part.rect.x0 - whole.rect.x0));
}

void append_node(std::vector<Tile>& nodes, Tile node) {
  while (!nodes.empty()) {
    const Tile& left = nodes.back();
    const SampleRange both{left.range.begin, node.range.end};
    if (left.range.size() != node.range.size() || left.range.end != node.range.begin || !is_dyadic(both)) break;
    const int level = dyadic_level(node.range);
    for (size_t i = 0; i < node.pixels.size(); ++i) node.pixels[i] = merge(left.pixels[i], node.pixels[i], level);
    node.range = both;
    nodes.pop_back();
  }
  nodes.push_back(std::move(node));
}

std::vector<PixelRect> tile_grid(PixelRect bounds, int tile_size) {
  std::vector<PixelRect> tiles;
  for (int y = bounds.y0 / tile_size * tile_size; y < bounds.y1; y += tile_size)
    for (int x = bounds.x0 / tile_size * tile_size; x < bounds.x1; x += tile_size)
      tiles.push_back(
          {std::max(x, bounds.x0), std::max(y, bounds.y0), std::min(x + tile_size, bounds.x1), std::min(y + tile_size, bounds.y1)});
  return tiles;
}

std::vector<SampleRange> bounded_nodes(SampleRange range, int64_t max_length) {
  std::vector<SampleRange> ranges;
  for (const SampleRange node : dyadic_nodes(range)) {
    const int64_t step = std::min(node.size(), max_length);
    for (int64_t begin = node.begin; begin < node.end; begin += step) ranges.push_back({begin, begin + step});
  }
  return ranges;
}

}  // namespace woodcock
