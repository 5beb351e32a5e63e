#include "renderer/lights/area_light.h"

#include <algorithm>
#include <numbers>

#include "renderer/scene/scene_error.h"

namespace woodcock {
namespace {

std::variant<MeshEmitter, QuadricEmitter> make_emitter(const Shape& shape, bool equal_weights) {
  if (std::holds_alternative<Quadric>(shape.geometry)) return QuadricEmitter(shape);
  return MeshEmitter(shape, equal_weights);
}

}  // namespace

AreaLight::AreaLight(const ShapeDescription& description, int shape_index, const Shape& shape, double scale)
    : shape_(shape_index), emitter_(make_emitter(shape, description.area_light->power > 0)), world_area_(1 / (scale * scale)) {
  const AreaLightDescription& light = *description.area_light;
  radiance_ = light.radiance * light.scale;
  power_ = std::max(0.0f, light.power);
  two_sided_ = light.two_sided;
  if (!light.image_file.empty()) {
    image_ = load_image(light.image_file, light.image_encoding, description.where);
    glm::dvec3 sum(0);
    for (Rgb& pixel : image_.pixels) {
      pixel = glm::max(pixel, Rgb(0));
      sum += glm::dvec3(pixel);
    }
    mean_ = Rgb(sum / static_cast<double>(image_.pixels.size()));
    if (power_ > 0 && is_black(mean_))
      throw SceneError(description.where, "found \"power\" with a black image, expected an image with light in it: " + light.image_file);
  }
  opacity_ = std::clamp(description.alpha.value, 0.0f, 1.0f);
  opacity_kind_ = description.alpha.texture != kNone ? Opacity::kTextured : opacity_ > 0 ? Opacity::kConstant : Opacity::kInvisible;
}

size_t AreaLight::primitives() const {
  return std::visit([](const auto& e) { return e.primitives(); }, emitter_);
}

double AreaLight::area(size_t primitive) const {
  return std::visit([&](const auto& e) { return e.area(primitive); }, emitter_);
}

Rgb AreaLight::radiance(uint32_t primitive, Vec2 uv) const {
  Rgb radiance = radiance_;
  // The picture's first row is at v = 1.
  if (!image_.pixels.empty()) radiance *= image_.bilinear({uv.x, 1 - uv.y}, ImageWrap::kClamp);
  if (power_ > 0) {
    const double a = area(primitive) * world_area_;
    if (!(a > 0)) return Rgb(0);
    const double mean = image_.pixels.empty() ? 1.0 : static_cast<double>(luminance(mean_));
    radiance *= static_cast<float>(static_cast<double>(power_) / (mean * (two_sided_ ? 2 : 1) * a * std::numbers::pi));
  }
  return radiance;
}

std::optional<LightSample> AreaLight::sample(DVec3 ref, Vec2 u, double u_primitive, Pieces pieces) const {
  if (opacity_kind_ == Opacity::kTextured) return std::nullopt;
  const std::optional<EmitterSample> point =
      std::visit([&](const auto& e) { return e.sample(ref, DVec2(u), u_primitive, pieces); }, emitter_);
  if (!point || (!two_sided_ && !(glm::dot(point->ng, point->wi) < 0))) return std::nullopt;
  LightSample sample;
  sample.radiance = radiance(point->primitive, point->uv);
  if (opacity_kind_ == Opacity::kConstant) sample.radiance *= opacity_;
  sample.wi = Vec3(point->wi);
  sample.is_bounded = true;
  sample.pdf = static_cast<float>(point->pdf);
  sample.delta = opacity_kind_ == Opacity::kInvisible;
  sample.p = point->p;
  sample.target = {shape_, point->primitive, point->along};
  sample.n = Vec3(point->ng);
  if (is_black(sample.radiance) || !(sample.pdf > 0) || !std::isfinite(sample.pdf)) return std::nullopt;
  return sample;
}

Rgb AreaLight::emitted(const EmitterHit& hit, Vec3 wo) const {
  if (!two_sided_ && !(glm::dot(hit.ng, wo) > 0)) return Rgb(0);
  return radiance(hit.primitive, hit.uv);
}

float AreaLight::pdf(DVec3 ref, const EmitterHit& hit, DVec3 wi, Pieces pieces) const {
  if (opacity_kind_ != Opacity::kConstant) return 0;
  return static_cast<float>(std::visit([&](const auto& e) { return e.pdf(ref, hit, wi, pieces); }, emitter_));
}

LightBounds AreaLight::bounds(Box3 box) const {
  LightBounds bounds{DVec3(box.lower), DVec3(box.upper)};
  bounds.axes = std::visit([](const auto& e) { return e.normals(); }, emitter_);
  bounds.cos_emission = 0;
  bounds.two_sided = two_sided_;
  // Radiance × area. A surface that faces all ways shows a fourth of it (Cauchy).
  bounds.intensity = static_cast<double>(average(power())) / (std::numbers::pi * (two_sided_ ? 2 : 1));
  if (!(bounds.axes.cos_angle > -1)) bounds.intensity /= 4;
  return bounds;
}

Rgb AreaLight::power() const {
  if (opacity_kind_ == Opacity::kTextured) return Rgb(0);
  double total_area = 0;
  for (size_t i = 0; i < primitives(); ++i) total_area += area(i);
  const double opacity = opacity_kind_ == Opacity::kConstant ? static_cast<double>(opacity_) : 1.0;
  const double sides = two_sided_ ? 2 : 1;
  if (power_ > 0) {
    double shining = 0;
    for (size_t i = 0; i < primitives(); ++i) shining += area(i) > 0 ? 1 : 0;
    const double mean = image_.pixels.empty() ? 1.0 : static_cast<double>(luminance(mean_));
    return Rgb(glm::dvec3(radiance_ * mean_) * (static_cast<double>(power_) * shining * opacity / (mean * world_area_)));
  }
  return Rgb(glm::dvec3(radiance_ * mean_) * (total_area * std::numbers::pi * sides * opacity));
}

}  // namespace woodcock
