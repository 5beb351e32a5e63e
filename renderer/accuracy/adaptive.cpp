#include "renderer/accuracy/adaptive.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "renderer/accuracy/error.h"
#include "renderer/film/exr.h"

namespace woodcock {

namespace {

/// Without a target each pass aims at E² divided by this.
constexpr double kUntargetedStep = 1.5;

/// Calls f(block, pixel) for every pixel that holds samples.
template <typename F>
void for_each_pixel(BlockGrid grid, const VisitRows& visit, F&& f) {
  visit([&](PixelRect rect, std::span<const PixelStats> pixels) {
    size_t p = 0;
    for (int y = rect.y0; y < rect.y1; ++y)
      for (int x = rect.x0; x < rect.x1; ++x, ++p)
        if (!pixels[p].missing()) f(grid.index(x, y), pixels[p]);
  });
}

/// c̃/A of every block: see the head. Closed ones and those without pixels have none, nor a say in their neighbours'.
std::vector<double> pooled_costs(const SampleMap& map, std::span<const BlockStatistics> blocks, const std::vector<bool>& open) {
  const int across = map.grid().across(), down = map.grid().down();
  std::vector<double> own(blocks.size(), 0), pooled(blocks.size(), 0);
  for (size_t b = 0; b < blocks.size(); ++b)
    if (open[b]) own[b] = blocks[b].relative_square / static_cast<double>(blocks[b].pixels) * static_cast<double>(map.counts[b]);
  for (int y = 0; y < down; ++y)
    for (int x = 0; x < across; ++x) {
      const auto b = static_cast<size_t>(y * across + x);
      if (!open[b]) continue;
      double sum = 0, weight = 0;
      for (int v = std::max(0, y - 1); v < std::min(down, y + 2); ++v)
        for (int u = std::max(0, x - 1); u < std::min(across, x + 2); ++u) {
          const auto other = static_cast<size_t>(v * across + u);
          if (!open[other]) continue;
          const auto pixels = static_cast<double>(blocks[other].pixels);
          sum += own[other] * pixels;
          weight += pixels;
        }
      const auto n = static_cast<double>(map.counts[b]);
      pooled[b] = (n * own[b] + kPriorSamples * (sum / weight)) / (n + kPriorSamples);
    }
  return pooled;
}

/// What the error's square becomes, times the number of pixels, with the counts that λ plans; and the plan of one block.
struct Plan {
  const SampleMap& map;
  std::span<const BlockStatistics> blocks;
  const std::vector<double>& cost;  ///< c̃/A
  double limit;

  double count(size_t b, double lambda) const {
    const auto n = static_cast<double>(map.counts[b]);
    return std::max(n, std::min(limit, lambda * std::sqrt(cost[b])));
  }
  double square(double lambda) const {
    double sum = 0;
    for (size_t b = 0; b < blocks.size(); ++b)
      if (cost[b] > 0) sum += cost[b] * static_cast<double>(blocks[b].pixels) / count(b, lambda);
    return sum;
  }
};

/// The smallest λ, to a double's precision, that lowers the square to `budget`; a very large one where none does.
double find_lambda(const Plan& plan, double budget) {
  double low = 0, high = 1;
  for (int i = 0; i < 1000 && plan.square(high) > budget; ++i) {
    low = high;
    high = 2 * high;
  }
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (plan.square(middle) > budget ? low : high) = middle;
  }
  return high;
}

/// The largest count of the schedule that is neither above `planned` nor above twice the present one; one step at least.
int64_t step_to(int64_t count, double planned, int64_t limit) {
  int64_t reached = next_count(count, limit);
  for (int64_t next = next_count(reached, limit); next > reached && next <= 2 * count && static_cast<double>(next) <= planned;
       next = next_count(next, limit))
    reached = next;
  return reached;
}

}  // namespace

int64_t next_count(int64_t count, int64_t max_samples) {
  int64_t next = kFirstCount;
  if (count >= kFirstCount) {
    const auto octave = static_cast<int64_t>(std::bit_floor(static_cast<uint64_t>(count)));
    next = octave + ((count - octave) / (octave / 4) + 1) * (octave / 4);
  }
  return std::max(count, std::min(next, max_samples));
}

