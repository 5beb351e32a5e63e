#include "renderer/film/sample_map.h"

#include <algorithm>
#include <charconv>
#include <set>
#include <tuple>

namespace woodcock {

PixelRect BlockGrid::block(size_t i) const {
  const auto across_ = static_cast<size_t>(across());
  const int x = (rect.x0 / kBlockEdge + static_cast<int>(i % across_)) * kBlockEdge;
  const int y = (rect.y0 / kBlockEdge + static_cast<int>(i / across_)) * kBlockEdge;
  return {std::max(x, rect.x0), std::max(y, rect.y0), std::min(x + kBlockEdge, rect.x1), std::min(y + kBlockEdge, rect.y1)};
}

int64_t SampleMap::largest() const { return counts.empty() ? 0 : *std::max_element(counts.begin(), counts.end()); }

bool SampleMap::uniform() const {
  return std::all_of(counts.begin(), counts.end(), [&](int64_t n) { return n == counts.front(); });
}

int64_t SampleMap::samples() const {
  int64_t sum = 0;
  for (size_t i = 0; i < counts.size(); ++i) sum += grid().block(i).area() * counts[i];
  return sum;
}

std::vector<MapCell> map_cells(const SampleMap& map, PixelRect rows) {
  std::vector<MapCell> cells;
  const BlockGrid grid = map.grid();
  for (int y = rows.y0; y < rows.y1;) {
    const int y1 = std::min(rows.y1, (y / kBlockEdge + 1) * kBlockEdge);
    const size_t first_of_row = cells.size();
    for (int x = rows.x0; x < rows.x1;) {
      const int x1 = std::min(rows.x1, (x / kBlockEdge + 1) * kBlockEdge);
      const int64_t count = map.counts[grid.index(x, y)];
      if (cells.size() > first_of_row && cells.back().count == count) {
        cells.back().rect.x1 = x1;
      } else {
        cells.push_back({{x, y, x1, y1}, count});
      }
      x = x1;
    }
    y = y1;
  }
  return cells;
}

bool holds_node(int64_t count, SampleRange range) {
  // The nodes of [0, n) are the set bits of n, the largest first.
  const int64_t size = range.size();
  return (count & size) != 0 && range.begin == (count & ~(2 * size - 1));
}

std::vector<SampleRange> map_nodes(const SampleMap& map) {
  const auto less = [](SampleRange a, SampleRange b) { return std::tuple(a.begin, a.end) < std::tuple(b.begin, b.end); };
  std::set<SampleRange, decltype(less)> nodes(less);
  for (const int64_t count : std::set<int64_t>(map.counts.begin(), map.counts.end()))
    for (const SampleRange node : dyadic_nodes({0, count})) nodes.insert(node);
  return {nodes.begin(), nodes.end()};
}

std::string to_text(std::span<const int64_t> counts) {
  std::string text;
  for (size_t i = 0; i < counts.size();) {
    size_t end = i;
    while (end < counts.size() && counts[end] == counts[i]) ++end;
    if (i > 0) text += ',';
    text += std::to_string(counts[i]);
    if (end - i > 1) text.append("x").append(std::to_string(end - i));
    i = end;
  }
  return text;
}

std::optional<std::vector<int64_t>> parse_counts(std::string_view text, size_t blocks) {
  std::vector<int64_t> counts;
  const char* at = text.data();
  const char* const end = at + text.size();
  const auto number = [&](int64_t low, int64_t high) -> std::optional<int64_t> {
    int64_t value = 0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc{} || value < low || value > high) return std::nullopt;
    at = next;
    return value;
  };
  while (counts.size() < blocks) {
    const auto count = number(0, kMaxMapSamples);
    if (!count) return std::nullopt;
    size_t run = 1;
    if (at != end && *at == 'x') {
      ++at;
      const auto length = number(1, static_cast<int64_t>(blocks - counts.size()));
      if (!length) return std::nullopt;
      run = static_cast<size_t>(*length);
    }
    counts.insert(counts.end(), run, *count);
    if (at == end) break;
    if (*at++ != ',') return std::nullopt;
  }
  // A comma must be followed by a count, and the counts are as many as the blocks.
  return counts.size() == blocks && at == end && !text.ends_with(',') ? std::optional(std::move(counts)) : std::nullopt;
}

}  // namespace woodcock
