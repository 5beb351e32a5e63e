// Media of random scenes as text.
#pragma once

#include <fmt/format.h>

#include <string>

#include "renderer/selftest/scene_text.h"

namespace woodcock::selftest {

inline std::string numbers(DVec3 v) { return fmt::format("{} {} {}", v.x, v.y, v.z); }
inline std::string rgb(const char* name, DVec3 v) { return fmt::format("\"rgb {}\" [ {} ]", name, numbers(v)); }

/// MakeNamedMedium in a space whose unit is the radius of the body; `radius` is that radius in the scene file's units. In a furnace
/// the medium emits the square of `index`.
std::string medium_text(const std::string& name, const MediumPart& medium, double index, bool furnace, double radius,
                        const Writing& writing);

}  // namespace woodcock::selftest
