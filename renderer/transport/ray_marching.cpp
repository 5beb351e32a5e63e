#include "renderer/transport/ray_marching.h"

#include <cmath>

namespace woodcock {
namespace {

/// The order of the series: 0 nine times in ten, since the combs are fine enough for the rest to be small; else at least 2,
/// and each further one with probability 2/k (Bhanot & Kennedy 1985; the shares are those of the paper's section 5).
constexpr double kOrderZero = 0.9;
constexpr int kSureOrder = 2, kMaxOrder = 20;

struct Order {
  int order = 0;
  std::array<double, kMaxOrder + 1> weight{1};
};

Order draw_order(Stream& random) {
  Order result;
  if (random.uniform() < static_cast<float>(kOrderZero)) return result;
  double probability = 1 - static_cast<double>(static_cast<float>(kOrderZero));
  for (int k = 1;; ++k) {
    if (k > kSureOrder) {
      // Order 20 is passed once in 1e12 and its term is below 1e-18 of the whole; the series ends there.
      const double next = static_cast<double>(kSureOrder) / k;
      if (k > kMaxOrder || random.uniform_double() >= next) return result;
      probability *= next;
    }
    result.order = k;
    result.weight[static_cast<size_t>(k)] = 1 / probability;
  }
}

/// Points of a comb: enough that one comb nearly does (the paper's equation 14).
int comb_points(double depth) { return static_cast<int>(std::ceil(std::cbrt((0.015 + depth) * (0.65 + depth) * (60.3 + depth)))); }

/// One estimate of −∫ (σt − σl) per channel.
DVec3 comb(const Medium& medium, const Ray& ray, const MarchedSegments& segments, int points, bool grey, double offset) {
  const double step = segments.depth() / points;
  const MarchedSegments::Part* part = segments.begin();
  DVec3 sum(0);
  for (int i = 0; i < points; ++i) {
    const double depth = (i + offset) * step;
    while (part + 1 != segments.end() && (part + 1)->begin <= depth) ++part;
    const MajorantSegment& s = part->segment;
    const float rate = s.sigma - s.lower;
    const DVec3 p = ray.at(std::min(s.t1, s.t0 + (depth - part->begin) / static_cast<double>(rate)));
    sum += DVec3((grey ? Rgb(medium.grey_sigma_t(p)) : medium.sigma_t(p)) - s.lower) / static_cast<double>(rate);
  }
  return sum * -step;
}

/// Σ_k w_k m_k(x)/k! of the n = order numbers x, per channel by the caller.
double series(const std::array<double, kMaxOrder>& x, const Order& order) {
  // Elementary symmetric polynomials, one number after the other.
  std::array<double, kMaxOrder + 1> e{1};
  for (int i = 0; i < order.order; ++i)
    for (int k = i + 1; k >= 1; --k) e[static_cast<size_t>(k)] += e[static_cast<size_t>(k - 1)] * x[static_cast<size_t>(i)];
  double sum = 0, binomial = 1, factorial = 1;
  for (int k = 0; k <= order.order; ++k) {
    if (k > 0) {
      binomial *= static_cast<double>(order.order - k + 1) / k;
      factorial *= k;
    }
    sum += order.weight[static_cast<size_t>(k)] * e[static_cast<size_t>(k)] / (binomial * factorial);
  }
  return sum;
}

}  // namespace

MarchedSegments::MarchedSegments(const Medium& medium, const Ray& ray, double t_max, bool bricks) {
  MajorantIterator walk(medium, ray, t_max, bricks);
  while (const auto segment = walk.next()) {
    const double length = segment->t1 - segment->t0;
    lower_depth_ += static_cast<double>(segment->lower) * length;
    if (!(segment->sigma > segment->lower)) continue;
    if (count_ == parts_.size()) {
      overflows_ = true;
      return;
    }
    parts_[count_++] = {*segment, depth_};
    depth_ += static_cast<double>(segment->sigma - segment->lower) * length;
  }
}

double MarchedSegments::lower_transmittance() const { return std::exp(-lower_depth_); }

Rgb march_transmittance(const Medium& medium, const Ray& ray, const MarchedSegments& segments, bool grey, Stream& random,
                        uint64_t& look_ups) {
  const int points = comb_points(segments.depth());
  const Order order = draw_order(random);
  std::array<DVec3, kMaxOrder + 1> x;
  for (int i = 0; i <= order.order; ++i) {
    x[static_cast<size_t>(i)] = comb(medium, ray, segments, points, grey, random.uniform_double());
    look_ups += static_cast<uint64_t>(points);
  }
  Rgb result;
  for (int c = 0; c < (grey ? 1 : 3); ++c) {
    double sum = 0;
    for (int pivot = 0; pivot <= order.order; ++pivot) {
      const double at = x[static_cast<size_t>(pivot)][c];
      std::array<double, kMaxOrder> others{};
      int n = 0;
      for (int j = 0; j <= order.order; ++j)
        if (j != pivot) others[static_cast<size_t>(n++)] = x[static_cast<size_t>(j)][c] - at;
      sum += std::exp(at) * series(others, order);
    }
    result[c] = static_cast<float>(sum / (order.order + 1));
  }
  return grey ? Rgb(result.x) : result;
}

}  // namespace woodcock
