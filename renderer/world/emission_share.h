// How much of a scene's light is volumetric emission.
#pragma once

#include "renderer/world/world.h"

namespace woodcock {

/// The share of emissive media in what lights and media send to places that the camera sees: surfaces, and the middle of the way through
/// media that scatter. An estimate from one sample of either for each of 1024 rays, without shadows. Powers would not do: they do not say
/// who is near, nor what an emitting cloud keeps to itself. It depends on the world and the resolution, not on what part of the picture is
/// rendered.
double emission_share(const World& world, const FilmDescription& film);

}  // namespace woodcock
