// Media between surfaces that lie so close together that they count as one place.
#pragma once

#include "renderer/world/world.h"

namespace woodcock {

/// Notes where float or double positions cannot carry a medium: a sentence for each that is too dense for double, and for each that is lost
/// in gaps. Where a camera ray meets coincident surfaces (CoincidentHits) that are some distance apart after all, the medium between them
/// is left out: their order is known, the way between them is not. Looks along a ray for each of 32 × 32 points of the film and gives one
/// sentence for each medium of which more than a thousandth of a mean free path is lost in this way, with the largest loss.
std::vector<std::string> thin_media(const World& world, const FilmDescription& film, const std::vector<std::string>& medium_names);

}  // namespace woodcock
