// Phase functions and surface models in double, written from their formulas: what the checker of weights compares the
// renderer with. Nothing here calls the renderer's models; only descriptions are read.
#pragma once

#include <optional>

#include "renderer/scene/description.h"

namespace woodcock::testing {

/// Per steradian. Both directions point away from the point. All kinds but tabulated ones.
double phase_density(const PhaseDescription& phase, DVec3 wo, DVec3 wi);

/// A surface seen in its own frame, z the shading normal and x along ∂p/∂u. Constant parameters only, no mixes.
struct SurfaceScattering {
  /// f |cos θi|; nothing for layered models, whose value is an estimate.
  std::optional<DVec3> value;
  double pdf = 0;  ///< of sampling wi by scattering, per steradian; for layered models the proxy that weights use
};
SurfaceScattering scatter(const MaterialKind& material, DVec3 wo, DVec3 wi);

/// There are delta lobes only.
bool is_delta(const MaterialKind& material);
/// What a delta lobe multiplies the throughput by, chosen by its probability.
DVec3 delta_factor(const MaterialKind& material, DVec3 wo, DVec3 wi);
/// Index of refraction of wi's side over wo's side, 1 for a reflection.
double index_ratio(const MaterialKind& material, DVec3 wo, DVec3 wi);

}  // namespace woodcock::testing