std::vector<BlockStatistics> block_statistics(const SampleMap& map, const VisitRows& visit) {
  std::vector<BlockStatistics> blocks(map.counts.size());
  for_each_pixel(map.grid(), visit, [&](size_t b, const PixelStats& pixel) {
    ++blocks[b].pixels;
    blocks[b].mean_sum += static_cast<double>(film::sample_luminance(pixel.mean));
  });
  double mean = 0, pixels = 0;
  for (const BlockStatistics& block : blocks) {
    mean += block.mean_sum;
    pixels += static_cast<double>(block.pixels);
  }
  const double floor = pixels > 0 ? 0.01 * (mean / pixels) : 0;
  PixelWeights weights = PixelWeights::by_count();
  std::vector<RelativeTerm> sums(blocks.size());
  for_each_pixel(map.grid(), visit, [&](size_t b, const PixelStats& pixel) {
    const RelativeTerm term = relative_term(pixel, weights.of(pixel), floor);
    sums[b].plain += term.plain;
    sums[b].unbiased += term.unbiased;
  });
  for (size_t b = 0; b < blocks.size(); ++b) blocks[b].relative_square = std::max(sums[b].plain, sums[b].unbiased);
  return blocks;
}

std::vector<BlockStatistics> block_statistics(const std::filesystem::path& exr, const SampleMap& map) {
  ExrReader reader(exr);
  const PixelRect rect = reader.info().rect;
  return block_statistics(map, [&](const auto& use) {
    for (int y = rect.y0; y < rect.y1; y += kBlockEdge) {
      const int end = std::min(rect.y1, y + kBlockEdge);
      use({rect.x0, y, rect.x1, end}, reader.beauty_rows(y, end));
    }
  });
}

Decision decide(const SampleMap& map, std::span<const BlockStatistics> blocks, const std::vector<bool>& closed,
                const SamplingTarget& target) {
  Decision decision;
  decision.counts = map.counts;
  std::vector<bool> open(blocks.size());
  double square = 0, pixels = 0;
  for (size_t b = 0; b < blocks.size(); ++b) {
    open[b] = (closed.empty() || !closed[b]) && blocks[b].pixels > 0;
    if (!open[b]) continue;
    square += blocks[b].relative_square;
    pixels += static_cast<double>(blocks[b].pixels);
  }
  const double mse = pixels > 0 ? square / pixels : 0;
  decision.error = std::sqrt(mse);

  const auto raise = [&](size_t b, int64_t count) {
    count = std::min(count, target.max_samples);
    if (count <= decision.counts[b]) return;
    if (decision.counts[b] == map.counts[b]) ++decision.active;
    decision.counts[b] = count;
  };
  bool begun = true;
  for (size_t b = 0; b < blocks.size(); ++b) {
    if (!closed.empty() && closed[b]) continue;
    if (map.counts[b] < kFirstCount) {
      raise(b, kFirstCount);
      begun = begun && map.counts[b] >= target.max_samples;
    } else if (blocks[b].relative_square == 0 && map.counts[b] < kMinCount) {
      raise(b, kMinCount);
    }
  }
  // Nothing can be said of the rest before all have begun.
  if (!begun) return decision;
  decision.reached = target.error > 0 && decision.error <= target.error;
  if (decision.reached || !(mse > 0)) return decision;

  const std::vector<double> cost = pooled_costs(map, blocks, open);
  const Plan plan{map, blocks, cost, static_cast<double>(target.max_samples)};
  // The pooled square differs a little from the plain one: it is to fall by the same factor.
  const double factor = target.error > 0 ? target.error * target.error / mse : 1 / kUntargetedStep;
  const double lambda = find_lambda(plan, plan.square(0) * factor);
  for (size_t b = 0; b < blocks.size(); ++b) {
    if (!open[b]) continue;
    const double planned = plan.count(b, lambda);
    if (planned > static_cast<double>(map.counts[b])) raise(b, step_to(map.counts[b], planned, target.max_samples));
  }
  return decision;
}

}  // namespace woodcock
