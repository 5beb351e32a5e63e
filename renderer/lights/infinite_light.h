// Light from infinitely far away in every direction.
#pragma once

#include "renderer/core/distribution.h"
#include "renderer/lights/direction_map.h"
#include "renderer/lights/light.h"
#include "renderer/textures/image.h"

namespace woodcock {

/// An infinite sphere of constant radiance, or one that carries an equal-area octahedral image (+z of light space
/// at the centre of the picture, see octahedral.h).
///
/// As in pbrt-v4 the image is not interpolated: each pixel is a region of constant radiance and solid angle
/// 4π/(width · height), so that the distribution over pixels is the exact one and a single lit pixel does not leak.
class InfiniteLight {
 public:
  /// `scene_radius` in render space, for the power. Throws SceneError for an image that is not square or holds no
  /// light where `illuminance` asks for some.
  InfiniteLight(const LightDescription& description, const InfiniteLightDescription& light, const DMat4& render_from_world,
                float scene_radius);
  std::optional<LightSample> sample(DVec3 ref, Vec2 u, double u_primitive) const;
  /// Radiance arriving from `direction` (unit, render space, away from the scene).
  Rgb radiance(Vec3 direction) const;
  /// The pdf with which `sample` gives `direction`, per solid angle.
  float pdf(Vec3 direction) const;
  Rgb power() const;
  /// The image, without pixels where there is none.
  const Image& image() const { return image_; }

 private:
  Rgb scale_;    // of the image, or the constant radiance
  Image image_;  // without pixels where the radiance is constant; negative values are set to 0
  Rgb mean_{1};  // of the image
  PiecewiseConstant2D distribution_;
  DirectionMap directions_;  // a: render space, b: light space
  float scene_radius_;
};

}  // namespace woodcock
