#include "renderer/textures/mapping.h"

#include <cmath>

namespace woodcock {

Mapping::Mapping(const TextureMapping& description, const DMat4& world_from_render)
    : description_(description), texture_from_render_(description.texture_from_world * world_from_render) {}

Vec2 Mapping::map_2d(const TextureContext& at) const {
  const TextureMapping& m = description_;
  if (m.kind == TextureMapping::Kind::kUv) return {m.su * at.uv.x + m.du, m.sv * at.uv.y + m.dv};
  const DVec3 p = DVec3(texture_from_render_ * glm::dvec4(DVec3(at.p), 1.0));
  constexpr double kPiD = 3.14159265358979323846;
  switch (m.kind) {
    case TextureMapping::Kind::kPlanar:
      return {static_cast<float>(m.du + glm::dot(p, DVec3(m.v1))), static_cast<float>(m.dv + glm::dot(p, DVec3(m.v2)))};
    case TextureMapping::Kind::kSpherical: {
      // s from the polar angle and t from the azimuth, as in the format's reference renderer. atan2 is exact at the poles.
      const double theta = std::atan2(std::hypot(p.x, p.y), p.z);
      const double phi = std::atan2(p.y, p.x);
      return {static_cast<float>(theta / kPiD), static_cast<float>((phi < 0 ? phi + 2 * kPiD : phi) / (2 * kPiD))};
    }
    case TextureMapping::Kind::kCylindrical:
      return {static_cast<float>((kPiD + std::atan2(p.y, p.x)) / (2 * kPiD)), static_cast<float>(p.z)};
    default:  // kUv was handled above; the plain point's x and y stand in for a 3D mapping
      return {static_cast<float>(p.x), static_cast<float>(p.y)};
  }
}

Vec3 Mapping::map_3d(const TextureContext& at) const { return Vec3(DVec3(texture_from_render_ * glm::dvec4(DVec3(at.p), 1.0))); }

}  // namespace woodcock
