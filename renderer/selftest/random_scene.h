// Whole scenes at random.
#pragma once

#include "renderer/selftest/random_draws.h"
#include "renderer/selftest/scene_parts.h"

namespace woodcock::selftest {

/// Kirchhoff's furnace: every surface emits one minus its albedo (times n² inside of glass), every medium has Le = n², the surroundings
/// have radiance one. Then the radiance is n² everywhere and in every direction, whatever stands there.
Scene random_furnace(RandomDraws& draw);

/// A scene of any materials and lights, to be compared with itself. Variances are kept within bounds: point and spot lights stand in
/// vacuum, if need be in a bubble of it; area lights are not small; where a light may be met through glass or by mirrors it is large.
Scene random_open_scene(RandomDraws& draw);

}  // namespace woodcock::selftest
