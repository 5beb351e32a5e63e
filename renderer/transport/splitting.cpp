#include "renderer/transport/splitting.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "renderer/transport/render_plan.h"

namespace woodcock {
namespace {

constexpr uint64_t kPilotSeed = 0x70696c6f74ULL;
constexpr uint32_t kPixels = 96, kMinPixels = 16;
/// Of each pixel: eight of each replicate, since evenly spread numbers take noise from what is found first.
constexpr int kSamples = 8 * kReplicates;
/// Later scatterings of a path have little to say in this, and may be a million.
constexpr int kMaxDepth = 100;
/// In units of a ray.
constexpr double kMaxWork = 3e5;
/// Gains below this may be noise of the pilot.
constexpr double kMinGain = 0.93;
/// Of the variance, what is found before the split has at least this share: the pilot cannot tell less from nothing.
constexpr double kMinBefore = 0.02;

/// What was done, about as long as it takes; a ray is one.
double work(const PathCounters& count) {
  return static_cast<double>(count.rays) + 0.7 * static_cast<double>(count.shadow_rays) + 0.5 * static_cast<double>(count.vertices) +
         0.1 * static_cast<double>(count.medium_lookups + count.emission_lookups) + static_cast<double>(count.paths);
}

/// Mean of one pixel, and the variance of its replicates' means, luminance.
struct Pixel {
  double mean = 0, variance = 0;
};

Pixel render_pixel(const World& world, const RenderPlan& plan, int x, int y, bool low_discrepancy, PathCounters& count) {
  std::array<double, kReplicates> means{};
  Pixel pixel;
  for (int i = 0; i < kSamples; ++i) {
    const PathKey key =
        path_key(kPilotSeed, static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint64_t>(i), 0, low_discrepancy);
    const CameraSample camera = camera_sample(world, key, x, y);
    const double value = static_cast<double>(luminance(trace_path(world, plan, camera.ray, key, count).radiance));
    if (std::isfinite(value)) means[static_cast<size_t>(i % kReplicates)] += value * kReplicates / kSamples;
  }
  for (const double m : means) pixel.mean += m / kReplicates;
  for (const double m : means) pixel.variance += (m - pixel.mean) * (m - pixel.mean) / (kReplicates - 1);
  return pixel;
}

}  // namespace

uint32_t find_splits(const World& world, const PathSettings& settings, int width, int height) {
  if (!settings.features.has(Feature::kSplitting) || settings.max_depth < 2) return 1;
  PathSettings one = settings, many = settings;
  one.watch = many.watch = nullptr;
  one.max_depth = many.max_depth = std::min(settings.max_depth, kMaxDepth);
  one.splits = 1;
  many.splits = kMaxSplits;
  const bool low_discrepancy = settings.features.has(Feature::kSobol);
  const RenderPlan plan_of_one(world, one), plan_of_many(world, many);
  PathCounters count_of_one, count_of_many;
  std::vector<Pixel> of_one, of_many;
  double mean = 0;
  for (uint32_t i = 0; i < kPixels && work(count_of_one) + work(count_of_many) < kMaxWork; ++i) {
    const Vec2 place = sobol_point(i, kPilotSeed);
    const int x = std::min(width - 1, static_cast<int>(static_cast<double>(place.x) * width));
    const int y = std::min(height - 1, static_cast<int>(static_cast<double>(place.y) * height));
    of_one.push_back(render_pixel(world, plan_of_one, x, y, low_discrepancy, count_of_one));
    of_many.push_back(render_pixel(world, plan_of_many, x, y, low_discrepancy, count_of_many));
    mean += of_one.back().mean + of_many.back().mean;
  }
  if (of_one.size() < kMinPixels || !(mean > 0)) return 1;
  mean /= 2 * static_cast<double>(of_one.size());
  double variance_of_one = 0, variance_of_many = 0;
  for (size_t i = 0; i < of_one.size(); ++i) {
    // Relative to the pixel, but that dark ones do not count for all the others.
    const double level = (of_one[i].mean + of_many[i].mean) / 2, scale = level * level + 0.1 * mean * mean;
    variance_of_one += of_one[i].variance / scale;
    variance_of_many += of_many[i].variance / scale;
  }
  // Var D + Var B and Var D + Var B/k, C + c and C + k·c.
  constexpr double k = kMaxSplits;
  const double before = std::max(kMinBefore * variance_of_one, variance_of_one - (variance_of_one - variance_of_many) / (1 - 1 / k));
  const double of_directions = variance_of_one - before;
  const double cost_of_direction = (work(count_of_many) - work(count_of_one)) / (k - 1),
               cost_before = work(count_of_one) - cost_of_direction;
  const auto product = [&](double n) { return (before + of_directions / n) * (cost_before + n * cost_of_direction); };
  uint32_t best = 1;
  // Powers of two only: other numbers of Sobol points are not spread as evenly.
  for (uint32_t n = 2; n <= kMaxSplits; n *= 2)
    if (product(n) < (best == 1 ? kMinGain * product(1) : product(best))) best = n;
  return best;
}

}  // namespace woodcock
