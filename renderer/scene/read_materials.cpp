// Material and MakeNamedMaterial.
#include <cmath>

#include "renderer/scene/read_parts.h"
#include "renderer/scene/scattering_presets.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

RoughnessDescription read_roughness(Parameters& parameters, const std::string& prefix, bool remap) {
  const FloatParameter both = parameters.float_or_texture(prefix + "roughness", 0);
  RoughnessDescription roughness;
  roughness.u = parameters.optional_float_or_texture(prefix + "uroughness").value_or(both);
  roughness.v = parameters.optional_float_or_texture(prefix + "vroughness").value_or(both);
  roughness.remap = remap;
  if (roughness.u.value < 0 || roughness.v.value < 0)
    throw SceneError(parameters.where(), "found a negative roughness for " + parameters.directive() + ", expected at least 0");
  return roughness;
}

RoughnessDescription read_roughness(Parameters& parameters) {
  const bool remap = parameters.boolean("remaproughness", true);
  return read_roughness(parameters, "", remap);
}

ConductorDescription read_conductor(Parameters& parameters, const std::string& prefix) {
  ConductorDescription conductor;
  const auto eta = parameters.optional_color_or_texture(prefix + "eta", SpectrumUse::kUnbounded);
  const auto k = parameters.optional_color_or_texture(prefix + "k", SpectrumUse::kUnbounded);
  conductor.reflectance = parameters.optional_color_or_texture("reflectance", SpectrumUse::kReflectance);
  if (conductor.reflectance && (eta || k))
    throw SceneError(parameters.place("reflectance"), "found both \"reflectance\" and \"eta\" or \"k\" for " + parameters.directive() +
                                                          ", expected one of the two descriptions");
  conductor.eta = eta.value_or(RgbParameter{*named_coefficient("metal-Cu-eta"), kNone});
  conductor.k = k.value_or(RgbParameter{*named_coefficient("metal-Cu-k"), kNone});
  return conductor;
}

CoatDescription read_coat(Parameters& parameters, const std::string& prefix) {
  CoatDescription coat;
  const bool remap = parameters.boolean("remaproughness", true);
  coat.roughness = read_roughness(parameters, prefix, remap);
  coat.eta = parameters.refraction_index(prefix + "eta", 1.5f);
  coat.thickness = parameters.float_or_texture("thickness", 0.01f);
  coat.albedo = parameters.color_or_texture("albedo", Rgb(0), SpectrumUse::kReflectance);
  coat.g = parameters.float_or_texture("g", 0);
  if (std::abs(coat.g.value) > 0.9999f)
    throw SceneError(parameters.place("g"), "found g = " + std::to_string(coat.g.value) + ", expected |g| <= 0.9999");
  coat.max_depth = parameters.integer("maxdepth", 10, 0, 1 << 20);
  coat.samples = parameters.integer("nsamples", 1, 1, 1 << 20);
  // One evaluation of the model takes as many steps, and nothing can interrupt it.
  constexpr int64_t kMaxSteps = 1 << 20;
  if (static_cast<int64_t>(coat.max_depth) * coat.samples > kMaxSteps)
    throw SceneError(parameters.place("nsamples"), "found maxdepth " + std::to_string(coat.max_depth) + " and nsamples " +
                                                       std::to_string(coat.samples) + ", expected a product of at most " +
                                                       std::to_string(kMaxSteps));
  return coat;
}

/// A σ, mean free path or reflectance of `subsurface`: the medium inside is homogeneous, so a texture cannot be honoured.
std::optional<Rgb> read_interior_value(Parameters& parameters, const std::string& name, SpectrumUse use) {
  const auto value = parameters.optional_color_or_texture(name, use);
  if (!value) return std::nullopt;
  if (value->texture == kNone) return value->value;
  parameters.context().unsupported(parameters.place(name),
                                   "a texture for \"" + name + "\" of " + parameters.directive() + " (the medium inside is homogeneous)");
  return Rgb(use == SpectrumUse::kReflectance ? 0.5f : 1.0f);
}

