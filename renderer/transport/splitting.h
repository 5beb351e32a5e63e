// In how many directions a path goes on from its first scattering that samples light.
//
// What leads there (the camera ray, the light sample) costs time and has little noise of its own where most light comes from further
// scatterings: then several directions for each of them are worth more than as many whole paths. With D for what is found before, B for
// what one direction brings, C and c for what both cost, k directions have the variance Var D + Var B/k and the cost C + k·c, and
// k = sqrt(Var B/Var D · C/c) is best (splitting: Arvo & Kirk 1990, "Particle transport and image synthesis"; by the expected
// contribution: Vorba & Křivánek 2016, Rath et al. 2022). A pilot measures all four.
#pragma once

#include "renderer/transport/path.h"

namespace woodcock {

/// The number of directions, a power of two up to kMaxSplits, for a frame of width × height pixels. A function of the scene and of
/// settings other than the seed: every program that renders the frame finds the same. Takes 0.1 to 0.3 s.
uint32_t find_splits(const World& world, const PathSettings& settings, int width, int height);

}  // namespace woodcock
