// Scene texts and rays that several hard cases use.
#pragma once

#include <fmt/format.h>

#include <string>

#include "tests/transport/estimate.h"

namespace woodcock::testing {

inline constexpr double kPiD = 3.14159265358979323846;

/// What a path along this world-space ray brings.
inline Rgb radiance_along(const CompiledScene& scene, DVec3 o, DVec3 d, PathCounters& counters, uint64_t sample = 0) {
  const DVec3 at = scene.world->space.scale * (o - scene.world->space.center);
  return trace_path(*scene.world, {*scene.world, scene.settings}, {at, glm::normalize(d)}, path_key(1, 0, 0, sample), counters).radiance;
}

inline std::string lamp(const std::string& shape, const char* extra = "") {
  return "AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [ 3 3 3 ]\n" + std::string(extra) + shape + "AttributeEnd\n";
}
/// Looking down at a small part of a wide floor in the plane y = 0.
inline std::string floor_below(double albedo, int depth) {
  return perspective({0, 0.5, 0}, {0, 0, 0}, 2, depth) +
         fmt::format(
             "WorldBegin\nAttributeBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ {0} {0} {0} ]\nRotate -90 1 0 0\nShape \"disk\" "
             "\"float radius\" 20\nAttributeEnd\n",
             albedo);
}

}  // namespace woodcock::testing
