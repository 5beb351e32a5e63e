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
  /// f |cos θi|; nothing for layered models by walks, whose value is an estimate.
  std::optional<DVec3> value;
  double pdf = 0;        ///< of sampling wi by scattering, per steradian; for layered models by walks the proxy that weights use
  double tolerance = 0;  ///< by how much the renderer's tables may be off, relative
};
/// `closed_forms`: layered models have them where there is one.
SurfaceScattering scatter(const MaterialKind& material, DVec3 wo, DVec3 wi, bool closed_forms);

/// There are delta lobes only.
bool is_delta(const MaterialKind& material);
/// There are delta lobes beside others, in a model with a value.
bool is_mixed(const MaterialKind& material, bool closed_forms);
/// A layered model without a value of its own.
bool is_by_walks(const MaterialKind& material, bool closed_forms);
/// What a delta lobe multiplies the throughput by, over its probability.
DVec3 delta_factor(const MaterialKind& material, DVec3 wo, DVec3 wi);
/// Index of refraction of wi's side over wo's side, 1 for a reflection.
double index_ratio(const MaterialKind& material, DVec3 wo, DVec3 wi);

}  // namespace woodcock::testing
