// pbrt-v4's procedural cloud: the same density from the same noise, so that its scenes have the same expectation.
#pragma once

#include "renderer/media/grid_map.h"
#include "renderer/scene/description.h"

namespace woodcock {

/// Gradient noise (Perlin 2002, "Improving Noise") at a point; in [−1, 1], zero at integer points, period 256.
float perlin_noise(Vec3 p);
/// Forward differences of the noise over 0.01, which pbrt-v4 uses as its gradient.
Vec3 perlin_noise_difference(Vec3 p);

/// A density in [0, 1] that falls with the medium-space height y; zero outside the box p0..p1.
class CloudField {
 public:
  CloudField() = default;
  CloudField(const CloudMediumDescription& cloud, const DMat4& render_from_medium);

  /// The density at a render-space point.
  float at(DVec3 p) const;
  /// The density at a point of medium space, with no regard to the box.
  float at_medium(Vec3 p) const;

  /// The average density over the box, by the midpoint rule on 16³ points.
  double mean() const;

  /// Maps the box p0..p1 to the unit cube.
  const GridMap& map() const { return map_; }

 private:
  GridMap map_, medium_from_render_;
  Vec3 lower_{0}, upper_{-1};
  float density_ = 1, wispiness_ = 1, frequency_ = 5;
};

}  // namespace woodcock
