// One function for each kind of directive: parameters in, description out. All throw SceneError; an empty optional means that the thing is
// unsupported and was recorded as left out.
#pragma once

#include <optional>
#include <string>

#include "renderer/scene/description.h"
#include "renderer/scene/parameters.h"

namespace woodcock {

/// `world_from_camera` and media are the builder's business.
CameraDescription read_camera(const std::string& kind, Parameters& parameters);
/// `image_scale` holds iso / 100 only; the builder multiplies it by the shutter time.
FilmDescription read_film(const std::string& kind, Parameters& parameters);
FilterDescription read_filter(const std::string& kind, Parameters& parameters);
void read_sampler(const std::string& kind, Parameters& parameters, RenderSettings& settings);
void read_integrator(const std::string& kind, Parameters& parameters, RenderSettings& settings);
void read_accelerator(const std::string& kind, Parameters& parameters);
void read_option(Parameters& parameters, RenderSettings& settings);

std::optional<ShapeKind> read_shape(const std::string& kind, Parameters& parameters);

std::optional<LightKind> read_light(const std::string& kind, Parameters& parameters);
std::optional<AreaLightDescription> read_area_light(const std::string& kind, Parameters& parameters);

/// A medium. The names of a `sum` are resolved by the builder.
struct ReadMedium {
  MediumKind kind;
  std::vector<std::string> summed;
};
std::optional<ReadMedium> read_medium(const std::string& kind, Parameters& parameters);

FloatTextureDescription read_float_texture(const std::string& name, const std::string& kind, const DMat4& world_from_texture,
                                           Parameters& parameters);
RgbTextureDescription read_rgb_texture(const std::string& name, const std::string& kind, const DMat4& world_from_texture,
                                       Parameters& parameters);

/// A material, and the medium inside it when it is `subsurface`. The two names of a `mix` are resolved by the builder.
struct ReadMaterial {
  MaterialKind kind;
  std::optional<HomogeneousDescription> interior;
  std::vector<std::string> mixed;
  int normal_map = kNone;
  int displacement = kNone;
};
ReadMaterial read_material(const std::string& kind, Parameters& parameters);

/// Reports an unknown kind of `what`, or one that pbrt-v4 knows (`unsupported`) and Woodcock does not.
void refuse_kind(ReadContext& context, const SourceLocation& where, const std::string& what, const std::string& kind,
                 const std::vector<std::string>& supported, const std::vector<std::string>& unsupported);

/// The phase function of a medium: `phase`, and the parameters that belong to the chosen one.
PhaseDescription read_phase(Parameters& parameters);
/// Throws unless |g| <= 0.9999: beyond, the phase function cannot be told from a delta in float.
float read_asymmetry(Parameters& parameters, const std::string& name = "g");

}  // namespace woodcock
