#include "renderer/film/dyadic.h"

#include <algorithm>
#include <numeric>

namespace woodcock {

std::vector<SampleRange> dyadic_nodes(SampleRange r) {
  std::vector<SampleRange> nodes;
  if (r.begin < 0 || r.end > kMaxSamples) return nodes;
  for (int64_t at = r.begin; at < r.end;) {
    // The largest power of two that both divides the begin and fits into the rest.
    const uint64_t fits = std::bit_floor(static_cast<uint64_t>(r.end - at));
    const uint64_t aligned = at == 0 ? fits : static_cast<uint64_t>(at & -at);
    const auto size = static_cast<int64_t>(std::min(fits, aligned));
    nodes.push_back({at, at + size});
    at += size;
  }
  return nodes;
}

int64_t samples_of_replicate(SampleRange r, int k) {
  if (r.empty()) return 0;
  // Indices below n that are congruent to k.
  const auto below = [k](int64_t n) { return (n - k + kReplicates - 1) / kReplicates; };
  return below(r.end) - below(r.begin);
}

std::vector<size_t> fold_order(std::span<const SampleRange> ranges) {
  std::vector<size_t> order(ranges.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    if (ranges[a].size() != ranges[b].size()) return ranges[a].size() > ranges[b].size();
    return ranges[a].begin < ranges[b].begin;
  });
  return order;
}

namespace {

/// (n·a + m·b)/(n + m).
float weighted_mean(double n, float a, double m, float b) {
  return film::to_float((n * static_cast<double>(a) + m * static_cast<double>(b)) / (n + m));
}

float weighted_deviation(double n, float sa, float a, double m, float sb, float b) {
  const double total = n + m, s = sa, t = sb, d = static_cast<double>(a) - static_cast<double>(b);
  return film::to_float(std::sqrt((n * s * s + m * t * t) / total + (n / total) * (m / total) * d * d));
}

}  // namespace

FoldWeights::FoldWeights(SampleRange range) : samples(static_cast<double>(range.size())) {
  for (int k = 0; k < kReplicates; ++k) of_replicate[static_cast<size_t>(k)] = static_cast<double>(samples_of_replicate(range, k));
}

void FoldWeights::add(const FoldWeights& more) {
  samples += more.samples;
  for (size_t k = 0; k < kReplicates; ++k) of_replicate[k] += more.of_replicate[k];
}

void fold_into(PixelStats& sum, const FoldWeights& have, const PixelStats& next, const FoldWeights& added) {
  if (sum.missing() || next.missing()) {
    sum = {};
    return;
  }
  const double n = have.samples, m = added.samples;
  for (int c = 0; c < 3; ++c) {
    // The deviation first: it needs both old means.
    sum.deviation[c] = weighted_deviation(n, sum.deviation[c], sum.mean[c], m, next.deviation[c], next.mean[c]);
    sum.mean[c] = weighted_mean(n, sum.mean[c], m, next.mean[c]);
    sum.albedo[c] = weighted_mean(n, sum.albedo[c], m, next.albedo[c]);
    sum.normal[c] = weighted_mean(n, sum.normal[c], m, next.normal[c]);
  }
  sum.depth = weighted_mean(n, sum.depth, m, next.depth);
  for (size_t k = 0; k < kReplicates; ++k)
    if (added.of_replicate[k] > 0)
      sum.replicate[k] = weighted_mean(have.of_replicate[k], sum.replicate[k], added.of_replicate[k], next.replicate[k]);
  sum.largest = std::max(sum.largest, next.largest);
  sum.count = static_cast<float>(n + m);
}

PixelStats fold(std::span<const SampleRange> ranges, std::span<const PixelStats> nodes) {
  PixelStats sum;
  FoldWeights have;
  for (const size_t i : fold_order(ranges)) {
    const FoldWeights added(ranges[i]);
    if (have.samples == 0) {
      sum = nodes[i];
    } else {
      fold_into(sum, have, nodes[i], added);
    }
    have.add(added);
  }
  return sum;
}

}  // namespace woodcock
