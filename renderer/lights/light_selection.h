// Choosing one of many lights by what arrives at a point.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "renderer/core/distribution.h"
#include "renderer/lights/light_bounds.h"

namespace woodcock {

/// The largest number that a random number used again may become.
inline constexpr double kBelowOne = 0x1.fffffffffffffp-1;

/// A binary tree over the bounds of lights, walked from the root with the importances of both children at each node (Conty Estevez &
/// Kulla 2018, section 5). Split where the sum over both sides of intensity × surface × solid angle of emission is least (section 4.4).
class LightTree {
 public:
  LightTree() = default;
  explicit LightTree(const std::vector<LightBounds>& lights);

  struct Choice {
    size_t light;
    double probability;
  };
  /// u in [0,1). There must be a light.
  Choice choose(double u, DVec3 p) const;
  double probability(size_t light, DVec3 p) const;
  /// That of the root.
  double importance(DVec3 p) const { return nodes_.empty() ? 0 : nodes_[0].bounds.importance(p); }

 private:
  struct Node {
    LightBounds bounds;
    uint32_t next = 0;  // the light of a leaf; else the second child, while the first one is the next node
    bool leaf = true;
  };
  void build(const std::vector<LightBounds>& lights, std::vector<uint32_t>& order, size_t begin, size_t end, uint64_t way, int depth);
  /// The probability of the first child.
  double first_share(size_t node, DVec3 p) const;

  std::vector<Node> nodes_;
  std::vector<uint64_t> ways_;  // per light, from the lowest bit on: whether the way down takes the second child
};

/// All lights that are sampled: those that stand somewhere by the bounds of what they bring, up to 16 in a loop and more by a tree;
/// those at infinity by their irradiance, which is the same everywhere. A tenth of all choices ignores the estimates (it is
/// shared evenly, in a tree half so and half by intensity), since these know nothing of what is in between. Pure functions of the point.
class LightSelection {
 public:
  /// What there is to choose by, of one light; neither: it is never chosen.
  struct Candidate {
    std::optional<LightBounds> bounds;  ///< of a light that stands somewhere
    double irradiance = 0;              ///< at right angles, of one at infinity
  };
  LightSelection() = default;
  explicit LightSelection(const std::vector<Candidate>& lights);

  struct Choice {
    int light;
    double probability;
  };
  /// u in [0,1). Nothing where no light can arrive.
  std::optional<Choice> choose(double u, DVec3 p) const;
  /// The light that `choose` gives wherever the point is; kNone where that depends on it.
  int only() const { return only_; }
  /// The probability that `choose` gives this light at p; they sum to one wherever it gives any.
  double probability(int light, DVec3 p) const;

  /// More are in a tree.
  static constexpr size_t kMaxInLoop = 16;

 private:
  bool uses_tree() const { return bounded_.size() > kMaxInLoop; }
  /// Importances of the lights in the loop.
  struct Loop;
  Loop loop(DVec3 p) const;
  /// The probability of the lights at infinity together, if the others bring `bounded`; negative where nothing arrives.
  double share_of_infinite(double bounded) const;

  struct Place {
    bool infinite = false;
    int index = -1;  // in its group
  };
  std::vector<Place> places_;  // per light
  std::vector<int> bounded_ids_, infinite_ids_;
  std::vector<LightBounds> bounded_;
  DiscreteDistribution by_intensity_, infinite_;
  double irradiance_ = 0;  // of all at infinity
  LightTree tree_;
  int only_ = -1;  // the one light, where there is no choice
};

}  // namespace woodcock
