#include "renderer/lights/delta_lights.h"

#include <algorithm>
#include <numbers>

#include "renderer/core/transform.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {
namespace {

/// A sample of light of intensity `intensity` at `position`; the distance is taken in double, since a light close
/// by or far from the origin leaves few digits of it in float.
std::optional<LightSample> sample_position(DVec3 position, Rgb intensity, DVec3 ref) {
  const DVec3 to_light = position - ref;
  const double distance_squared = glm::dot(to_light, to_light);
  if (!(distance_squared > 0) || is_black(intensity)) return std::nullopt;
  const double distance = std::sqrt(distance_squared);
  LightSample sample;
  sample.radiance = Rgb(glm::dvec3(intensity) / distance_squared);
  sample.wi = Vec3(to_light / distance);
  sample.is_bounded = true;
  sample.delta = true;
  sample.p = position;
  return sample;
}

double smoothstep(double x, double lower, double upper) {
  const double t = std::clamp((x - lower) / (upper - lower), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

}  // namespace

PointLight::PointLight(const LightDescription& description, const PointLightDescription& light, const DMat4& render_from_world,
                       double scale)
    : position_(transform_point(render_from_world * description.world_from_light, light.position)) {
  const double factor = scale * scale * (light.power > 0 ? static_cast<double>(light.power) / (4 * std::numbers::pi) : 1.0);
  intensity_ = Rgb(glm::dvec3(light.intensity) * factor);
}

std::optional<LightSample> PointLight::sample(DVec3 ref, Vec2 /*u*/, double /*u_primitive*/) const {
  return sample_position(position_, intensity_, ref);
}

SpotLight::SpotLight(const LightDescription& description, const SpotLightDescription& light, const DMat4& render_from_world, double scale) {
  const DMat4 render_from_light = render_from_world * description.world_from_light;
  position_ = transform_point(render_from_light, light.from);
  light_from_render_ = glm::inverse(glm::dmat3(render_from_light));
  const DVec3 along = light.to - light.from;
  if (!(glm::dot(along, along) > 0)) throw SceneError(description.where, "found a spot light whose \"from\" and \"to\" are equal");
  axis_ = glm::normalize(along);
  const double degree = std::numbers::pi / 180;
  cos_zero_ = std::cos(static_cast<double>(light.cone_angle) * degree);
  cos_full_ = std::cos(static_cast<double>(light.cone_angle - light.cone_delta_angle) * degree);
  // The mean of a smoothstep over its interval is 1/2.
  effective_solid_angle_ = 2 * std::numbers::pi * ((1 - cos_full_) + (cos_full_ - cos_zero_) / 2);
  const double factor = scale * scale * (light.power > 0 ? static_cast<double>(light.power) / effective_solid_angle_ : 1.0);
  intensity_ = Rgb(glm::dvec3(light.intensity) * factor);
}

double SpotLight::falloff(DVec3 direction) const {
  const double cosine = glm::dot(glm::normalize(light_from_render_ * direction), axis_);
  if (cosine >= cos_full_) return 1;
  if (cosine <= cos_zero_) return 0;
  return smoothstep(cosine, cos_zero_, cos_full_);
}

LightBounds SpotLight::bounds() const {
  LightBounds bounds{position_, position_, static_cast<double>(average(intensity_))};
  // A transform that changes angles leaves no cone with this axis.
  const glm::dmat3 m = glm::inverse(light_from_render_), product = glm::transpose(m) * m;
  const double size = product[0][0];
  bool keeps_angles = true;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) keeps_angles = keeps_angles && std::abs(product[i][j] - (i == j ? size : 0)) <= 1e-9 * size;
  if (!keeps_angles || !(cos_full_ >= cos_zero_)) return bounds;
  bounds.axes = {glm::normalize(m * axis_), cos_full_};
  bounds.cos_emission =
      cos_zero_ * cos_full_ + std::sqrt(std::max(0.0, 1 - cos_zero_ * cos_zero_) * std::max(0.0, 1 - cos_full_ * cos_full_));
  return bounds;
}

std::optional<LightSample> SpotLight::sample(DVec3 ref, Vec2 /*u*/, double /*u_primitive*/) const {
  return sample_position(position_, intensity_ * static_cast<float>(falloff(ref - position_)), ref);
}

DistantLight::DistantLight(const LightDescription& description, const DistantLightDescription& light, const DMat4& render_from_world,
                           float scene_radius)
    : irradiance_(light.radiance * (light.illuminance > 0 ? light.illuminance : 1.0f)), scene_radius_(scene_radius) {
  const DVec3 towards = glm::dmat3(render_from_world * description.world_from_light) * (light.from - light.to);
  if (!(glm::dot(towards, towards) > 0)) throw SceneError(description.where, "found a distant light whose \"from\" and \"to\" are equal");
  wi_ = Vec3(glm::normalize(towards));
}

std::optional<LightSample> DistantLight::sample(DVec3 /*ref*/, Vec2 /*u*/, double /*u_primitive*/) const {
  if (is_black(irradiance_)) return std::nullopt;
  LightSample sample;
  sample.radiance = irradiance_;
  sample.wi = wi_;
  sample.delta = true;
  return sample;
}

}  // namespace woodcock
