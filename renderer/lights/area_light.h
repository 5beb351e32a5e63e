// Shapes that emit light.
#pragma once

#include <variant>

#include "renderer/lights/emitter.h"
#include "renderer/lights/light.h"
#include "renderer/textures/image.h"

namespace woodcock {

/// Diffuse emission from a shape, on the side of its normal or on both.
///
/// `power` follows pbrt-v4, where each triangle or patch of a mesh is a light of its own: each gets that power, so
/// their radiances differ with their areas. Opacity: a constant one weights light samples, as it lets that share of rays
/// pass; a shape of opacity 0 is met by no ray, shines in full and is marked `delta`. A textured one is left to the
/// rays that meet the shape: nothing is sampled and the pdf is 0, so that MIS gives those rays the whole weight.
class AreaLight {
 public:
  AreaLight(const ShapeDescription& description, int shape_index, const Shape& shape, double scale);

  std::optional<LightSample> sample(DVec3 ref, Vec2 u, double u_primitive, Pieces pieces) const;
  Rgb emitted(const EmitterHit& hit, Vec3 wo) const;
  float pdf(DVec3 ref, const EmitterHit& hit, DVec3 wi, Pieces pieces) const;
  int shape() const { return shape_; }
  /// Render-space units; for the choice of lights black where nothing is ever sampled.
  Rgb power() const;
  /// What it brings to a point, of a shape in this box; for the choice of lights of no intensity where nothing is ever sampled.
  LightBounds bounds(Box3 box) const;
  /// The image, without pixels where there is none.
  const Image& image() const { return image_; }

 private:
  using Emitter = std::variant<MeshEmitter, QuadricEmitter>;
  enum class Opacity { kConstant, kInvisible, kTextured };

  Rgb radiance(uint32_t primitive, Vec2 uv) const;
  size_t primitives() const;
  double area(size_t primitive) const;

  int shape_;
  Emitter emitter_;
  Rgb radiance_;       // scale included; the scale alone where there is an image
  float power_;        // world units, per primitive; 0 where the radiance was given
  double world_area_;  // world area of a render-space unit area
  bool two_sided_;
  Image image_;
  Rgb mean_{1};  // of the image
  Opacity opacity_kind_;
  float opacity_;
};

}  // namespace woodcock