HomogeneousDescription read_interior(Parameters& parameters, float eta) {
  HomogeneousDescription medium;
  const float scale = static_cast<float>(parameters.number_within("scale", 1, 0, 1e30));
  float g = read_asymmetry(parameters);
  const std::string name = parameters.string("name", "");
  const auto sigma_a = read_interior_value(parameters, "sigma_a", SpectrumUse::kUnbounded);
  const auto sigma_s = read_interior_value(parameters, "sigma_s", SpectrumUse::kUnbounded);
  const auto reflectance = read_interior_value(parameters, "reflectance", SpectrumUse::kReflectance);
  const auto mfp = read_interior_value(parameters, "mfp", SpectrumUse::kUnbounded);
  if (!name.empty()) {
    const ScatteringPreset preset = scattering_preset(name, parameters.place("name"));
    if (g != 0)
      parameters.context().warn(parameters.place("g"), "g is taken as 0 with a named medium, whose coefficients are reduced ones");
    g = 0;
    medium.sigma_a = scale * preset.sigma_a;
    medium.sigma_s = scale * preset.sigma_s;
  } else if (sigma_a || sigma_s) {
    if (!sigma_a || !sigma_s)
      throw SceneError(parameters.where(),
                       "found only one of \"sigma_a\" and \"sigma_s\" for " + parameters.directive() + ", expected both");
    medium.sigma_a = scale * *sigma_a;
    medium.sigma_s = scale * *sigma_s;
  } else if (reflectance) {
    const Rgb free_path = scale * mfp.value_or(Rgb(1));
    for (int c = 0; c < 3; ++c) {
      if (!(free_path[c] > 0))
        throw SceneError(parameters.place("mfp"), "found a mean free path of 0 for " + parameters.directive() + ", expected more than 0");
      const float albedo = albedo_from_diffuse_reflectance((*reflectance)[c], eta, g);
      medium.sigma_s[c] = albedo / free_path[c];
      medium.sigma_a[c] = (1 - albedo) / free_path[c];
    }
  } else {
    if (mfp)
      throw SceneError(parameters.place("mfp"), "found \"mfp\" without \"reflectance\" for " + parameters.directive() + ", expected both");
    medium.sigma_a = scale * Rgb(.0011f, .0024f, .014f);
    medium.sigma_s = scale * Rgb(2.55f, 3.21f, 3.77f);
  }
  medium.phase = HenyeyGreensteinDescription{g};
  return medium;
}

}  // namespace

ReadMaterial read_material(const std::string& kind, Parameters& parameters) {
  ReadMaterial material;
  ReadContext& context = parameters.context();
  if (const auto displacement = parameters.optional_float_or_texture("displacement")) {
    // A constant displacement has no slope, so it bumps nothing.
    if (displacement->texture == kNone) context.ignore(parameters.place("displacement"), "a constant \"displacement\"");
    material.displacement = displacement->texture;
  }
  if (const std::filesystem::path file = parameters.file("normalmap"); !file.empty()) {
    context.files.record(file, parameters.place("normalmap"));
    RgbTextureDescription::Image image;
    image.file = file.string();
    image.encoding = "linear";
    material.normal_map = static_cast<int>(context.scene.rgb_textures.size());
    context.scene.rgb_textures.push_back({"", parameters.place("normalmap"), image});
  }
  if (kind == "interface" || kind.empty() || kind == "none") {
    if (kind != "interface") context.warn(parameters.where(), "Material \"" + kind + "\" is the old name of \"interface\"");
    material.kind = InterfaceDescription{};
  } else if (kind == "diffuse") {
    material.kind = DiffuseDescription{parameters.color_or_texture("reflectance", Rgb(0.5f), SpectrumUse::kReflectance)};
  } else if (kind == "diffusetransmission") {
    DiffuseTransmissionDescription d;
    d.reflectance = parameters.color_or_texture("reflectance", Rgb(0.25f), SpectrumUse::kReflectance);
    d.transmittance = parameters.color_or_texture("transmittance", Rgb(0.25f), SpectrumUse::kReflectance);
    d.scale = static_cast<float>(parameters.number_within("scale", 1, 0, 1e6));
    material.kind = d;
  } else if (kind == "conductor") {
    ConductorDescription conductor = read_conductor(parameters, "");
    conductor.roughness = read_roughness(parameters);
    material.kind = conductor;
  } else if (kind == "dielectric") {
    const float eta = parameters.refraction_index("eta", 1.5f);
    material.kind = DielectricDescription{eta, read_roughness(parameters)};
  } else if (kind == "thindielectric") {
    material.kind = ThinDielectricDescription{parameters.refraction_index("eta", 1.5f)};
  } else if (kind == "coateddiffuse") {
    const RgbParameter reflectance = parameters.color_or_texture("reflectance", Rgb(0.5f), SpectrumUse::kReflectance);
    material.kind = CoatedDiffuseDescription{reflectance, read_coat(parameters, "")};
  } else if (kind == "coatedconductor") {
    CoatedConductorDescription coated{read_conductor(parameters, "conductor."), read_coat(parameters, "interface.")};
    coated.conductor.roughness = read_roughness(parameters, "conductor.", coated.coat.roughness.remap);
    material.kind = coated;
  } else if (kind == "subsurface") {
    const float eta = parameters.refraction_index("eta", 1.33f);
    material.kind = DielectricDescription{eta, read_roughness(parameters)};
    material.interior = read_interior(parameters, eta);
  } else if (kind == "mix") {
    material.mixed = parameters.strings("materials");
    if (material.mixed.size() != 2)
      throw SceneError(parameters.place("materials"), "found " + std::to_string(material.mixed.size()) +
                                                          " names for \"string materials\" of " + parameters.directive() + ", expected 2");
    material.kind = MixDescription{kNone, kNone, parameters.float_or_texture("amount", 0.5f)};
  } else {
    refuse_kind(context, parameters.where(), "Material", kind,
                {"coatedconductor", "coateddiffuse", "conductor", "dielectric", "diffuse", "diffusetransmission", "interface", "mix",
                 "subsurface", "thindielectric"},
                {"hair", "measured"});
    material.kind = DiffuseDescription{{Rgb(0.5f), kNone}};
  }
  return material;
}

}  // namespace woodcock
