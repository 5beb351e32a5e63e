#include "renderer/film/merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <map>

namespace woodcock {

namespace {

/// Memory for the rows that are being put together, and for tiles that the next band needs again.
constexpr size_t kBandBytes = size_t{128} << 20;
constexpr size_t kCacheBytes = size_t{96} << 20;
constexpr int kMaxBandRows = 64;

/// Holds loaded tiles while later bands need them and there is room.
class TileCache {
 public:
  TileCache(std::span<const MergeInput> inputs, const TileLoader& load) : inputs_(inputs), load_(load) {}

  /// Calls f(tile) with tile `index`, for rows that end at y1.
  template <typename F>
  void use(size_t index, int y1, F&& f) {
    if (const auto it = kept_.find(index); it != kept_.end()) {
      f(it->second);
      return;
    }
    Tile tile = load_(index);
    check(tile, inputs_[index]);
    f(tile);
    const size_t bytes = tile.pixels.size() * sizeof(PixelStats);
    if (tile.rect.y1 <= y1 || bytes_ + bytes > kCacheBytes) return;
    bytes_ += bytes;
    kept_.emplace(index, std::move(tile));
  }

  /// Forgets the tiles that end at or above row y.
  void drop_above(int y) {
    std::erase_if(kept_, [&](const auto& entry) {
      if (entry.second.rect.y1 > y) return false;
      bytes_ -= entry.second.pixels.size() * sizeof(PixelStats);
      return true;
    });
  }
  void clear() { drop_above(std::numeric_limits<int>::max()); }

 private:
  static void check(const Tile& tile, const MergeInput& input) {
    if (!(tile.rect == input.rect) || !(tile.range == input.range) || tile.pixels.size() != static_cast<size_t>(input.rect.area()))
      throw FilmError(input.name, "cannot be merged: the tile does not hold the pixels and samples it was said to hold");
    const auto count = static_cast<float>(input.range.size());
    for (const PixelStats& pixel : tile.pixels)
      if (pixel.count != count)
        throw FilmError(input.name, fmt::format("cannot be merged: a pixel has {} samples instead of {}", pixel.count, count));
  }

  std::span<const MergeInput> inputs_;
  const TileLoader& load_;
  std::map<size_t, Tile> kept_;
  size_t bytes_ = 0;
};

/// Puts the pixels of one rectangle together: a band of rows, or the part of it whose pixels hold the same nodes.
class Band {
 public:
  Band(std::span<const MergeInput> inputs, std::span<const size_t> members, PixelRect rows, TileCache& cache)
      : inputs_(inputs), members_(members), rows_(rows), cache_(cache) {}

  /// The band of one node of the frame; missing pixels where a sample is missing.
  std::vector<PixelStats> node(SampleRange range) {
    std::vector<size_t> inside;
    for (const size_t i : members_)
      if (range.contains(inputs_[i].range) && inputs_[i].rect.overlaps(rows_)) inside.push_back(i);
    std::vector<PixelStats> pixels = assemble(range, inside);
    pixels.resize(static_cast<size_t>(rows_.area()));
    return pixels;
  }

  /// The band of the fold of all nodes.
  std::vector<PixelStats> fold_of(std::span<const SampleRange> ranges) {
    const auto order = fold_order(ranges);
    std::vector<PixelStats> sum = node(ranges[order[0]]);
    FoldWeights have(ranges[order[0]]);
    for (const size_t i : std::span(order).subspan(1)) {
      const std::vector<PixelStats> next = node(ranges[i]);
      const FoldWeights added(ranges[i]);
      for (size_t p = 0; p < sum.size(); ++p) fold_into(sum[p], have, next[p], added);
      have.add(added);
    }
    return sum;
  }

 private:
  /// The node `range` from the tiles inside it. Empty: every pixel is missing.
  std::vector<PixelStats> assemble(SampleRange range, const std::vector<size_t>& inside) {
    std::vector<size_t> left, right, exact;
    for (const size_t i : inside)
      (inputs_[i].range == range ? exact : left_child(range).contains(inputs_[i].range) ? left : right).push_back(i);
    std::vector<PixelStats> pixels;
    // With one half missing everywhere the parent is missing everywhere.
    if (!left.empty() && !right.empty()) {
      pixels = assemble(left_child(range), left);
      if (!pixels.empty()) {
        const std::vector<PixelStats> others = assemble(right_child(range), right);
        const int level = dyadic_level(range) - 1;
        if (others.empty()) pixels.clear();
        for (size_t p = 0; p < pixels.size(); ++p) pixels[p] = merge(pixels[p], others[p], level);
      }
    }
    if (!exact.empty()) pixels.resize(static_cast<size_t>(rows_.area()));
    for (const size_t i : exact) cache_.use(i, rows_.y1, [&](const Tile& tile) { copy(tile, pixels); });
    return pixels;
  }

  void copy(const Tile& tile, std::vector<PixelStats>& pixels) const {
    const int y0 = std::max(tile.rect.y0, rows_.y0), y1 = std::min(tile.rect.y1, rows_.y1);
    const int x0 = std::max(tile.rect.x0, rows_.x0), x1 = std::min(tile.rect.x1, rows_.x1);
    for (int y = y0; y < y1; ++y) {
      const size_t to = static_cast<size_t>(y - rows_.y0) * static_cast<size_t>(rows_.width()) + static_cast<size_t>(x0 - rows_.x0);
      std::copy_n(&tile.at(x0, y), x1 - x0, pixels.data() + to);
    }
  }

