// The pixel filter as a sampling technique.
#pragma once

#include <vector>

#include "renderer/core/vec.h"
#include "renderer/scene/description.h"

namespace woodcock {

/// Draws film positions in proportion to |f|, so that a sample belongs to one pixel, tiles need no border and a
/// merge of tiles is exact (Ernst et al. 2006, "Filter Importance Sampling").
class PixelFilter {
 public:
  explicit PixelFilter(const FilterDescription& filter);

  struct Sample {
    DVec2 offset;  ///< from the pixel's centre, in pixels, y down
    float weight;  ///< sign(f) · ∫|f| / ∫f: exactly 1 where f has no negative lobe; its mean is 1
  };
  /// `u` in [0,1)²; one number for each axis, as every filter here is a product of two functions of one variable.
  Sample sample(Vec2 u) const;

 private:
  /// One axis: f on equidistant nodes over [-radius, radius], linear in between.
  struct Axis {
    double radius = 0.5;
    std::vector<double> value;     // f at the nodes, zero crossings moved onto a node; empty for box and triangle
    std::vector<double> node;      // their positions
    std::vector<double> cdf;       // of |f|, normalised; cdf[i] belongs to node[i]
    std::vector<ptrdiff_t> guide;  // the first cdf above k/4096
    float weight = 1;              // ∫|f| / ∫f
  };
  static Axis tabulate(const FilterDescription& filter, double radius);
  double sample_axis(const Axis& axis, double u, float& weight) const;

  FilterDescription::Kind kind_;
  Axis x_, y_;
};

}  // namespace woodcock
