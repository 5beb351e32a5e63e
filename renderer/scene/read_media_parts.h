// What the readers of media share.
#pragma once

#include "renderer/scene/read_parts.h"

namespace woodcock {

struct MediumCoefficients {
  Rgb sigma_a{1}, sigma_s{1};
};
/// `sigma_a` and `sigma_s`, or `preset`; times `scale`.
MediumCoefficients read_coefficients(Parameters& parameters);
/// `Lescale` as a single factor.
float read_emission_scale(Parameters& parameters);
/// T = (value − offset) · scale; pbrt-v4 emits nothing at or below 100 K.
void read_temperature_scale(Parameters& parameters, GridMediumDescription& medium);

/// A medium of type "nanovdb" or "openvdb".
GridMediumDescription read_volume_file(const std::string& kind, Parameters& parameters);

}  // namespace woodcock
