// Counter-based random numbers.
//
// A number depends on (frame seed, pixel x, pixel y, sample index, branch, path vertex, purpose, draw
// index) and on nothing else, so that a frame has the same bits whatever thread, tile or order computed it.
// Each purpose has numbers of its own: leaving an effect out shifts no other.
#pragma once

#include <bit>
#include <cstdint>
#include <optional>

#include "renderer/core/sobol.h"
#include "renderer/core/vec.h"

namespace woodcock {

/// What a random number is drawn for. The values are part of the sampling contract: changing one
/// changes every image, so new purposes go to the end.
enum class Purpose : uint32_t {
  kPixelFilter = 0,
  kLens = 1,
  kTime = 2,
  kFreeFlight = 3,  ///< distances and collision types in media; goes on across interfaces
  kLightChoice = 4,
  kLightSample = 5,
  kTransmittance = 6,  ///< ratio tracking of shadow rays
  kDirection = 7,      ///< BSDF and phase-function sampling
  kRoulette = 8,
  kMaterial = 9,  ///< mix materials and stochastic opacity
  kLayered = 10,  ///< random walks inside layered materials
  kHeroChannel = 11,
  kEquiangular = 12,
  kEmission = 13,
  kBranching = 14,
  kRefraction = 15,  ///< roulette of light samples through smooth glass
};

/// A bijective 64-bit mixer (Stafford's variant 13 of the MurmurHash3 finaliser).
inline uint64_t mix64(uint64_t z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

/// Folds `value` into the hash `h`; the order of the folded values matters.
inline uint64_t hash_combine(uint64_t h, uint64_t value) { return mix64(h ^ (value + 0x9e3779b97f4a7c15ULL + (h << 6) + (h >> 2))); }

/// The seed of one frame of a job: hash(job seed, frame number).
inline uint64_t frame_seed(uint64_t seed, uint64_t frame) { return hash_combine(hash_combine(0x576f6f64636f636bULL, seed), frame); }

/// −ln x for x in [2⁻⁵³, 1], within 1e-10 of the value. Of + − × ÷ only, so that distances have the same bits with every C library;
/// and in half the time of a call to log1p, of which a free flight has one for each collision.
///
/// x = 2ᵏ m with m in [√½, √2), and ln m = 2 artanh s, s = (m − 1)/(m + 1), by its series up to s¹¹; m − 1 is exact, so that the
/// result is as good next to x = 1.
inline double minus_log(double x) {
  constexpr uint64_t kSqrtHalf = 0x3fe6a09e667f3bcdULL, kMantissa = (1ULL << 52) - 1;
  const auto bits = std::bit_cast<uint64_t>(x) - kSqrtHalf;
  const auto k = static_cast<int64_t>(bits) >> 52;
  const auto m = std::bit_cast<double>((bits & kMantissa) + kSqrtHalf);
  const double f = m - 1, s = f / (2 + f), z = s * s;
  const double series = 1 + z * (1.0 / 3 + z * (1.0 / 5 + z * (1.0 / 7 + z * (1.0 / 9 + z * (1.0 / 11)))));
  return static_cast<double>(-k) * 0.69314718055994530942 - 2 * s * series;
}

/// The point of a low-discrepancy sequence that takes the place of a stream's first draw.
struct LeadingPoint {
  uint64_t sequence = 0;  ///< names the scrambling
  uint32_t shuffle = 0;
  uint32_t index = 0;
  int pair = 0;  ///< of the dimensions
  bool given = false;
};

/// A sequence of independent uniform numbers, one draw after the other (SplitMix64, Steele et al. 2014). With a leading
/// point the first draw, whatever its kind, is that point, or its first coordinate.
class Stream {
 public:
  explicit Stream(uint64_t state, LeadingPoint leading = {}) : state_(state), leading_(leading) {}

  uint64_t next_u64() {
    state_ += 0x9e3779b97f4a7c15ULL;
    return mix64(state_);
  }
  uint32_t next_u32() { return static_cast<uint32_t>(next_u64() >> 32); }

  /// Uniform in [0, 1): a multiple of 2^-24, so it is never 1 and 1 − u is never 0.
  float uniform() { return leading_.given ? take_leading().x : static_cast<float>(next_u64() >> 40) * 0x1p-24f; }
  /// Uniform in [0, 1): a multiple of 2^-53. A leading point gives the first 24 binary digits, the stream the rest.
  double uniform_double() {
    const uint64_t u = next_u64();
    if (leading_.given) return static_cast<double>(take_leading().x) + static_cast<double>(u >> 35) * 0x1p-53;
    return static_cast<double>(u >> 11) * 0x1p-53;
  }
  Vec2 uniform2() {
    if (leading_.given) return take_leading();
    const uint64_t u = next_u64();
    return {static_cast<float>(u >> 40) * 0x1p-24f, static_cast<float>((u >> 8) & 0xffffff) * 0x1p-24f};
  }
  /// Exponentially distributed with mean 1, in [0, 36.8): −ln(1 − u) with 1 − u exact and positive by construction.
  float exponential() { return static_cast<float>(minus_log(1 - uniform_double())); }

 private:
  Vec2 take_leading() {
    leading_.given = false;
    return sobol_point(leading_.index, leading_.shuffle, leading_.sequence, leading_.pair);
  }

  uint64_t state_;
  LeadingPoint leading_;
};

/// Identifies one camera path; streams are derived from it.
struct PathKey {
  uint64_t key;
  /// Where low-discrepancy numbers are wanted: names this pixel's replicate, and the sample's place in it. Sequences are
  /// scrambled for each pixel and replicate by themselves, so that replicates stay independent.
  uint64_t replicate = 0;
  uint32_t index = 0;
  bool low_discrepancy = false;
};

/// Sample i belongs to replicate i mod kReplicates. Errors are estimated between replicates. Fewer have less noise, since each sequence
/// has more points: with 8, 4 and 1 the cornell box has 1, 0.89 and 0.7 of the squared error. More tell the error better.
inline constexpr int kReplicates = 4;
/// Leading points serve the first vertices of a path; later ones depend on too much for evenness to help.
inline constexpr uint32_t kLeadingVertices = 4;

/// Where a path splits in several, each goes on with numbers of its own. Branch 0 is the path itself.
inline PathKey branch_key(PathKey path, uint32_t branch) { return branch == 0 ? path : PathKey{hash_combine(path.key, branch)}; }

inline PathKey path_key(uint64_t frame_seed, uint32_t x, uint32_t y, uint64_t sample, uint32_t branch = 0, bool low_discrepancy = false) {
  const uint64_t pixel = hash_combine(frame_seed, (static_cast<uint64_t>(y) << 32) | x);
  PathKey key = branch_key({hash_combine(pixel, sample)}, branch);
  if (low_discrepancy && branch == 0) {
    // Behind 2³² samples of a replicate a new sequence begins.
    const uint64_t place = sample / kReplicates;
    key.replicate = hash_combine(hash_combine(pixel, 0x536f626f6cULL + sample % kReplicates), place >> 32);
    key.index = static_cast<uint32_t>(place);
    key.low_discrepancy = true;
  }
  return key;
}

/// Direction i of the `count` that a path takes at one vertex has numbers of its own from there on; evenly spread ones continue the
/// sequences of later vertices with `count` points a sample.
inline PathKey split_key(PathKey path, uint32_t i, uint32_t count) {
  PathKey key = path;
  if (i > 0) key.key = hash_combine(path.key, 0x73706c6974ULL + i);
  const uint64_t place = static_cast<uint64_t>(path.index) * count + i;
  key.index = static_cast<uint32_t>(place);
  // Behind 2³² points a new sequence begins.
  if (const uint64_t round = place >> 32; round > 0) key.replicate = hash_combine(path.replicate, round);
  return key;
}

/// Which pair of one joint sequence a purpose at a vertex has; nothing where its pair is padded. The direction at the first vertex and
/// what is drawn at the second decide together what a sample of indirect light brings: joint they have 0.9 of the squared error in the
/// Cornell box. The light sample of the third vertex with them gained nothing.
inline std::optional<int> joint_pair(uint32_t vertex, Purpose purpose) {
  if (purpose == Purpose::kDirection && vertex == 1) return 0;
  if (purpose == Purpose::kLightSample && vertex == 2) return 1;
  if (purpose == Purpose::kDirection && vertex == 2) return 2;
  return std::nullopt;
}

/// The stream of one purpose at one path vertex. Vertex 0 is the camera; interfaces and null collisions
/// do not advance the vertex.
inline Stream stream(PathKey path, uint32_t vertex, Purpose purpose) {
  const uint64_t place = (static_cast<uint64_t>(vertex) << 32) | static_cast<uint32_t>(purpose);
  LeadingPoint leading;
  if (path.low_discrepancy && vertex < kLeadingVertices) {
    const uint64_t sequence = hash_combine(path.replicate, place);
    const auto joint = joint_pair(vertex, purpose);
    // Pairs of one sequence are shuffled alike: by the replicate. A padded pair has a shuffle of its own.
    leading = {sequence, static_cast<uint32_t>(joint ? mix64(path.replicate) : sequence), path.index, joint.value_or(0), true};
  }
  return Stream(hash_combine(path.key, place), leading);
}

}  // namespace woodcock
