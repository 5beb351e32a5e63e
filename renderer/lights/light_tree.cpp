#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "renderer/lights/light_selection.h"

namespace woodcock {
namespace {

constexpr int kBuckets = 12;
/// From here on groups are halved, so that a way down fits 64 bits.
constexpr int kDepthOfHalving = 30;

DVec3 center(const LightBounds& b) { return 0.5 * (b.lower + b.upper); }

/// Conty Estevez & Kulla 2018, equations 1 and 2.
double cost(const LightBounds& b, double longest, double extent) {
  const double normals = std::acos(std::clamp(b.axes.cos_angle, -1.0, 1.0)), emission = std::acos(std::clamp(b.cos_emission, -1.0, 1.0));
  const double all = std::min(normals + emission, std::numbers::pi), sine = std::sin(normals);
  const double solid_angle = 2 * std::numbers::pi * (1 - b.axes.cos_angle) +
                             std::numbers::pi / 2 * (2 * all * sine - std::cos(normals - 2 * all) - 2 * normals * sine + b.axes.cos_angle);
  const DVec3 d = b.upper - b.lower;
  return b.intensity * solid_angle * (longest / extent) * (d.x * d.y + d.y * d.z + d.z * d.x);
}

}  // namespace

LightTree::LightTree(const std::vector<LightBounds>& lights) : ways_(lights.size(), 0) {
  if (lights.empty()) return;
  std::vector<uint32_t> order(lights.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<uint32_t>(i);
  nodes_.reserve(2 * lights.size());
  build(lights, order, 0, order.size(), 0, 0);
}

void LightTree::build(const std::vector<LightBounds>& lights, std::vector<uint32_t>& order, size_t begin, size_t end, uint64_t way,
                      int depth) {
  const size_t here = nodes_.size();
  nodes_.emplace_back();
  if (end - begin == 1) {
    nodes_[here] = {lights[order[begin]], order[begin], true};
    ways_[order[begin]] = way;
    return;
  }
  DVec3 lower(std::numeric_limits<double>::infinity()), upper(-std::numeric_limits<double>::infinity());
  for (size_t i = begin; i < end; ++i) {
    lower = glm::min(lower, center(lights[order[i]]));
    upper = glm::max(upper, center(lights[order[i]]));
  }
  const DVec3 extent = upper - lower;
  const double longest = std::max({extent.x, extent.y, extent.z});
  size_t middle = (begin + end) / 2;
  int best_axis = -1, best_bucket = 0;
  double least = std::numeric_limits<double>::infinity();
  const auto bucket_of = [&](uint32_t light, int axis) {
    const double share = (center(lights[light])[axis] - lower[axis]) / extent[axis];
    return std::clamp(static_cast<int>(share * kBuckets), 0, kBuckets - 1);
  };
  for (int axis = 0; axis < 3 && depth < kDepthOfHalving; ++axis) {
    if (!(extent[axis] > 0)) continue;
    std::array<std::optional<LightBounds>, kBuckets> buckets;
    for (size_t i = begin; i < end; ++i) {
      auto& bucket = buckets[static_cast<size_t>(bucket_of(order[i], axis))];
      bucket = bucket ? merged(*bucket, lights[order[i]]) : lights[order[i]];
    }
    const auto side = [&](int first, int last) {
      std::optional<LightBounds> all;
      for (int i = first; i < last; ++i)
        if (const auto& bucket = buckets[static_cast<size_t>(i)]) all = all ? merged(*all, *bucket) : *bucket;
      return all;
    };
    for (int split = 1; split < kBuckets; ++split) {
      const auto a = side(0, split), b = side(split, kBuckets);
      if (!a || !b) continue;
      const double sum = cost(*a, longest, extent[axis]) + cost(*b, longest, extent[axis]);
      if (!(sum < least)) continue;
      least = sum;
      best_axis = axis;
      best_bucket = split;
    }
  }
  if (best_axis >= 0) {
    const auto at =
        std::stable_partition(order.begin() + static_cast<std::ptrdiff_t>(begin), order.begin() + static_cast<std::ptrdiff_t>(end),
                              [&](uint32_t light) { return bucket_of(light, best_axis) < best_bucket; });
    middle = static_cast<size_t>(at - order.begin());
  }
  build(lights, order, begin, middle, way, depth + 1);
  const size_t second = nodes_.size();
  build(lights, order, middle, end, way | uint64_t{1} << depth, depth + 1);
  nodes_[here] = {merged(nodes_[here + 1].bounds, nodes_[second].bounds), static_cast<uint32_t>(second), false};
}

double LightTree::first_share(size_t node, DVec3 p) const {
  const double first = nodes_[node + 1].bounds.importance(p), second = nodes_[nodes_[node].next].bounds.importance(p);
  return first + second > 0 ? first / (first + second) : 0.5;
}

LightTree::Choice LightTree::choose(double u, DVec3 p) const {
  size_t node = 0;
  double probability = 1;
  while (!nodes_[node].leaf) {
    const double first = first_share(node, p);
    if (u < first) {
      u = std::min(u / first, kBelowOne);
      probability *= first;
      ++node;
    } else {
      u = std::min((u - first) / (1 - first), kBelowOne);
      probability *= 1 - first;
      node = nodes_[node].next;
    }
  }
  return {nodes_[node].next, probability};
}

double LightTree::probability(size_t light, DVec3 p) const {
  size_t node = 0;
  double probability = 1;
  for (uint64_t way = ways_[light]; !nodes_[node].leaf; way >>= 1) {
    const double first = first_share(node, p);
    const bool second = (way & 1) != 0;
    probability *= second ? 1 - first : first;
    node = second ? nodes_[node].next : node + 1;
  }
  return probability;
}

}  // namespace woodcock
