// Where the next samples of a frame go: one decision, shared by the local render and the coordinator.
//
// The frame's error is E² = (1/P) Σ over pixels of Var(x̄)/(x̄² + (0.01·image mean)²), as in error.h. With n_b samples in block b
// the block's share of the sum is c_b/n_b, where c_b does not depend on n_b. The cheapest way to a given E², counted in
// samples, is n_b = λ·√(c_b/A_b) with A_b pixels (the method of Lagrange; for strata of a survey it is Neyman's allocation,
// J. Neyman 1934, "On the two different aspects of the representative method", J. Royal Statistical Society 97).
//
// All of it is + − × ÷ √ in double in a fixed order, and depends on the merged statistics only: whoever decides, decides the same.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "renderer/film/node.h"
#include "renderer/film/sample_map.h"

namespace woodcock {

/// Where sampling ends, apart from time.
struct SamplingTarget {
  double error = 0;               ///< E that is asked for; 0: none
  int64_t max_samples = 1 << 20;  ///< of any pixel, at most kMaxMapSamples

  friend bool operator==(const SamplingTarget&, const SamplingTarget&) = default;
};

/// Counts of the first pass and of a block that may be done although it looks free of noise.
inline constexpr int64_t kFirstCount = 16;
inline constexpr int64_t kMinCount = 32;
/// A block's neighbourhood counts as so many samples of its own: see `decide`.
inline constexpr double kPriorSamples = 16;

/// The next count of the schedule after `count`: 16, then 2^j·{1, 1¼, 1½, 1¾} from 16 on, and `max_samples` where that comes first.
/// `count` itself where it has reached that.
int64_t next_count(int64_t count, int64_t max_samples);

/// What is known of one block.
struct BlockStatistics {
  int64_t pixels = 0;   ///< that hold samples
  double mean_sum = 0;  ///< Σ of the pixels' mean luminances
  /// Σ Var(x̄)/(x̄² + (0.01·image mean)²), c_b/n_b: plain, or without the bias of its noisy denominators where that is more.
  double relative_square = 0;
};

/// Hands over rows of a picture: `use(rect, pixels)`, row by row from the top; called twice.
using VisitRows = std::function<void(const std::function<void(PixelRect, std::span<const PixelStats>)>&)>;

/// The statistics of every block of `map` from the picture it belongs to.
std::vector<BlockStatistics> block_statistics(const SampleMap& map, const VisitRows& visit);
/// The same from a node file.
std::vector<BlockStatistics> block_statistics(const std::filesystem::path& exr, const SampleMap& map);

/// What comes after a pass.
struct Decision {
  double error = 0;             ///< E of the blocks that are not closed
  std::vector<int64_t> counts;  ///< of each block after the next pass; equal to the present ones: done
  int64_t active = 0;           ///< blocks that go on
  bool reached = false;         ///< the target, rather than the limit of samples

  bool done() const { return active == 0; }
};

/// Decides the next pass. `closed` blocks (empty: none) take no more samples and count in nothing: a part of them could not
/// be rendered.
///
/// - A block below kFirstCount goes there, whatever the rest.
/// - Otherwise nothing goes on once E ≤ target, except blocks below kMinCount whose variance is 0: black so far is not yet
///   black. Without a target the aim is E²/1.5, one pass after the other.
/// - Else the λ is sought for which the planned counts max(n_b, λ·√(c̃_b/A_b)), none above the limit, lower E² to the target, and the
///   blocks that are planned above their n_b go on: to the largest count of the schedule that is neither above the plan nor above
///   2·n_b, and one step at least. A factor of 2 bounds what a wrong variance costs.
/// - c̃_b is c_b pooled with its neighbourhood: c̃_b/A_b = (n_b·c_b/A_b + 16·mean of c/A over the 3 × 3 blocks around)/(n_b + 16). A
///   block whose few samples missed what its neighbours see (a caustic, the edge of a lamp) is thus not left behind; with
///   more samples its own word counts.
Decision decide(const SampleMap& map, std::span<const BlockStatistics> blocks, const std::vector<bool>& closed,
                const SamplingTarget& target);

}  // namespace woodcock
