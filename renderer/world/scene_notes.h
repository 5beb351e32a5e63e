// What a scene says and does not mean, as far as it shows at load: for the user.
#pragma once

#include <string>
#include <vector>

#include "renderer/scene/description.h"
#include "renderer/world/world.h"

namespace woodcock {

/// One sentence for each of these, none for a scene that is right:
/// - reflectances above 1, which are cut to 1;
/// - spheres and cylinders that a mirroring transform has turned inside out, where the side matters;
/// - instances that leave the grid of their medium behind;
/// - media that overlap (media_overlap.h).
std::vector<std::string> scene_notes(const SceneDescription& scene, const World& world);

/// `file:line:column`
std::string place_of(const SourceLocation& where);

}  // namespace woodcock
