#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "renderer/film/exr_layout.h"
#include "renderer/film/merge.h"

namespace woodcock {

namespace {

/// Tiles are looked up by squares of this many pixels.
constexpr int kBlock = 64;

std::string text(PixelRect r) { return fmt::format("[{}, {}) x [{}, {})", r.x0, r.x1, r.y0, r.y1); }
std::string text(SampleRange r) { return fmt::format("{}:{}", r.begin, r.end); }

PixelRect intersection(PixelRect a, PixelRect b) {
  return {std::max(a.x0, b.x0), std::max(a.y0, b.y0), std::min(a.x1, b.x1), std::min(a.y1, b.y1)};
}

void check_headers(std::span<const MergeInput> inputs) {
  const MergeInput& first = inputs[0];
  for (const MergeInput& input : inputs) {
    if (input.header == first.header || *input.header == *first.header) continue;
    throw FilmError(input.name, "cannot be merged: " + header_difference(*first.header, first.name, *input.header, input.name));
  }
}

/// Calls f(block, i) for each square of the target that input i touches.
template <typename F>
void for_each_block(std::span<const MergeInput> inputs, PixelRect target, F&& f) {
  const int across = (target.width() + kBlock - 1) / kBlock;
  for (size_t i = 0; i < inputs.size(); ++i) {
    const PixelRect r = inputs[i].rect;
    for (int by = (r.y0 - target.y0) / kBlock; by <= (r.y1 - 1 - target.y0) / kBlock; ++by)
      for (int bx = (r.x0 - target.x0) / kBlock; bx <= (r.x1 - 1 - target.x0) / kBlock; ++bx)
        f(static_cast<size_t>(by) * static_cast<size_t>(across) + static_cast<size_t>(bx), i);
  }
}

/// Dyadic ranges are nested or disjoint. In the order of begin, then largest first, the ranges that contain the
/// current one are on a stack.
void check_overlaps_of_block(std::span<const MergeInput> inputs, std::vector<size_t>& members) {
  std::sort(members.begin(), members.end(), [&](size_t a, size_t b) {
    const SampleRange x = inputs[a].range, y = inputs[b].range;
    return std::tuple(x.begin, -x.end, a) < std::tuple(y.begin, -y.end, b);
  });
  std::vector<size_t> containing;
  for (const size_t i : members) {
    while (!containing.empty() && inputs[containing.back()].range.end <= inputs[i].range.begin) containing.pop_back();
    for (const size_t j : containing) {
      const MergeInput &a = inputs[std::min(i, j)], &b = inputs[std::max(i, j)];
      if (a.rect.overlaps(b.rect))
        throw FilmError(b.name, fmt::format("cannot be merged: its pixels {} samples {} overlap pixels {} samples {} of {}", text(b.rect),
                                            text(b.range), text(a.rect), text(a.range), a.name));
    }
    containing.push_back(i);
  }
}

/// Collects runs of pixels of rows, top to bottom, into rectangles.
class GapCollector {
 public:
  void add_run(SampleRange range, int y, int x0, int x1) {
    const Key key{range.begin, range.end, x0, x1};
    const auto [it, is_new] = open_.try_emplace(key, Gap{{x0, y, x1, y + 1}, range});
    if (is_new) return;
    if (it->second.rect.y1 != y) {
      done_.push_back(it->second);
      it->second.rect.y0 = y;
    }
    it->second.rect.y1 = y + 1;
  }

  std::vector<Gap> finish() {
    for (const auto& [key, gap] : open_) done_.push_back(gap);
    std::sort(done_.begin(), done_.end(), [](const Gap& a, const Gap& b) {
      return std::tuple(a.range.begin, a.range.end, a.rect.y0, a.rect.x0) < std::tuple(b.range.begin, b.range.end, b.rect.y0, b.rect.x0);
    });
    return std::move(done_);
  }

 private:
  using Key = std::tuple<int64_t, int64_t, int, int>;
  std::map<Key, Gap> open_;
  std::vector<Gap> done_;
};

/// Finds the largest dyadic ranges that no tile covers, pixel by pixel of one band of rows.
class BandGaps {
 public:
  BandGaps(std::span<const MergeInput> inputs, PixelRect band, GapCollector& gaps) : inputs_(inputs), band_(band), gaps_(gaps) {
    holes_.resize(static_cast<size_t>(band.area()), false);
  }

  /// `needed` marks the pixels that no tile of a larger range covers; `members` are the tiles inside `range`.
  void visit(SampleRange range, const std::vector<size_t>& members, std::vector<bool> needed) {
    std::vector<bool> in_parts(needed.size(), false);
    std::vector<size_t> left, right;
    for (const size_t i : members) {
      const MergeInput& input = inputs_[i];
      if (input.range == range) {
        for_each_pixel(input.rect, [&](size_t p) { needed[p] = false; });
      } else {
        (left_child(range).contains(input.range) ? left : right).push_back(i);
      }
    }
    for (const auto* half : {&left, &right})
      for (const size_t i : *half) for_each_pixel(inputs_[i].rect, [&](size_t p) { in_parts[p] = needed[p]; });
    const auto width = static_cast<size_t>(band_.width());
    for (size_t p = 0; p < needed.size();) {
      const size_t row_end = (p / width + 1) * width, begin = p;
      while (p < row_end && needed[p] && !in_parts[p]) holes_[p++] = true;
      if (p > begin)
        gaps_.add_run(range, band_.y0 + static_cast<int>(begin / width), x_of(begin), x_of(p - 1) + 1);
      else
        ++p;
    }
    if (left.empty() && right.empty()) return;
    visit(left_child(range), left, in_parts);
    visit(right_child(range), right, std::move(in_parts));
  }

