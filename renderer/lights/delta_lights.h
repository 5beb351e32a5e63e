// Lights that reach a point from a single direction: point, spot and distant. No ray meets them by chance.
#pragma once

#include "renderer/lights/light.h"
#include "renderer/lights/light_bounds.h"

namespace woodcock {

/// A point that shines equally in all directions.
class PointLight {
 public:
  PointLight(const LightDescription& description, const PointLightDescription& light, const DMat4& render_from_world, double scale);
  std::optional<LightSample> sample(DVec3 ref, Vec2 u, double u_primitive) const;
  Rgb power() const { return 4 * kPi * intensity_; }
  LightBounds bounds() const { return {position_, position_, static_cast<double>(average(intensity_))}; }
  DVec3 position() const { return position_; }

 private:
  DVec3 position_;
  Rgb intensity_;  // radiant intensity × scale²
};

/// A point that shines into a cone, with a smoothstep of the cosine between the full and the zero part.
class SpotLight {
 public:
  SpotLight(const LightDescription& description, const SpotLightDescription& light, const DMat4& render_from_world, double scale);
  std::optional<LightSample> sample(DVec3 ref, Vec2 u, double u_primitive) const;
  Rgb power() const { return static_cast<float>(effective_solid_angle_) * intensity_; }
  LightBounds bounds() const;
  DVec3 position() const { return position_; }

 private:
  /// Share of the intensity in a direction given in render space, away from the light.
  double falloff(DVec3 direction) const;

  DVec3 position_;
  glm::dmat3 light_from_render_;
  DVec3 axis_;  // unit, in light space
  double cos_full_, cos_zero_;
  double effective_solid_angle_;  // ∫ falloff dω
  Rgb intensity_;
};

/// Parallel light from infinitely far away, described by its irradiance on a plane at right angles to it.
class DistantLight {
 public:
  /// `scene_radius` in render space, for the power.
  DistantLight(const LightDescription& description, const DistantLightDescription& light, const DMat4& render_from_world,
               float scene_radius);
  std::optional<LightSample> sample(DVec3 ref, Vec2 u, double u_primitive) const;
  Rgb power() const { return kPi * scene_radius_ * scene_radius_ * irradiance_; }
  double irradiance() const { return static_cast<double>(average(irradiance_)); }

 private:
  Vec3 wi_;  // unit, towards the light
  Rgb irradiance_;
  float scene_radius_;
};

}  // namespace woodcock
