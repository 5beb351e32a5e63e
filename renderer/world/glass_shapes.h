// Which shapes are smooth glass, for the finders of boundaries that light is sampled through.
#pragma once

#include "renderer/scene/description.h"
#include "renderer/world/world.h"

namespace woodcock {

/// The index of a surface whose material is a dielectric that is smooth everywhere, without normal map, opacity below one or emission; 1
/// for all others.
float smooth_glass_index(const SceneDescription& scene, const SurfaceInfo& info);

}  // namespace woodcock
