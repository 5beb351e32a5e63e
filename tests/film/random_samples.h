// Random leaves for the tests of the tree: radiances spread evenly in their exponents from 1e-30 to 1e30, some zero,
// some negative as with filters that have negative lobes.
#pragma once

#include <cmath>
#include <cstring>
#include <vector>

#include "renderer/core/random.h"
#include "renderer/film/dyadic.h"

namespace woodcock::testing {

inline float random_value(Stream& random) {
  const float kind = random.uniform();
  if (kind < 0.1f) return 0;
  const float v = std::pow(10.0f, 60 * random.uniform() - 30);
  return kind < 0.2f ? -v : v;
}

inline PixelStats random_leaf(Stream& random, int64_t index) {
  const auto vec = [&] {
    const float x = random_value(random), y = random_value(random), z = random_value(random);
    return Vec3{x, y, z};
  };
  Aovs aovs;
  const Rgb radiance = vec();
  aovs.albedo = vec();
  aovs.normal = vec();
  aovs.depth = random_value(random);
  return leaf(radiance, aovs, index);
}

/// The node of a dyadic range by recursion; leaf i is `leaves[i]`.
inline PixelStats node_by_recursion(const std::vector<PixelStats>& leaves, SampleRange range) {
  if (range.size() == 1) return leaves[static_cast<size_t>(range.begin)];
  return merge(node_by_recursion(leaves, left_child(range)), node_by_recursion(leaves, right_child(range)), dyadic_level(range) - 1);
}

/// Equal to the bit (so 0 differs from -0).
inline bool same_bits(const PixelStats& a, const PixelStats& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

}  // namespace woodcock::testing
