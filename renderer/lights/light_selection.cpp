#include "renderer/lights/light_selection.h"

#include <algorithm>
#include <array>

namespace woodcock {
namespace {

/// Of the choices, that knows nothing of the point.
constexpr double kDefensiveShare = 0.1;

}  // namespace

struct LightSelection::Loop {
  std::array<double, kMaxInLoop> importance{};
  double total = 0;
  int shining = 0;

  double probability(size_t i) const {
    return importance[i] > 0 ? (1 - kDefensiveShare) * importance[i] / total + kDefensiveShare / shining : 0;
  }
};

LightSelection::LightSelection(const std::vector<Candidate>& lights) {
  std::vector<double> intensities, irradiances;
  for (size_t i = 0; i < lights.size(); ++i) {
    Place place;
    if (lights[i].bounds && lights[i].bounds->intensity > 0) {
      place.index = static_cast<int>(bounded_.size());
      bounded_.push_back(*lights[i].bounds);
      bounded_ids_.push_back(static_cast<int>(i));
      intensities.push_back(lights[i].bounds->intensity);
    } else if (lights[i].irradiance > 0) {
      place = {true, static_cast<int>(infinite_ids_.size())};
      infinite_ids_.push_back(static_cast<int>(i));
      irradiances.push_back(lights[i].irradiance);
      irradiance_ += lights[i].irradiance;
    }
    places_.push_back(place);
  }
  if (bounded_.size() + infinite_ids_.size() == 1) only_ = bounded_.empty() ? infinite_ids_[0] : bounded_ids_[0];
  for (double& e : irradiances) e = (1 - kDefensiveShare) * e / irradiance_ + kDefensiveShare / static_cast<double>(infinite_ids_.size());
  infinite_ = DiscreteDistribution(irradiances);
  // In equal parts by intensity and evenly, so that none is too faint for a probability in float.
  double intensity = 0;
  for (const double i : intensities) intensity += i;
  for (double& i : intensities) i = i / intensity + 1 / static_cast<double>(intensities.size());
  by_intensity_ = DiscreteDistribution(intensities);
  if (uses_tree()) tree_ = LightTree(bounded_);
}

LightSelection::Loop LightSelection::loop(DVec3 p) const {
  Loop found;
  for (size_t i = 0; i < bounded_.size(); ++i) {
    found.importance[i] = bounded_[i].importance(p);
    found.total += found.importance[i];
    found.shining += found.importance[i] > 0;
  }
  return found;
}

double LightSelection::share_of_infinite(double bounded) const {
  if (infinite_ids_.empty()) return bounded > 0 ? 0 : -1;
  if (!(bounded > 0)) return 1;
  return (1 - kDefensiveShare) * irradiance_ / (irradiance_ + bounded) + kDefensiveShare / 2;
}

std::optional<LightSelection::Choice> LightSelection::choose(double u, DVec3 p) const {
  if (only_ >= 0) return Choice{only_, 1};
  const Loop near = uses_tree() ? Loop{} : loop(p);
  const double infinite = share_of_infinite(uses_tree() ? tree_.importance(p) : near.total);
  if (infinite < 0) return std::nullopt;
  if (u < infinite) {
    const size_t i = infinite_.sample(std::min(u / infinite, kBelowOne)).index;
    return Choice{infinite_ids_[i], infinite * infinite_.probability(i)};
  }
  u = std::min((u - infinite) / (1 - infinite), kBelowOne);
  size_t chosen = 0;
  double probability = 0;
  if (uses_tree()) {
    if (u < kDefensiveShare) {
      chosen = by_intensity_.sample(std::min(u / kDefensiveShare, kBelowOne)).index;
      probability = tree_.probability(chosen, p);
    } else {
      const LightTree::Choice leaf = tree_.choose(std::min((u - kDefensiveShare) / (1 - kDefensiveShare), kBelowOne), p);
      chosen = leaf.light;
      probability = leaf.probability;
    }
    probability = (1 - kDefensiveShare) * probability + kDefensiveShare * by_intensity_.probability(chosen);
  } else {
    double sum = 0;
    for (size_t i = 0; i < bounded_.size(); ++i) {
      const double share = near.probability(i);
      if (!(share > 0)) continue;
      chosen = i;
      probability = share;
      if (u < (sum += share)) break;
    }
  }
  return Choice{bounded_ids_[chosen], (1 - infinite) * probability};
}

double LightSelection::probability(int light, DVec3 p) const {
  const Place& place = places_[static_cast<size_t>(light)];
  if (place.index < 0) return 0;
  if (only_ >= 0) return 1;
  const auto i = static_cast<size_t>(place.index);
  const Loop near = uses_tree() ? Loop{} : loop(p);
  const double infinite = share_of_infinite(uses_tree() ? tree_.importance(p) : near.total);
  if (infinite < 0) return 0;
  if (place.infinite) return infinite * infinite_.probability(i);
  const double share =
      uses_tree() ? (1 - kDefensiveShare) * tree_.probability(i, p) + kDefensiveShare * by_intensity_.probability(i) : near.probability(i);
  return (1 - infinite) * share;
}

}  // namespace woodcock
