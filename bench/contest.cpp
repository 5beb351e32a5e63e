#include "bench/contest.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <ctime>
#include <numeric>
#include <optional>
#include <stdexcept>

#include "renderer/accuracy/error.h"
#include "renderer/frame/frame_renderer.h"

namespace woodcock::bench {
namespace {

/// CPU time of this process, in seconds: unlike the wall's it does not count the time that others have the processor.
double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

Tile render(const FrameRenderer& frame, SampleRange range, double& seconds) {
  RenderProgress progress;
  const double start = cpu_seconds();
  std::optional<Tile> tile = frame.render(frame.header().bounds, range, 1, progress);
  seconds = cpu_seconds() - start;
  return std::move(tile).value();
}

/// The largest power of two of samples, 8 at least, that is expected to take at most `seconds`.
int64_t samples_within(const FrameRenderer& frame, double seconds) {
  int64_t samples = kReplicates;
  for (;; samples *= 2) {
    double took = 0;
    render(frame, {0, samples}, took);
    // Short runs measure warming up as much as rendering.
    if (took < seconds / 16) continue;
    const double fit = static_cast<double>(samples) * seconds / std::max(took, 1e-9);
    return std::max<int64_t>(kReplicates, static_cast<int64_t>(std::bit_floor(static_cast<uint64_t>(fit))));
  }
}

double mean_luminance(const PixelStats& pixel) {
  double sum = 0;
  for (const float replicate : pixel.replicate) sum += replicate;
  return sum / kReplicates;
}

/// Joins the equal ranges of the rounds as the tree does.
Tile join(std::vector<Tile> tiles) {
  while (tiles.size() > 1) {
    std::vector<Tile> parents;
    for (size_t i = 0; i + 1 < tiles.size(); i += 2) {
      Tile parent{tiles[i].rect, {tiles[i].range.begin, tiles[i + 1].range.end}, tiles[i].pixels};
      for (size_t p = 0; p < parent.pixels.size(); ++p)
        parent.pixels[p] = merge(tiles[i].pixels[p], tiles[i + 1].pixels[p], dyadic_level(tiles[i].range));
      parents.push_back(std::move(parent));
    }
    tiles = std::move(parents);
  }
  return std::move(tiles.front());
}

/// 1/(pixels · (r² + (0.01·mean r)²)) for each pixel of the reference.
std::vector<double> weights_of(const Tile& reference) {
  const auto pixels = static_cast<double>(reference.pixels.size());
  double mean = 0;
  for (const PixelStats& pixel : reference.pixels) mean += mean_luminance(pixel) / pixels;
  std::vector<double> weights;
  for (const PixelStats& pixel : reference.pixels) {
    const double r = mean_luminance(pixel), scale = r * r + 1e-4 * mean * mean;
    weights.push_back(scale > 0 ? 1 / (pixels * scale) : 0);
  }
  return weights;
}

/// Mean over all pairs i < j of `products`, but those with `left_out`; kReplicates leaves out none.
double mean_of_pairs(const std::array<std::array<double, kReplicates>, kReplicates>& products, size_t left_out) {
  double sum = 0;
  int pairs = 0;
  for (size_t i = 0; i < kReplicates; ++i)
    for (size_t j = i + 1; j < kReplicates; ++j) {
      if (i == left_out || j == left_out) continue;
      sum += products[i][j];
      ++pairs;
    }
  return sum / pairs;
}

/// With d_k the difference of replicate k, E d_i d_j w_ij = (E d)² E w for i ≠ j, as long as the weight w_ij does not know of d_i and d_j:
/// it is taken from the other replicates of the reference.
Bias bias_of(const Tile& picture, const Tile& reference) {
  constexpr double kAll = kReplicates;
  const auto pixels = static_cast<double>(reference.pixels.size());
  double mean = 0;
  for (const PixelStats& pixel : reference.pixels) mean += mean_luminance(pixel) / pixels;
  std::array<double, kReplicates> difference{}, d{}, without{};
  std::array<std::array<double, kReplicates>, kReplicates> products{};
  for (size_t p = 0; p < reference.pixels.size(); ++p) {
    const auto &x = picture.pixels[p].replicate, &r = reference.pixels[p].replicate;
    const double sum = kAll * mean_luminance(reference.pixels[p]);
    for (size_t k = 0; k < kReplicates; ++k) {
      d[k] = static_cast<double>(x[k]) - static_cast<double>(r[k]);
      difference[k] += d[k] / (pixels * mean);
    }
    for (size_t i = 0; i < kReplicates; ++i)
      for (size_t j = i + 1; j < kReplicates; ++j) {
        const double others = (sum - r[i] - r[j]) / (kAll - 2), scale = others * others + 1e-4 * mean * mean;
        if (scale > 0) products[i][j] += d[i] * d[j] / (pixels * scale);
      }
  }
  Bias bias;
  for (const double value : difference) bias.mean += value / kAll;
  bias.square = mean_of_pairs(products, kReplicates);
  for (size_t k = 0; k < kReplicates; ++k) without[k] = mean_of_pairs(products, k);
  const double middle = std::accumulate(without.begin(), without.end(), 0.0) / kAll;
  for (size_t k = 0; k < kReplicates; ++k) {
    bias.mean_error += std::pow(difference[k] - bias.mean, 2) / (kAll * (kAll - 1));
    bias.square_error += std::pow(without[k] - middle, 2) * (kAll - 1) / kAll;
  }
  bias.mean_error = std::sqrt(bias.mean_error);
  bias.square_error = std::sqrt(bias.square_error);
  return bias;
}

template <typename OfRound>
Ratio over_rounds(OfRound&& of_round) {
  std::array<double, kRounds> ratios;
  for (int i = 0; i < kRounds; ++i) ratios[size_t(i)] = of_round(i);
  const auto [low, high] = std::minmax_element(ratios.begin(), ratios.end());
  return {median(ratios), *low, *high};
}

}  // namespace

std::vector<Outcome> contest(const std::string& scene, const std::vector<Contender>& contenders, double seconds) {
  ReadOptions read;
  read.allow_outside_files = true;
  std::vector<Outcome> outcomes(contenders.size());
  std::vector<std::optional<FrameRenderer>> frames(contenders.size());
  for (size_t c = 0; c < contenders.size(); ++c) {
    outcomes[c].name = contenders[c].name;
    try {
      frames[c].emplace(scene, contenders[c].settings, read);
    } catch (const std::exception& error) {
      if (c == 0) throw;
      outcomes[c].refusal = error.what();
      continue;
    }
    outcomes[c].header = frames[c]->header();
    outcomes[c].samples = samples_within(*frames[c], seconds);
  }

  std::vector<std::vector<Tile>> tiles(contenders.size());
  for (int round = 0; round < kRounds; ++round)
    for (size_t c = 0; c < contenders.size(); ++c) {
      if (!frames[c]) continue;
      const int64_t n = outcomes[c].samples;
      tiles[c].push_back(render(*frames[c], {round * n, (round + 1) * n}, outcomes[c].seconds[size_t(round)]));
    }

  outcomes[0].all = join(tiles[0]);
  const std::vector<double> weights = weights_of(outcomes[0].all);
  for (size_t c = 0; c < contenders.size(); ++c) {
    if (!frames[c]) continue;
    for (int round = 0; round < kRounds; ++round) {
      const Tile& tile = tiles[c][size_t(round)];
      if (tile.pixels.size() != weights.size())
        throw std::invalid_argument(contenders[c].name + ": another picture size than the reference");
      double& sum = outcomes[c].relative_variance[size_t(round)];
      for (size_t p = 0; p < weights.size(); ++p) sum += weights[p] * variance_of_mean(tile.pixels[p], FoldWeights(tile.range));
    }
    outcomes[c].first = tiles[c].front();
    if (c > 0) outcomes[c].all = join(std::move(tiles[c]));
    outcomes[c].bias = bias_of(outcomes[c].all, outcomes[0].all);
  }
  return outcomes;
}

Ratio efficiency_ratio(const Outcome& a, const Outcome& b) {
  return over_rounds([&](int round) { return a.efficiency(round) / b.efficiency(round); });
}

double pooled_efficiency_ratio(const Outcome& a, const Outcome& b) {
  const auto cost = [](const Outcome& outcome) {
    return std::accumulate(outcome.relative_variance.begin(), outcome.relative_variance.end(), 0.0) *
           std::accumulate(outcome.seconds.begin(), outcome.seconds.end(), 0.0);
  };
  return cost(b) / cost(a);
}

Ratio time_ratio(const Outcome& a, const Outcome& b) {
  const double samples = static_cast<double>(b.samples) / static_cast<double>(a.samples);
  return over_rounds([&](int round) { return samples * a.seconds[size_t(round)] / b.seconds[size_t(round)]; });
}

std::string format(const Ratio& ratio) {
  if (!std::isfinite(ratio.median)) return "no noise";
  return fmt::format("{} [{}, {}]", three_digits(ratio.median), three_digits(ratio.lowest), three_digits(ratio.highest));
}

std::string format_mean(const Bias& bias) { return fmt::format("{:+.2f} % ± {:.2f} %", 100 * bias.mean, 100 * bias.mean_error); }

std::string format_pixels(const Bias& bias) {
  if (!(bias.square > 2 * bias.square_error)) {
    return fmt::format("< {} %", three_digits(100 * std::sqrt(std::max(0.0, bias.square) + 2 * bias.square_error)));
  }
  const double root = std::sqrt(bias.square);
  return fmt::format("{:.2f} % ± {:.2f} %", 100 * root, 100 * bias.square_error / (2 * root));
}

double median(std::array<double, kRounds> values) {
  std::sort(values.begin(), values.end());
  return (values[kRounds / 2 - 1] + values[kRounds / 2]) / 2;
}

std::string three_digits(double value) { return value >= 100 ? fmt::format("{:.0f}", value) : fmt::format("{:.3g}", value); }

}  // namespace woodcock::bench
