// Light from infinitely far away in every direction.
#pragma once

#include "renderer/lights/light.h"

namespace woodcock {

/// An infinite sphere of constant radiance.
class InfiniteLight {
 public:
  /// `scene_radius` in render space, for the power.
  InfiniteLight(const LightDescription& description, const InfiniteLightDescription& light, const DMat4& render_from_world,
                float scene_radius);
  std::optional<LightSample> sample(Vec3 ref, Vec2 u, float u_primitive) const;
  /// Radiance arriving from `direction` (unit, render space, away from the scene).
  Rgb radiance(Vec3 direction) const;
  /// The pdf with which `sample` gives `direction`, per solid angle.
  float pdf(Vec3 direction) const;
  Rgb power() const;

 private:
  Rgb scale_;  // of the image, or the constant radiance
  float scene_radius_;
};

}  // namespace woodcock
