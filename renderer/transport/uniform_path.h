// Path tracing without importance sampling.
#pragma once

#include "renderer/transport/path.h"

namespace woodcock {

/// The rendering equation (Kajiya 1986) with a uniform direction at every surface that is not specular (the paper, §1):
///   L₀(x, ω) = Le + (2π/N) Σⱼ f(ω, ωⱼ) |cos θⱼ| L(x, ωⱼ),   ωⱼ uniform on the hemisphere, N directions at the first bounce, 1 after
/// Specular surfaces pass the path on; no light is sampled. Unbiased up to `max_depth`.
///
/// The paper has no media here. Those that absorb and emit are passed without a choice, ∫₀ᶻ T σa Le ds + T(z) L₀ in closed
/// form where they are homogeneous and by ratio tracking elsewhere; those that scatter are refused (estimator.h).
PathResult trace_uniform_path(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count);

}  // namespace woodcock
