// A mixture of two phase functions: two Henyey-Greenstein lobes, or one and a Draine lobe for droplets of water.
#pragma once

#include "renderer/media/draine.h"

namespace woodcock {

/// weight · first + (1 − weight) · second. A Draine lobe of α = 0 is Henyey-Greenstein's.
struct TwoLobe {
  HenyeyGreenstein first;
  Draine second;
  float weight = 0.5f;  ///< in [0, 1]

  /// Density per steradian.
  float eval(const Deflection& c) const { return weight * first.eval(c) + (1 - weight) * second.eval(c); }
  /// A deflection of the lobe that `u_choice`, uniform in [0, 1), chooses.
  Deflection sample(float u, float u_choice) const { return u_choice < weight ? first.sample(u) : second.sample(u); }
};

/// The fit to Mie scattering by droplets of water of Jendersie & d'Eon 2023, "An Approximate Mie Scattering Function for
/// Fog and Cloud Rendering", in its range for fog and clouds: diameters of 5 to 50 µm.
TwoLobe mie_fit(float droplet_diameter);

}  // namespace woodcock