  std::span<const MergeInput> inputs_;
  std::span<const size_t> members_;
  PixelRect rows_;
  TileCache& cache_;
};

/// The rows of one node of the frame, or of its fold. `pixels_of(part, nodes)` makes a part whose pixels hold `nodes`; the rest
/// has no samples.
template <typename PixelsOf>
std::vector<PixelStats> band_of(const NodeFileInfo& info, std::optional<SampleRange> node, PixelRect rows, PixelsOf&& pixels_of) {
  if (!info.map) return pixels_of(rows, info.nodes);
  std::vector<PixelStats> band(static_cast<size_t>(rows.area()));
  for (const MapCell& cell : map_cells(*info.map, rows)) {
    if (cell.count == 0 || (node && !holds_node(cell.count, *node))) continue;
    const std::vector<PixelStats> pixels = pixels_of(cell.rect, dyadic_nodes({0, cell.count}));
    for (int y = cell.rect.y0; y < cell.rect.y1; ++y)
      std::copy_n(pixels.begin() + static_cast<ptrdiff_t>(y - cell.rect.y0) * cell.rect.width(), cell.rect.width(),
                  band.begin() + static_cast<ptrdiff_t>(y - rows.y0) * rows.width() + (cell.rect.x0 - rows.x0));
  }
  return band;
}

/// As many rows as the band's memory allows: one buffer for each level between the smallest tile and its node, one for
/// the fold and one to spare.
int band_rows(std::span<const MergeInput> inputs, const NodeFileInfo& info) {
  int depth = 0;
  for (const MergeInput& input : inputs)
    for (const SampleRange node : info.nodes)
      if (node.contains(input.range)) depth = std::max(depth, dyadic_level(node) - dyadic_level(input.range));
  const size_t row = static_cast<size_t>(info.rect.width()) * sizeof(PixelStats) * static_cast<size_t>(depth + 3);
  return static_cast<int>(std::clamp<size_t>(kBandBytes / row, 1, kMaxBandRows));
}

/// Which inputs reach into each band of `rows` rows.
std::vector<std::vector<size_t>> inputs_by_band(std::span<const MergeInput> inputs, PixelRect rect, int rows) {
  std::vector<std::vector<size_t>> of_band(static_cast<size_t>((rect.height() + rows - 1) / rows));
  for (size_t i = 0; i < inputs.size(); ++i)
    for (int b = (inputs[i].rect.y0 - rect.y0) / rows; b <= (inputs[i].rect.y1 - 1 - rect.y0) / rows; ++b)
      of_band[static_cast<size_t>(b)].push_back(i);
  return of_band;
}

}  // namespace

NodeFileInfo merge_tiles(std::span<const MergeInput> inputs, const TileLoader& load, const std::filesystem::path& out,
                         const MergeTarget& target, const PictureSummary* summary, const std::filesystem::path& picture) {
  const NodeFileInfo info = plan_merge(inputs, target);
  const PixelRect rect = info.rect;
  const int rows = band_rows(inputs, info);
  const auto of_band = inputs_by_band(inputs, rect, rows);

  ExrWriter writer(out, info, summary, picture);
  TileCache cache(inputs, load);
  // One node, or the fold where none is named.
  const auto write_part = [&](std::optional<SampleRange> node) {
    for (size_t b = 0; b < of_band.size(); ++b) {
      const int y0 = rect.y0 + static_cast<int>(b) * rows, y1 = std::min(rect.y1, y0 + rows);
      writer.write_rows(band_of(info, node, {rect.x0, y0, rect.x1, y1}, [&](PixelRect part, std::span<const SampleRange> nodes) {
        Band band(inputs, of_band[b], part, cache);
        return node ? band.node(*node) : band.fold_of(nodes);
      }));
      cache.drop_above(y1);
    }
    cache.clear();
  };
  if (info.nodes.size() > 1) write_part(std::nullopt);
  for (const SampleRange node : info.nodes) write_part(node);
  writer.commit();
  return info;
}

void visit_prefixes(std::span<const MergeInput> inputs, const TileLoader& load, PixelRect rect, std::span<const int64_t> counts,
                    const UseRows& use) {
  if (counts.empty()) return;
  const SampleRange all{0, counts.back()};
  std::vector<MergeInput> inside;
  std::vector<size_t> index;
  for (size_t i = 0; i < inputs.size(); ++i)
    if (inputs[i].range.begin < all.end) inside.push_back(inputs[i]), index.push_back(i);
  const NodeFileInfo info = plan_merge(inside, {rect, all, {}});
  if (info.missing_pixels > 0)
    throw FilmError(inside[0].name, fmt::format("and the others leave out samples of {} pixels", info.missing_pixels));
  const TileLoader load_inside = [&](size_t i) { return load(index[i]); };
  TileCache cache(inside, load_inside);
  const int rows = band_rows(inside, info);
  const auto of_band = inputs_by_band(inside, rect, rows);
  for (size_t b = 0; b < of_band.size(); ++b) {
    const int y0 = rect.y0 + static_cast<int>(b) * rows, y1 = std::min(rect.y1, y0 + rows);
    Band band(inside, of_band[b], {rect.x0, y0, rect.x1, y1}, cache);
    std::vector<PixelStats> picture = band.node({0, counts[0]});
    use(0, picture);
    int64_t held = counts[0];
    for (size_t c = 1; c < counts.size(); ++c) {
      for (; held < counts[c]; held *= 2) {
        const std::vector<PixelStats> next = band.node({held, 2 * held});
        for (size_t p = 0; p < picture.size(); ++p) picture[p] = merge(picture[p], next[p], dyadic_level({0, held}));
      }
      use(c, picture);
    }
    cache.drop_above(y1);
  }
}

}  // namespace woodcock
