// What a medium was asked to be and is not: grids without density, emission that comes to nothing.
#pragma once

#include "renderer/scene/description.h"
#include "renderer/scene/parameters.h"

namespace woodcock {

/// Warns where the density is 0 everywhere. Says nothing about grids that were read without their values.
void warn_if_empty(Parameters& parameters, const FloatVolume& density);
void warn_if_empty(Parameters& parameters, const RgbGridMediumDescription& medium);

/// Warns where parameters ask for emission and none is left, with the numbers: no emission to be scaled, no absorption to emit by, a grid
/// of zeros, temperatures too low. A factor that is given as 0 asks for none.
void warn_if_dark(Parameters& parameters, const HomogeneousDescription& medium);
void warn_if_dark(Parameters& parameters, const GridMediumDescription& medium);
void warn_if_dark(Parameters& parameters, const RgbGridMediumDescription& medium);

}  // namespace woodcock