  int64_t holes() const { return std::count(holes_.begin(), holes_.end(), true); }

 private:
  int x_of(size_t p) const { return band_.x0 + static_cast<int>(p % static_cast<size_t>(band_.width())); }

  template <typename F>
  void for_each_pixel(PixelRect rect, F&& f) const {
    const PixelRect r = intersection(rect, band_);
    for (int y = r.y0; y < r.y1; ++y)
      for (int x = r.x0; x < r.x1; ++x)
        f(static_cast<size_t>(y - band_.y0) * static_cast<size_t>(band_.width()) + static_cast<size_t>(x - band_.x0));
  }

  std::span<const MergeInput> inputs_;
  PixelRect band_;
  GapCollector& gaps_;
  std::vector<bool> holes_;
};

/// The pixels of a band that hold a node of the frame.
std::vector<bool> pixels_of_node(const NodeFileInfo& info, PixelRect band, SampleRange node) {
  std::vector<bool> pixels(static_cast<size_t>(band.area()), !info.map);
  if (!info.map) return pixels;
  for (const MapCell& cell : map_cells(*info.map, band)) {
    if (!holds_node(cell.count, node)) continue;
    for (int y = cell.rect.y0; y < cell.rect.y1; ++y)
      std::fill_n(pixels.begin() + static_cast<ptrdiff_t>(y - band.y0) * band.width() + (cell.rect.x0 - band.x0), cell.rect.width(), true);
  }
  return pixels;
}

void find_gaps(std::span<const MergeInput> inputs, NodeFileInfo& info) {
  const PixelRect rect = info.rect;
  std::vector<std::vector<size_t>> of_band(static_cast<size_t>((rect.height() + kBlock - 1) / kBlock));
  for (size_t i = 0; i < inputs.size(); ++i)
    for (int b = (inputs[i].rect.y0 - rect.y0) / kBlock; b <= (inputs[i].rect.y1 - 1 - rect.y0) / kBlock; ++b)
      of_band[static_cast<size_t>(b)].push_back(i);
  GapCollector gaps;
  for (size_t b = 0; b < of_band.size(); ++b) {
    const int y0 = rect.y0 + static_cast<int>(b) * kBlock;
    const PixelRect band{rect.x0, y0, rect.x1, std::min(rect.y1, y0 + kBlock)};
    BandGaps finder(inputs, band, gaps);
    for (const SampleRange node : info.nodes) {
      std::vector<size_t> members;
      for (const size_t i : of_band[b])
        if (node.contains(inputs[i].range)) members.push_back(i);
      finder.visit(node, members, pixels_of_node(info, band, node));
    }
    info.missing_pixels += finder.holes();
  }
  info.gaps = gaps.finish();
}

}  // namespace

NodeFileInfo plan_merge(std::span<const MergeInput> inputs, const MergeTarget& target) {
  if (inputs.empty()) throw FilmError("merge", "there are no tiles");
  for (const MergeInput& input : inputs)
    if (!is_dyadic(input.range) || input.rect.empty())
      throw FilmError(input.name,
                      fmt::format("cannot be merged: its samples {} or pixels {} make no sense", text(input.range), text(input.rect)));
  check_headers(inputs);
  NodeFileInfo info;
  info.header = *inputs[0].header;
  if (target.map) {
    info.rect = target.map->rect;
    info.samples = {0, target.map->largest()};
    if (!target.map->uniform()) info.map = target.map;
  } else {
    info.rect = target.rect.value_or(info.header.bounds);
    info.samples = inputs[0].range;
    for (const MergeInput& input : inputs)
      info.samples = {std::min(info.samples.begin, input.range.begin), std::max(info.samples.end, input.range.end)};
    if (target.samples) info.samples = *target.samples;
  }
  info.nodes = exr::nodes_of(info);
  exr::check_info(info, "the merged frame");
  for (const MergeInput& input : inputs) {
    if (!info.rect.contains(input.rect))
      throw FilmError(input.name,
                      fmt::format("cannot be merged: its pixels {} are outside the frame's {}", text(input.rect), text(info.rect)));
    if (!info.samples.contains(input.range))
      throw FilmError(input.name,
                      fmt::format("cannot be merged: its samples {} are outside the frame's {}", text(input.range), text(info.samples)));
    if (!info.map) continue;
    for (const MapCell& cell : map_cells(*info.map, input.rect))
      if (cell.count < input.range.end)
        throw FilmError(input.name, fmt::format("cannot be merged: it has samples {} where the map asks for {} only, at pixels {}",
                                                text(input.range), cell.count, text(cell.rect)));
  }
  std::vector<std::vector<size_t>> blocks;
  for_each_block(inputs, info.rect, [&](size_t block, size_t i) {
    if (block >= blocks.size()) blocks.resize(block + 1);
    blocks[block].push_back(i);
  });
  for (auto& members : blocks) check_overlaps_of_block(inputs, members);
  find_gaps(inputs, info);
  return info;
}

}  // namespace woodcock
