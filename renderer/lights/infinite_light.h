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
///
/// Directions are drawn in proportion to max(0, L − mean L): scattering finds the constant part without noise of its own, and
/// multiple importance sampling gives it the weight where this density is low (MIS compensation: Karlík, Šik, Vévoda, Skřivan &
/// Křivánek 2019). What remains of a pixel below 1/16 of its radiance is left out, so that radiance over density stays bounded
/// without weights, too. A direction of density 0 is never sampled and has weight 1 when scattering finds it; of a constant
/// sky that is every direction.
class InfiniteLight {
 public:
  /// `scene_radius` in render space, for the power. Throws SceneError for an image that is not square or holds no
  /// light where `illuminance` asks for some.
  InfiniteLight(const LightDescription& description, const InfiniteLightDescription& light, const DMat4& render_from_world,
                float scene_radius);
  /// Nothing for a constant sky.
  std::optional<LightSample> sample(DVec3 ref, Vec2 u, double u_primitive) const;
  /// Radiance arriving from `direction` (unit, render space, away from the scene).
  Rgb radiance(Vec3 direction) const;
  /// The pdf with which `sample` gives `direction`, per solid angle; 0 where it never does.
  float pdf(Vec3 direction) const;
  Rgb power() const;
  /// The part of the mean radiance that lies in what is sampled after the subtraction, average of the channels; 0 if nothing is.
  double sampled_radiance() const { return sampled_radiance_; }
  /// The image, without pixels where there is none.
  const Image& image() const { return image_; }

 private:
  Rgb scale_;    // of the image, or the constant radiance
  Image image_;  // without pixels where the radiance is constant; negative values are set to 0
  Rgb mean_{1};  // of the image
  double sampled_radiance_ = 0;
  PiecewiseConstant2D distribution_;
  DirectionMap directions_;  // a: render space, b: light space
  float scene_radius_;
};

}  // namespace woodcock
