// From a point on a surface to texture coordinates.
#pragma once

#include "renderer/core/vec.h"
#include "renderer/scene/description.h"

namespace woodcock {

/// Where a texture is evaluated.
struct TextureContext {
  Vec2 uv{0};  ///< the shape's parameters
  Vec3 p{0};   ///< in render space
};

/// `TextureMapping` with its transform starting in render space.
class Mapping {
 public:
  Mapping() = default;
  Mapping(const TextureMapping& description, const DMat4& world_from_render);

  /// (s, t) of the mappings uv, planar, spherical and cylindrical, as pbrt-v4 defines them: t grows upwards.
  Vec2 map_2d(const TextureContext& at) const;
  /// The point in texture space.
  Vec3 map_3d(const TextureContext& at) const;

 private:
  TextureMapping description_;
  DMat4 texture_from_render_{1};
};

}  // namespace woodcock
