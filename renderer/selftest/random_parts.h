// Random media, phase functions, materials and forms.
#pragma once

#include "renderer/selftest/random_draws.h"
#include "renderer/selftest/scene_parts.h"

namespace woodcock::selftest {

PhasePart random_phase(RandomDraws& draw);

/// What a medium must be like where it stands.
struct MediumNeeds {
  bool homogeneous = false;  ///< fills space without end or gaps
  bool absorbs = false;      ///< in every channel, so that light does not stay for ever
  double least_depth = 1e-3;
};
MediumPart random_medium(RandomDraws& draw, const MediumNeeds& needs);

Form random_closed_form(RandomDraws& draw);
Form random_open_form(RandomDraws& draw);

/// An opaque material whose albedo is known.
MaterialPart random_opaque(RandomDraws& draw, double most_albedo);
/// A material of known albedo for an open surface.
MaterialPart random_sheet(RandomDraws& draw);
/// A material of known albedo that lets light into a closed body.
MaterialPart random_shell(RandomDraws& draw);
MaterialPart random_glass(RandomDraws& draw);

}  // namespace woodcock::selftest
