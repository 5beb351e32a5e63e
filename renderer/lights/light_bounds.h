// What of a light, or of a group of lights, can arrive at a point, at the most.
#pragma once

#include "renderer/core/vec.h"

namespace woodcock {

/// Directions within an angle of an axis; all of them where the cosine is −1.
struct DirectionCone {
  DVec3 axis{0, 0, 1};
  double cos_angle = -1;
};

/// Bounds of lights that stand somewhere (Conty Estevez & Kulla 2018, section 4; pbrt-v4, LightBounds). Render space.
struct LightBounds {
  DVec3 lower{0}, upper{0};
  double intensity = 0;     ///< the sum of the largest radiant intensities (radiance × area for a surface), average of the channels
  DirectionCone axes{};     ///< holds the normals, or the inner cones of spot lights
  double cos_emission = 1;  ///< of the angle around each axis beyond which nothing is emitted
  bool two_sided = false;   ///< emission is the same along −axis

  /// An estimate of the irradiance at right angles, intensity · cos / d², that is positive wherever light can arrive. The cosine is
  /// that of the least angle to an axis that any point of the bounding sphere allows, and at least 0.05; d is at least the
  /// radius of that sphere.
  double importance(DVec3 p) const;
};

/// Bounds of both groups.
LightBounds merged(const LightBounds& a, const LightBounds& b);
/// The smallest cone of this kind around both.
DirectionCone merged(const DirectionCone& a, const DirectionCone& b);

}  // namespace woodcock
