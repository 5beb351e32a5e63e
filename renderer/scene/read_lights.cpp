// LightSource and AreaLightSource.
#include <algorithm>
#include <cmath>

#include "renderer/scene/read_parts.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

float read_scale(Parameters& parameters) {
  const float scale = parameters.real("scale", 1);
  if (!(scale >= 0))
    throw SceneError(parameters.place("scale"),
                     "found scale = " + std::to_string(scale) + " for " + parameters.directive() + ", expected at least 0");
  return scale;
}

/// Value of a parameter that counts only when positive, as `power` and `illuminance` do; 0 otherwise.
float positive(Parameters& parameters, const std::string& name) { return std::fmax(parameters.real(name, -1), 0.0f); }

Rgb finite(const Rgb& value, const Parameters& parameters) {
  if (!is_finite(value)) throw SceneError(parameters.where(), "found a light too bright for a float in " + parameters.directive());
  return value;
}

PointLightDescription read_point(Parameters& parameters) {
  PointLightDescription light;
  light.position = parameters.point("from", DVec3(0));
  const Rgb spectrum = parameters.color("I", SpectrumUse::kIlluminant).value_or(Rgb(1));
  float scale = read_scale(parameters);
  if (const float power = positive(parameters, "power"); power > 0) scale *= power / (4 * kPi);
  light.intensity = finite(scale * spectrum, parameters);
  return light;
}

SpotLightDescription read_spot(Parameters& parameters) {
  SpotLightDescription light;
  light.from = parameters.point("from", DVec3(0));
  light.to = parameters.point("to", DVec3(0, 0, 1));
  if (!(glm::length(light.to - light.from) > 0))
    throw SceneError(parameters.place("to"), "found a spot light whose from and to are the same point");
  light.cone_angle = static_cast<float>(parameters.number_within("coneangle", 30, 0, 180));
  // The smooth edge reaches the axis at most.
  light.cone_delta_angle = std::min(light.cone_angle, static_cast<float>(parameters.number_within("conedeltaangle", 5, 0, 180)));
  const Rgb spectrum = parameters.color("I", SpectrumUse::kIlluminant).value_or(Rgb(1));
  float scale = read_scale(parameters);
  if (const float power = positive(parameters, "power"); power > 0) {
    // ∫ falloff dω: the smooth edge counts by its mean, as in pbrt-v4.
    const double total = std::cos(glm::radians(double{light.cone_angle}));
    const double start = std::cos(glm::radians(double{light.cone_angle} - double{light.cone_delta_angle}));
    scale = static_cast<float>(scale * power / (2 * double{kPi} * ((1 - start) + (start - total) / 2)));
  }
  light.intensity = finite(scale * spectrum, parameters);
  return light;
}

DistantLightDescription read_distant(Parameters& parameters) {
  DistantLightDescription light;
  light.from = parameters.point("from", DVec3(0));
  light.to = parameters.point("to", DVec3(0, 0, 1));
  if (!(glm::length(light.to - light.from) > 0))
    throw SceneError(parameters.place("to"), "found a distant light whose from and to are the same point");
  const Rgb spectrum = parameters.color("L", SpectrumUse::kIlluminant).value_or(Rgb(1));
  float scale = read_scale(parameters);
  if (const float illuminance = positive(parameters, "illuminance"); illuminance > 0) scale *= illuminance;
  light.radiance = finite(scale * spectrum, parameters);
  return light;
}

InfiniteLightDescription read_infinite(Parameters& parameters) {
  InfiniteLightDescription light;
  const std::optional<Rgb> spectrum = parameters.color("L", SpectrumUse::kIlluminant);
  const std::filesystem::path file = parameters.file("filename");
  float scale = read_scale(parameters);
  const float illuminance = positive(parameters, "illuminance");
  parameters.refuse("portal", true);
  if (spectrum && !file.empty())
    throw SceneError(parameters.place("L"), "found both \"L\" and \"filename\" for " + parameters.directive() + ", expected one of them");
  if (file.empty()) {
    // A uniform hemisphere of radiance L gives the illuminance π L.
    if (illuminance > 0) scale *= illuminance / kPi;
    light.radiance = finite(scale * spectrum.value_or(Rgb(1)), parameters);
    return light;
  }
  parameters.context().files.record(file, parameters.place("filename"));
  light.image_file = file.string();
  light.radiance = Rgb(scale);
  light.illuminance = illuminance;
  return light;
}

}  // namespace

std::optional<LightKind> read_light(const std::string& kind, Parameters& parameters) {
  if (kind == "point") return read_point(parameters);
  if (kind == "spot") return read_spot(parameters);
  if (kind == "distant") return read_distant(parameters);
  if (kind == "infinite") return read_infinite(parameters);
  refuse_kind(parameters.context(), parameters.where(), "LightSource", kind, {"point", "spot", "distant", "infinite"},
              {"goniometric", "projection"});
  return std::nullopt;
}

std::optional<AreaLightDescription> read_area_light(const std::string& kind, Parameters& parameters) {
  if (kind != "diffuse") {
    refuse_kind(parameters.context(), parameters.where(), "AreaLightSource", kind, {"diffuse"}, {});
    return std::nullopt;
  }
  AreaLightDescription light;
  const std::optional<Rgb> spectrum = parameters.color("L", SpectrumUse::kIlluminant);
  light.scale = read_scale(parameters);
  light.power = positive(parameters, "power");
  light.two_sided = parameters.boolean("twosided", false);
  const std::filesystem::path file = parameters.file("filename");
  if (spectrum && !file.empty())
    throw SceneError(parameters.place("L"), "found both \"L\" and \"filename\" for " + parameters.directive() + ", expected one of them");
  if (!file.empty()) {
    parameters.context().files.record(file, parameters.place("filename"));
    light.image_file = file.string();
  }
  light.radiance = spectrum.value_or(Rgb(1));
  return light;
}

}  // namespace woodcock
