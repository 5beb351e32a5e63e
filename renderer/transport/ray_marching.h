// Transmittance by ray marching without bias.
#pragma once

#include <array>

#include "renderer/core/random.h"
#include "renderer/media/majorant_iterator.h"
#include "renderer/media/medium.h"

namespace woodcock {

/// The parts of a ray through a medium, laid end to end by the optical depth of what lies between the bounds of σt.
class MarchedSegments {
 public:
  /// Walks the bricks along ray.at(0 … t_max); t_max is finite.
  MarchedSegments(const Medium& medium, const Ray& ray, double t_max, bool bricks);

  /// ∫ (σ̄ − σl): the most that the unknown part of the optical depth can be.
  double depth() const { return depth_; }
  /// exp(−∫ σl): what the known part lets through.
  double lower_transmittance() const;
  /// More bricks than fit: nothing here may be used.
  bool overflows() const { return overflows_; }

  struct Part {
    MajorantSegment segment;
    double begin;  ///< depth before it
  };
  const Part* begin() const { return parts_.data(); }
  const Part* end() const { return parts_.data() + count_; }

 private:
  std::array<Part, 96> parts_;
  size_t count_ = 0;
  double depth_ = 0, lower_depth_ = 0;
  bool overflows_ = false;
};

/// An unbiased estimate of exp(−∫ (σt − σl)) (Kettunen, d'Eon, Pantaleoni & Novák 2021, "An Unbiased Ray-Marching
/// Transmittance Estimator", sections 4 and 5): the mean over pivots X_i of
///   e^{X_i} Σ_k w_k m_k({X_j − X_i}) / k!,
/// the X independent estimates of −∫ (σt − σl) by combs of `points` equal steps of depth with one random offset, m_k the
/// elementary symmetric means, and 1/w_k the probability that the series is evaluated to order k. May be negative.
/// `look_ups` is raised by the points looked at.
Rgb march_transmittance(const Medium& medium, const Ray& ray, const MarchedSegments& segments, bool grey, Stream& random,
                        uint64_t& look_ups);

}  // namespace woodcock
