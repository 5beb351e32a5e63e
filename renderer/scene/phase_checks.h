// What every phase function must fulfil, wherever its description came from.
#pragma once

#include <optional>
#include <string>

#include "renderer/scene/description.h"

namespace woodcock {

/// Beyond this |g| the peak cannot be told from a delta in float.
inline constexpr double kMaxMeanCosine = 0.9999;
/// Diameters in micrometres for which the fit to Mie scattering was made.
inline constexpr double kMinDroplet = 5, kMaxDroplet = 50;

/// What has no physical meaning in a description, and what was expected, to follow "found "; nothing if all is well.
std::optional<std::string> phase_fault(const PhaseDescription& phase);

}  // namespace woodcock
