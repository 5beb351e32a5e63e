#include "renderer/lights/infinite_light.h"

#include <numbers>

#include "renderer/lights/octahedral.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {
namespace {

constexpr double kSphere = 4 * std::numbers::pi;
/// Of a pixel's radiance, that its remainder must be to be sampled.
constexpr double kMinRemainder = 1.0 / 16;

/// What MIS compensation leaves of the pixels: max(0, L − mean L).
std::vector<float> compensated(const std::vector<double>& radiances) {
  double mean = 0;
  for (const double radiance : radiances) mean += radiance;
  mean /= static_cast<double>(radiances.size());
  std::vector<float> weights;
  weights.reserve(radiances.size());
  for (const double radiance : radiances)
    weights.push_back(radiance - mean > kMinRemainder * radiance ? static_cast<float>(radiance - mean) : 0.0f);
  return weights;
}

/// What pbrt-v4 takes for the illuminance that the image casts on a horizontal patch: its sum over the upper
/// hemisphere carries 2π instead of 4π solid angle for the whole square. Scenes are made to that measure, so it is kept.
double pbrt_illuminance(const Image& image) {
  double sum = 0;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const double cosine = octahedral_to_sphere({(x + 0.5) / image.width, (y + 0.5) / image.height}).z;
      if (cosine > 0) sum += cosine * static_cast<double>(luminance(image.at(x, y)));
    }
  return sum * 2 * std::numbers::pi / (static_cast<double>(image.width) * image.height);
}

}  // namespace

InfiniteLight::InfiniteLight(const LightDescription& description, const InfiniteLightDescription& light, const DMat4& render_from_world,
                             float scene_radius)
    : scale_(light.radiance), scene_radius_(scene_radius) {
  if (light.image_file.empty()) {
    if (light.illuminance > 0) scale_ *= light.illuminance / kPi;
    return;
  }
  image_ = load_image(light.image_file, "", description.where);
  if (image_.width != image_.height)
    throw SceneError(description.where, "found the environment image \"" + image_.file + "\" of " + std::to_string(image_.width) + "x" +
                                            std::to_string(image_.height) + " pixels" +
                                            (image_.width == 2 * image_.height ? ", which is a latitude-longitude map" : "") +
                                            "; expected a square one in the equal-area octahedral mapping, as pbrt-v4's \"imgtool "
                                            "makeequiarea\" makes of a latitude-longitude map");
  std::vector<double> radiances;
  radiances.reserve(image_.pixels.size());
  glm::dvec3 sum(0);
  for (Rgb& pixel : image_.pixels) {
    pixel = glm::max(pixel, Rgb(0));
    radiances.push_back((static_cast<double>(pixel.r) + static_cast<double>(pixel.g) + static_cast<double>(pixel.b)) / 3);
    sum += glm::dvec3(pixel);
  }
  mean_ = Rgb(sum / static_cast<double>(image_.pixels.size()));
  if (light.illuminance > 0) {
    const double illuminance = pbrt_illuminance(image_);
    if (!(illuminance > 0))
      throw SceneError(description.where, "found \"illuminance\" with an image whose upper hemisphere is black: " + light.image_file);
    scale_ *= static_cast<float>(static_cast<double>(light.illuminance) / illuminance);
  }
  distribution_ = PiecewiseConstant2D(image_.width, image_.height, compensated(radiances));
  sampled_radiance_ = distribution_.total() / static_cast<double>(radiances.size()) * static_cast<double>(average(scale_));
  directions_ = DirectionMap(glm::inverse(glm::dmat3(render_from_world * description.world_from_light)));
}

std::optional<LightSample> InfiniteLight::sample(DVec3 /*ref*/, Vec2 u, double /*u_primitive*/) const {
  if (!(distribution_.total() > 0)) return std::nullopt;
  LightSample sample;
  sample.wi = Vec3(directions_.to_a(octahedral_to_sphere(distribution_.sample(DVec2(u)))));
  // Both are looked up by the rounded direction, so that they agree with what a ray along it would meet.
  sample.radiance = radiance(sample.wi);
  sample.pdf = pdf(sample.wi);
  if (is_black(sample.radiance) || !(sample.pdf > 0)) return std::nullopt;
  return sample;
}

Rgb InfiniteLight::radiance(Vec3 direction) const {
  if (image_.pixels.empty()) return scale_;
  const IVec2 pixel = distribution_.cell_of(sphere_to_octahedral(directions_.to_b(DVec3(direction))));
  return scale_ * image_.at(pixel.x, pixel.y);
}

float InfiniteLight::pdf(Vec3 direction) const {
  if (!(distribution_.total() > 0)) return 0;
  const DVec3 d(direction);
  const double pdf = distribution_.pdf(sphere_to_octahedral(directions_.to_b(d))) / kSphere;
  return static_cast<float>(pdf * directions_.solid_angle_ratio(d));
}

Rgb InfiniteLight::power() const { return 4 * kPi * kPi * scene_radius_ * scene_radius_ * scale_ * mean_; }

}  // namespace woodcock
