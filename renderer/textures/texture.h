// Textures: what varies over a surface.
#pragma once

#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "renderer/core/vec.h"
#include "renderer/scene/description.h"
#include "renderer/textures/image.h"
#include "renderer/textures/mapping.h"

namespace woodcock {

/// A picture with the way it is read. Trilinear and EWA filters of the format read the finest level
/// bilinearly: their prefiltering only trades noise for blur, supersampling has the same expectation.
struct ImageLookup {
  std::shared_ptr<const Image> image;
  ImageWrap wrap = ImageWrap::kRepeat;
  bool nearest = false;
  bool invert = false;
  float scale = 1;
  Mapping mapping;
};

/// One texture; `Parameter` is FloatParameter or RgbParameter.
template <typename Parameter>
struct TextureNode {
  using Description = TextureDescription<Parameter>;
  struct Checkerboard {
    Parameter tex1, tex2;
    int dimension;
    Mapping mapping;
  };
  std::variant<typename Description::Constant, typename Description::Scale, typename Description::Mix, Checkerboard, ImageLookup> kind;
};

/// How large the values of a texture get.
struct TextureRange {
  float largest = 0;     ///< a bound, which simple textures reach
  size_t above_one = 0;  ///< pixels above 1, where the texture is one image
  size_t pixels = 0;     ///< all its pixels
};

/// All textures of a scene. Immutable after construction, so any number of threads may evaluate.
class Textures {
 public:
  Textures() = default;
  /// Loads images (each file once). Throws SceneError with the texture's place for an image that cannot be
  /// used, a reference that does not point to an earlier texture, or a graph that costs more than 4096
  /// evaluations a look-up.
  Textures(const SceneDescription& scene, const DMat4& world_from_render);

  /// Values are as the file says: not clamped to [0, 1], except that images are never negative.
  float eval(const FloatParameter& parameter, const TextureContext& at) const {
    return parameter.texture == kNone ? parameter.value : eval_node(parameter, at);
  }
  Rgb eval(const RgbParameter& parameter, const TextureContext& at) const {
    return parameter.texture == kNone ? parameter.value : eval_node(parameter, at);
  }

  /// The range of `scale` times a parameter. Looks at every pixel of its images.
  TextureRange range(const FloatParameter& parameter, float scale = 1) const;
  TextureRange range(const RgbParameter& parameter, float scale = 1) const;

  /// What of the images is not used as it stands in the files, one sentence each; for the user.
  std::vector<std::string> notes() const;

 private:
  float eval_node(const FloatParameter& parameter, const TextureContext& at) const;
  Rgb eval_node(const RgbParameter& parameter, const TextureContext& at) const;

  std::vector<TextureNode<FloatParameter>> float_nodes_;
  std::vector<TextureNode<RgbParameter>> rgb_nodes_;
};

}  // namespace woodcock
