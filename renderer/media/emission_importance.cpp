#include "renderer/media/emission_importance.h"

#include <algorithm>

namespace woodcock {
namespace {

/// 16 MiB of tables at the most; 100³ bricks.
constexpr int64_t kMaxBricks = 1 << 20;
/// Look-ups of emission when a medium is built: about a second.
constexpr int64_t kMaxLookUps = 1 << 22;
/// The part of the density that goes by volume alone.
constexpr double kDefensive = 1.0 / 64;

int64_t count(IVec3 size) { return static_cast<int64_t>(size.x) * size.y * size.z; }

template <typename F>
void for_each_brick(IVec3 size, F f) {
  for (int z = 0; z < size.z; ++z)
    for (int y = 0; y < size.y; ++y)
      for (int x = 0; x < size.x; ++x) f(IVec3(x, y, z));
}

/// `weights` and a share for each entry in proportion to `sizes`, so that none with a size is left out.
std::vector<double> defended(std::vector<double> weights, const std::vector<double>& sizes) {
  double total = 0, size = 0;
  for (size_t i = 0; i < weights.size(); ++i) {
    total += weights[i];
    size += sizes[i];
  }
  const double shared = total > 0 ? kDefensive * total : 1;
  for (size_t i = 0; i < weights.size(); ++i) weights[i] += shared * sizes[i] / size;
  return weights;
}

}  // namespace

/// The part of the medium's box that lies in a brick; the outermost bricks reach to its ends.
CellBox EmissionImportance::Layer::brick_box(IVec3 brick) const {
  CellBox result;
  for (int i = 0; i < 3; ++i) {
    const double low = brick[i] * edge, high = low + edge;
    result.lower[i] = brick[i] == 0 ? box.lower[i] : std::max(low, box.lower[i]);
    result.upper[i] = brick[i] == size[i] - 1 ? box.upper[i] : std::min(high, box.upper[i]);
  }
  return result;
}

EmissionImportance::EmissionImportance(MajorantGrid bounds, const std::function<double(DVec3)>& emission, MajorantGrid& largest) {
  while (count(bounds.size()) > kMaxBricks) bounds = bounds.coarser();
  auto layer = std::make_shared<Layer>();
  layer->size = bounds.size();
  layer->edge = bounds.edge();
  // Flames are thin: a point drawn evenly from a brick of several cells would miss most of what it emits.
  while (layer->edge > 1 && count(layer->size * 2) <= kMaxBricks) {
    layer->size *= 2;
    layer->edge /= 2;
  }
  layer->box = bounds.box();
  layer->map = bounds.map();
  layer->render_from_cell = layer->map.render_from_cell();
  const double cell_volume = std::pow(layer->map.cell_edge(), 3);

  const auto is_filled = [&](IVec3 b) { return bounds.bound(b * layer->edge / bounds.edge()) > 0; };
  int64_t filled = 0;
  for_each_brick(layer->size, [&](IVec3 b) { filled += is_filled(b); });
  // Two an edge of a cell where they are few enough, since emission may be zero at the middle and not beside it.
  int points = 2 * layer->edge;
  while (points > 1 && filled * count(IVec3(points)) > kMaxLookUps) points /= 2;
  const double spacing = static_cast<double>(layer->edge) / points;
  std::vector<double> powers, volumes;
  for_each_brick(layer->size, [&](IVec3 b) {
    const CellBox box = layer->brick_box(b);
    const DVec3 extent = glm::max(box.upper - box.lower, DVec3(0));
    volumes.push_back(is_filled(b) ? extent.x * extent.y * extent.z * cell_volume : 0);
    double sum = 0;
    if (volumes.back() > 0)
      for_each_brick(IVec3(points), [&](IVec3 v) {
        const DVec3 first = DVec3(b * layer->edge) + DVec3(v) * spacing;
        const double value = emission(DVec3(layer->render_from_cell * glm::dvec4(first + 0.5 * spacing, 1)));
        sum += value;
        largest.add_block(IVec3(first), IVec3(glm::ceil(first + spacing)) - 1, static_cast<float>(value));
      });
    powers.push_back(sum * std::pow(spacing, 3) * cell_volume);
    layer->power += powers.back();
  });
  layer->power *= 4 * 3.14159265358979323846;
  layer->bricks = DiscreteDistribution(defended(powers, volumes));
  for (size_t i = 0; i < volumes.size(); ++i)
    layer->density.push_back(volumes[i] > 0 ? static_cast<float>(layer->bricks.probability(i) / volumes[i]) : 0);
  power_ = layer->power;
  choice_ = DiscreteDistribution({1});
  layers_.push_back(std::move(layer));
}

EmissionImportance::EmissionImportance(std::span<const EmissionImportance* const> parts) {
  std::vector<double> powers;
  for (const EmissionImportance* part : parts)
    for (const auto& layer : part->layers_) {
      layers_.push_back(layer);
      powers.push_back(layer->power);
      power_ += layer->power;
    }
  choice_ = DiscreteDistribution(defended(powers, std::vector<double>(powers.size(), 1)));
}

EmissionImportance::Sample EmissionImportance::sample(Vec3 u, double u_brick) const {
  const auto chosen = choice_.sample(u_brick);
  const Layer& layer = *layers_[chosen.index];
  const auto i = static_cast<int>(layer.bricks.sample(chosen.remainder).index);
  const CellBox box = layer.brick_box({i % layer.size.x, i / layer.size.x % layer.size.y, i / layer.size.x / layer.size.y});
  const DVec3 cell = box.lower + DVec3(u) * (box.upper - box.lower);
  const DVec3 p(layer.render_from_cell * glm::dvec4(cell, 1));
  if (layers_.size() == 1) return {p, layer.density[static_cast<size_t>(i)]};
  return {p, pdf(p)};
}

float EmissionImportance::pdf(DVec3 p) const {
  if (layers_.size() == 1) return layers_[0]->pdf(p);
  double sum = 0;
  for (size_t i = 0; i < layers_.size(); ++i) sum += choice_.probability(i) * static_cast<double>(layers_[i]->pdf(p));
  return static_cast<float>(sum);
}

float EmissionImportance::Layer::pdf(DVec3 p) const {
  const Vec3 c(map.point(p)), lower(box.lower), upper(box.upper);
  IVec3 brick;
  for (int i = 0; i < 3; ++i) {
    if (!(c[i] >= lower[i] && c[i] <= upper[i])) return 0;
    brick[i] = std::clamp(static_cast<int>(std::floor(c[i])) / edge, 0, size[i] - 1);
  }
  return density[(static_cast<size_t>(brick.z) * size.y + brick.y) * size.x + brick.x];
}

}  // namespace woodcock
