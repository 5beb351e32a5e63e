// Counter-based random numbers.
//
// A number depends on (frame seed, pixel x, pixel y, sample index, branch, path vertex, purpose, draw
// index) and on nothing else, so that a frame has the same bits whatever thread, tile or order computed it.
// Each purpose has numbers of its own: leaving an effect out shifts no other.
#pragma once

#include <cstdint>

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

/// A sequence of independent uniform numbers, one draw after the other (SplitMix64, Steele et al. 2014).
class Stream {
 public:
  explicit Stream(uint64_t state) : state_(state) {}

  uint64_t next_u64() {
    state_ += 0x9e3779b97f4a7c15ULL;
    return mix64(state_);
  }
  uint32_t next_u32() { return static_cast<uint32_t>(next_u64() >> 32); }

  /// Uniform in [0, 1): a multiple of 2^-24, so it is never 1 and 1 − u is never 0.
  float uniform() { return static_cast<float>(next_u64() >> 40) * 0x1p-24f; }
  /// Uniform in [0, 1) with 53 random bits.
  double uniform_double() { return static_cast<double>(next_u64() >> 11) * 0x1p-53; }
  Vec2 uniform2() {
    const uint64_t u = next_u64();
    return {static_cast<float>(u >> 40) * 0x1p-24f, static_cast<float>((u >> 8) & 0xffffff) * 0x1p-24f};
  }
  /// Exponentially distributed with mean 1, in [0, 36.8): −log1p(−u) with u < 1 by construction.
  float exponential() { return static_cast<float>(-std::log1p(-uniform_double())); }

 private:
  uint64_t state_;
};

/// Identifies one camera path; streams are derived from it.
struct PathKey {
  uint64_t key;
};

/// Where a path splits in several, each goes on with numbers of its own. Branch 0 is the path itself.
inline PathKey branch_key(PathKey path, uint32_t branch) { return {branch == 0 ? path.key : hash_combine(path.key, branch)}; }

inline PathKey path_key(uint64_t frame_seed, uint32_t x, uint32_t y, uint64_t sample, uint32_t branch = 0) {
  uint64_t h = hash_combine(frame_seed, (static_cast<uint64_t>(y) << 32) | x);
  return branch_key({hash_combine(h, sample)}, branch);
}

/// The stream of one purpose at one path vertex. Vertex 0 is the camera; interfaces and null collisions
/// do not advance the vertex.
inline Stream stream(PathKey path, uint32_t vertex, Purpose purpose) {
  return Stream(hash_combine(path.key, (static_cast<uint64_t>(vertex) << 32) | static_cast<uint32_t>(purpose)));
}

}  // namespace woodcock
