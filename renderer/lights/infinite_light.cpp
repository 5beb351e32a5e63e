#include "renderer/lights/infinite_light.h"

#include "renderer/core/warp.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

InfiniteLight::InfiniteLight(const LightDescription& description, const InfiniteLightDescription& light, const DMat4& /*render_from_world*/,
                             float scene_radius)
    : scale_(light.radiance), scene_radius_(scene_radius) {
  if (!light.image_file.empty()) throw SceneError(description.where, "found an environment image, expected a constant radiance");
  if (light.illuminance > 0) scale_ *= light.illuminance / kPi;
}

std::optional<LightSample> InfiniteLight::sample(Vec3 /*ref*/, Vec2 u, float /*u_primitive*/) const {
  LightSample sample;
  sample.wi = square_to_sphere(u);
  sample.radiance = radiance(sample.wi);
  sample.pdf = pdf(sample.wi);
  if (is_black(sample.radiance)) return std::nullopt;
  return sample;
}

Rgb InfiniteLight::radiance(Vec3 /*direction*/) const { return scale_; }

float InfiniteLight::pdf(Vec3 /*direction*/) const { return square_to_sphere_pdf(); }

Rgb InfiniteLight::power() const { return 4 * kPi * kPi * scene_radius_ * scene_radius_ * scale_; }

}  // namespace woodcock
