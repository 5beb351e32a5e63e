// Texture: values that vary over a surface.
#include <cmath>

#include "renderer/scene/flat_transform.h"
#include "renderer/scene/read_parts.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

/// How the two families differ: what a value is, and how it is read.
struct FloatFamily {
  using Description = FloatTextureDescription;
  static FloatParameter value(Parameters& p, const std::string& name, float otherwise) { return p.float_or_texture(name, otherwise); }
  static float constant(float v) { return v; }
};
struct RgbFamily {
  using Description = RgbTextureDescription;
  static RgbParameter value(Parameters& p, const std::string& name, float otherwise) {
    return p.color_or_texture(name, Rgb(otherwise), SpectrumUse::kUnbounded);
  }
  static Rgb constant(float v) { return Rgb(v); }
};

DMat4 inverse_of(const DMat4& world_from_texture, const Parameters& parameters) {
  if (dimensions_of(world_from_texture) < 3)
    throw SceneError(parameters.where(),
                     "found " + parameters.directive() +
                         " mapped by a singular transform, which flattens space (a scale of 0?), expected one that can be inverted");
  return glm::inverse(world_from_texture);
}

TextureMapping read_mapping(Parameters& parameters, const DMat4& world_from_texture) {
  TextureMapping mapping;
  const std::string kind = parameters.choice("mapping", "uv", {"uv", "planar", "spherical", "cylindrical"});
  // What is mapped by u and v needs no place.
  if (kind != "uv" || dimensions_of(world_from_texture) == 3) mapping.texture_from_world = inverse_of(world_from_texture, parameters);
  if (kind == "uv") {
    mapping.su = parameters.real("uscale", 1);
    mapping.sv = parameters.real("vscale", 1);
  } else if (kind == "planar") {
    mapping.kind = TextureMapping::Kind::kPlanar;
    mapping.v1 = Vec3(parameters.vector("v1", {1, 0, 0}));
    mapping.v2 = Vec3(parameters.vector("v2", {0, 1, 0}));
  } else {
    mapping.kind = kind == "spherical" ? TextureMapping::Kind::kSpherical : TextureMapping::Kind::kCylindrical;
  }
  if (kind == "uv" || kind == "planar") {
    mapping.du = parameters.real("udelta", 0);
    mapping.dv = parameters.real("vdelta", 0);
  }
  return mapping;
}

std::string read_encoding(Parameters& parameters) {
  const std::string encoding = parameters.string("encoding", "");
  const bool gamma = encoding.rfind("gamma ", 0) == 0 && std::atof(encoding.c_str() + 6) > 0;
  if (!encoding.empty() && encoding != "sRGB" && encoding != "linear" && !gamma)
    throw SceneError(parameters.place("encoding"),
                     "found \"string encoding\" \"" + encoding + "\", expected \"sRGB\", \"linear\" or \"gamma <value>\"");
  return encoding;
}

template <typename Family>
typename Family::Description::Image read_image(Parameters& parameters, const DMat4& world_from_texture) {
  using Image = typename Family::Description::Image;
  Image image;
  const std::filesystem::path file = parameters.file("filename");
  if (file.empty())
    throw SceneError(parameters.where(), "found " + parameters.directive() + " without \"string filename\", expected the path of an image");
  parameters.context().files.record(file, parameters.place("filename"));
  image.file = file.string();
  image.encoding = read_encoding(parameters);
  image.scale = parameters.real("scale", 1);
  image.invert = parameters.boolean("invert", false);
  const std::string wrap = parameters.choice("wrap", "repeat", {"repeat", "black", "clamp", "octahedralsphere"});
  image.wrap = wrap == "repeat"  ? Image::Wrap::kRepeat
               : wrap == "black" ? Image::Wrap::kBlack
               : wrap == "clamp" ? Image::Wrap::kClamp
                                 : Image::Wrap::kOctahedralSphere;
  const std::string filter = parameters.choice("filter", "bilinear", {"point", "bilinear", "trilinear", "ewa", "EWA"});
  image.filter = filter == "point"       ? Image::Filter::kPoint
                 : filter == "bilinear"  ? Image::Filter::kBilinear
                 : filter == "trilinear" ? Image::Filter::kTrilinear
                                         : Image::Filter::kEwa;
  parameters.refuse("maxanisotropy", false);
  image.mapping = read_mapping(parameters, world_from_texture);
  return image;
}

template <typename Family>
typename Family::Description read_texture(const std::string& name, const std::string& kind, const DMat4& world_from_texture,
                                          Parameters& parameters) {
  using Description = typename Family::Description;
  Description texture;
  texture.name = name;
  texture.where = parameters.where();
  texture.kind = typename Description::Constant{Family::constant(1)};
  if (kind == "constant") {
    const auto value = Family::value(parameters, "value", 1);
    if (value.texture != kNone)
      throw SceneError(parameters.place("value"), "found a texture as the value of a constant texture, expected a value");
    texture.kind = typename Description::Constant{value.value};
  } else if (kind == "scale") {
    texture.kind = typename Description::Scale{Family::value(parameters, "tex", 1), parameters.float_or_texture("scale", 1)};
  } else if (kind == "mix") {
    texture.kind = typename Description::Mix{Family::value(parameters, "tex1", 0), Family::value(parameters, "tex2", 1),
                                             parameters.float_or_texture("amount", 0.5f)};
  } else if (kind == "checkerboard") {
    typename Description::Checkerboard board;
    board.tex1 = Family::value(parameters, "tex1", 1);
    board.tex2 = Family::value(parameters, "tex2", 0);
    board.dimension = parameters.integer("dimension", 2, 2, 3);
    if (board.dimension == 2) {
      board.mapping = read_mapping(parameters, world_from_texture);
    } else {
      board.mapping.kind = TextureMapping::Kind::kPoint3D;
      board.mapping.texture_from_world = inverse_of(world_from_texture, parameters);
    }
    texture.kind = board;
  } else if (kind == "imagemap") {
    texture.kind = read_image<Family>(parameters, world_from_texture);
  } else {
    refuse_kind(parameters.context(), parameters.where(), "Texture", kind, {"constant", "scale", "mix", "checkerboard", "imagemap"},
                {"bilerp", "directionmix", "dots", "fbm", "marble", "ptex", "windy", "wrinkled"});
  }
  return texture;
}

}  // namespace

FloatTextureDescription read_float_texture(const std::string& name, const std::string& kind, const DMat4& world_from_texture,
                                           Parameters& parameters) {
  return read_texture<FloatFamily>(name, kind, world_from_texture, parameters);
}

RgbTextureDescription read_rgb_texture(const std::string& name, const std::string& kind, const DMat4& world_from_texture,
                                       Parameters& parameters) {
  return read_texture<RgbFamily>(name, kind, world_from_texture, parameters);
}

}  // namespace woodcock
