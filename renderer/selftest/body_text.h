// Bodies of random scenes as text: material, light and shapes in the body's own space.
#pragma once

#include <string>

#include "renderer/selftest/scene_parts.h"

namespace woodcock::selftest {

struct BodyText {
  const Body& body;
  std::string name;   ///< its own in the scene
  DVec3 emission;     ///< radiance; none where zero
  double radius;      ///< in the scene file's units
  bool mirrored;      ///< the transform to the scene file's space mirrors
  bool split;         ///< a sheet as two shapes
  std::string media;  ///< a MediumInterface directive, or nothing
};

std::string body_text(const BodyText& how);

}  // namespace woodcock::selftest
