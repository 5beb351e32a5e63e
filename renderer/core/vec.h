// Vectors, colours and boxes: thin names over GLM.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>

namespace woodcock {

using Vec2 = glm::vec2;
using Vec3 = glm::vec3;
using DVec2 = glm::dvec2;
using DVec3 = glm::dvec3;
using DMat4 = glm::dmat4;
using IVec2 = glm::ivec2;
using IVec3 = glm::ivec3;

/// Linear RGB with Rec. 709 primaries. Each channel is a quantity of its own: Woodcock is not spectral.
using Rgb = glm::vec3;

inline constexpr float kPi = 3.14159265358979323846f;
inline constexpr float kInvPi = 0.31830988618379067154f;
inline constexpr float kInf = std::numeric_limits<float>::infinity();
/// The largest float below one.
inline constexpr float kOneMinusEpsilon = 0x1.fffffep-1f;

/// Rec. 709 luminance of linear RGB.
inline float luminance(Rgb c) { return 0.2126f * c.r + 0.7152f * c.g + 0.0722f * c.b; }

inline float max_component(Vec3 v) { return std::fmax(v.x, std::fmax(v.y, v.z)); }
inline float min_component(Vec3 v) { return std::fmin(v.x, std::fmin(v.y, v.z)); }
inline float average(Rgb c) { return (c.r + c.g + c.b) * (1.0f / 3.0f); }
inline bool is_black(Rgb c) { return c.r == 0 && c.g == 0 && c.b == 0; }
inline bool is_finite(Vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }
inline float length_squared(Vec3 v) { return glm::dot(v, v); }
inline double length_squared(DVec3 v) { return glm::dot(v, v); }

/// An axis-aligned box; empty (lower above upper) until something is added.
struct Box3 {
  Vec3 lower{kInf};
  Vec3 upper{-kInf};

  void add(Vec3 p) {
    lower = glm::min(lower, p);
    upper = glm::max(upper, p);
  }
  bool empty() const { return !(lower.x <= upper.x && lower.y <= upper.y && lower.z <= upper.z); }
  Vec3 extent() const { return upper - lower; }
  Vec3 center() const { return 0.5f * (lower + upper); }
};

/// A ray in render space. Distances `t` are measured in lengths of `d`; every direction in the
/// renderer is unit length unless a function says otherwise.
///
/// In double, as are distances and the points that paths go on from: where a mean free path is no longer than some units in the
/// last place of a float position, a rounded point would cost a flight its length.
struct Ray {
  DVec3 o{0};
  DVec3 d{0};
  float time = 0;
  double skip = 0;  ///< hits at or before this distance belong to the place that the ray leaves

  DVec3 at(double t) const { return o + t * d; }
};

}  // namespace woodcock
