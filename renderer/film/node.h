// One pixel of one node of the accumulation tree.
//
// A node is the dyadic range [k·2^j, (k+1)·2^j) of sample indices. A leaf is one sample; a node of level j+1 is
// made of its two children of level j by `merge`, in double, rounded to float32 at *every* node. Whoever computed
// which part, in whatever order, a node therefore has one value, to the bit.
//
// Every field is kept in a form that survives float32 over the whole range of radiance: means instead of sums, so
// that 2^24 + 1 samples do not stick (a constant stays itself, whatever the count), and the *standard deviation*
// instead of the second moment M2: M2 of radiances near 1e30 overflows float32 and of radiances near 1e-30 it
// vanishes, the deviation does neither. It is the population deviation sqrt(M2/n), never NaN: the pairwise formula
// below adds squares only and never subtracts nearly equal numbers.
//
// Numbers smaller than the smallest normal float (1.2e-38) become zero here, explicitly, so that the result does not
// depend on whether the calling thread has the processor's flush-to-zero mode on (Embree recommends it on).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "renderer/core/random.h"
#include "renderer/core/vec.h"

namespace woodcock {

/// Nodes of this level hold a sample of every replicate: 2^kReplicateLevel = kReplicates.
inline constexpr int kReplicateLevel = 2;

/// What one sample sees at its first event that is no interface, at a surface or in a medium: averaged as radiance is. All zero where it
/// saw nothing, depth included, so that every number stays finite.
struct Aovs {
  Rgb albedo{0};    ///< [0, 1]
  Vec3 normal{0};   ///< world space, unit length (a mean is shorter)
  float depth = 0;  ///< distance from the camera along the ray, in scene units
};

/// Statistics of the samples of one node in one pixel. Plain floats; radiance is linear RGB.
struct PixelStats {
  Rgb mean{0};
  Rgb deviation{0};  ///< population standard deviation of each channel, sqrt(M2/n)
  /// Mean luminance of the samples of each replicate. A node below level 2 holds some replicates only; the others are 0.
  std::array<float, kReplicates> replicate{};
  float largest = 0;  ///< largest |luminance| of one sample: finds fireflies, negative filter lobes included
  float count = 0;    ///< number of samples, a power of two and so exact; 0: this pixel of the node is missing
  Rgb albedo{0};
  Vec3 normal{0};
  float depth = 0;

  bool missing() const { return count == 0; }
};
static_assert(sizeof(PixelStats) == 19 * sizeof(float));

namespace film {

/// Rounds to float32, to nearest even; what is below the normal range becomes zero (see the head of this file).
inline float to_float(double v) { return std::abs(v) < 0x1p-126 ? 0.0f : static_cast<float>(v); }

/// (a + b)/2 of two floats: exact in double, then rounded once.
inline float half_sum(float a, float b) { return to_float((static_cast<double>(a) + static_cast<double>(b)) * 0.5); }

/// Deviation of the union of two equally large sets: s² = (sl² + sr²)/2 + (ml − mr)²/4
/// (Chan, Golub & LeVeque 1983, "Algorithms for Computing the Sample Variance", eq. 2.1, for n = m and divided by n).
inline float union_deviation(float sl, float sr, float ml, float mr) {
  const double a = sl, b = sr, d = static_cast<double>(ml) - static_cast<double>(mr);
  return to_float(std::sqrt((a * a + b * b) * 0.5 + d * d * 0.25));
}

/// Rec. 709 luminance in double, kept within float32.
inline float sample_luminance(Rgb c) {
  const double y = 0.2126 * static_cast<double>(c.r) + 0.7152 * static_cast<double>(c.g) + 0.0722 * static_cast<double>(c.b);
  constexpr double kMax = std::numeric_limits<float>::max();
  return to_float(std::clamp(y, -kMax, kMax));
}

}  // namespace film

/// The node of one sample. `radiance` and `aovs` must be finite: a non-finite sample is counted by the renderer, with
/// its cause, and passed on as zero (it still counts in n). `sample_index` is the index in the frame, ≥ 0.
inline PixelStats leaf(Rgb radiance, const Aovs& aovs, int64_t sample_index) {
  using film::to_float;
  PixelStats node;
  node.mean = {to_float(radiance.r), to_float(radiance.g), to_float(radiance.b)};
  const float y = film::sample_luminance(radiance);
  node.replicate[static_cast<size_t>(sample_index & (kReplicates - 1))] = y;
  node.largest = std::abs(y);
  node.count = 1;
  node.albedo = {to_float(aovs.albedo.r), to_float(aovs.albedo.g), to_float(aovs.albedo.b)};
  node.normal = {to_float(aovs.normal.x), to_float(aovs.normal.y), to_float(aovs.normal.z)};
  node.depth = to_float(aovs.depth);
  return node;
}

/// The parent of two siblings, `left` being the one with the smaller indices. `child_level` is the level j of the
/// children, which hold 2^j samples each. Below level 2 the children hold different replicates and the parent holds
/// both; from level 2 on each replicate is averaged. A parent with a missing child is missing: half a node is no
/// estimate of the whole, and averaging what is there would hide the hole.
inline PixelStats merge(const PixelStats& left, const PixelStats& right, int child_level) {
  using film::half_sum;
  using film::union_deviation;
  if (left.missing() || right.missing()) return {};
  PixelStats node;
  for (int c = 0; c < 3; ++c) {
    node.mean[c] = half_sum(left.mean[c], right.mean[c]);
    node.albedo[c] = half_sum(left.albedo[c], right.albedo[c]);
    node.normal[c] = half_sum(left.normal[c], right.normal[c]);
    node.deviation[c] = union_deviation(left.deviation[c], right.deviation[c], left.mean[c], right.mean[c]);
  }
  node.depth = half_sum(left.depth, right.depth);
  if (child_level < kReplicateLevel) {
    // One of the two is zero, so the sum is exact.
    for (size_t r = 0; r < kReplicates; ++r) node.replicate[r] = left.replicate[r] + right.replicate[r];
  } else {
    for (size_t r = 0; r < kReplicates; ++r) node.replicate[r] = half_sum(left.replicate[r], right.replicate[r]);
  }
  node.largest = std::max(left.largest, right.largest);
  node.count = left.count + right.count;
  return node;
}

}  // namespace woodcock
