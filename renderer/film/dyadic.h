// Ranges of sample indices, their dyadic nodes, and the two ways to put nodes together: the tree, for a dyadic range,
// and the fold, for any other.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "renderer/film/node.h"

namespace woodcock {

/// Sample indices [begin, end), 0 ≤ begin ≤ end.
struct SampleRange {
  int64_t begin = 0;
  int64_t end = 0;

  int64_t size() const { return end - begin; }
  bool empty() const { return end <= begin; }
  bool contains(SampleRange r) const { return begin <= r.begin && r.end <= end; }
  bool overlaps(SampleRange r) const { return begin < r.end && r.begin < end; }
  friend bool operator==(SampleRange, SampleRange) = default;
};

/// Ranges reach no further than this; it keeps every sum of two ends inside int64.
inline constexpr int64_t kMaxSamples = int64_t{1} << 62;

/// Whether the range is one node [k·2^j, (k+1)·2^j) of the tree.
inline bool is_dyadic(SampleRange r) {
  if (r.begin < 0 || r.empty() || r.end > kMaxSamples) return false;
  const auto size = static_cast<uint64_t>(r.size());
  return std::has_single_bit(size) && (static_cast<uint64_t>(r.begin) & (size - 1)) == 0;
}

/// The level j of a dyadic range of 2^j samples.
inline int dyadic_level(SampleRange r) { return std::countr_zero(static_cast<uint64_t>(r.size())); }
inline SampleRange left_child(SampleRange r) { return {r.begin, r.begin + r.size() / 2}; }
inline SampleRange right_child(SampleRange r) { return {r.begin + r.size() / 2, r.end}; }

/// The largest dyadic nodes that partition `r`, in order of their indices: at most 2·62. Every dyadic range inside
/// `r` lies inside one of them. Empty for an empty range, one without sense, or one beyond kMaxSamples.
std::vector<SampleRange> dyadic_nodes(SampleRange r);

/// How many samples of `r` belong to replicate `k`.
int64_t samples_of_replicate(SampleRange r, int k);

/// The statistics of a frame from the nodes of one pixel: `nodes[i]` is the pixel in node `ranges[i]`, and the ranges
/// are `dyadic_nodes` of the frame's range. They are folded largest first (of two equally large ones the earlier
/// first): with counts n and m,
///     mean = (n·a + m·b)/(n + m),   s² = (n·sa² + m·sb²)/(n + m) + n·m·(a − b)²/(n + m)²,
/// replicates likewise with their own counts, in double, rounded to float32 after each step. One node is its own fold.
/// A pixel with a missing node is missing. The count is rounded to float32, which is exact up to 2^24 samples.
PixelStats fold(std::span<const SampleRange> ranges, std::span<const PixelStats> nodes);

/// The order in which `fold` takes the nodes.
std::vector<size_t> fold_order(std::span<const SampleRange> ranges);

/// How many samples a set holds, in all and of each replicate; it is the same for every pixel.
struct FoldWeights {
  double samples = 0;
  std::array<double, kReplicates> of_replicate{};

  FoldWeights() = default;
  explicit FoldWeights(SampleRange range);
  void add(const FoldWeights& more);
};

/// One step of the fold: `sum` holds `have` and then `have` + `added`, of which `next` is the node.
void fold_into(PixelStats& sum, const FoldWeights& have, const PixelStats& next, const FoldWeights& added);

/// Makes the node of a dyadic range from its samples, pushed in order of their indices: a binary counter of at most
/// 63 nodes, one merge a sample on average.
class PixelAccumulator {
 public:
  /// `range` must be dyadic.
  explicit PixelAccumulator(SampleRange range) : range_(range) {}

  /// Adds the next sample, whose leaf was made with index `next_index()`. Whenever the prefix of 2^j samples of the
  /// range is complete, `on_prefix(j, node)` is called: the left spine, smallest first. For a range that starts at 0
  /// these are the statistics of the frame at 1, 2, 4, … samples.
  template <typename OnPrefix>
  void push(const PixelStats& sample, OnPrefix&& on_prefix) {
    PixelStats node = sample;
    int level = 0;
    for (uint64_t bits = static_cast<uint64_t>(count_); bits & 1; bits >>= 1, ++level) node = merge(stack_[--depth_], node, level);
    stack_[depth_++] = node;
    ++count_;
    if (depth_ == 1) on_prefix(level, stack_[0]);
  }
  void push(const PixelStats& sample) {
    push(sample, [](int, const PixelStats&) {});
  }

  SampleRange range() const { return range_; }
  int64_t next_index() const { return range_.begin + count_; }
  bool complete() const { return count_ == range_.size(); }
  /// The node of the whole range; a missing one while it is not complete.
  PixelStats result() const { return complete() ? stack_[0] : PixelStats{}; }

 private:
  SampleRange range_;
  int64_t count_ = 0;
  size_t depth_ = 0;
  std::array<PixelStats, 64> stack_;
};

}  // namespace woodcock
