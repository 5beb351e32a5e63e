// Woodcock tracking with one majorant for the whole medium.
#pragma once

#include "renderer/transport/path.h"

namespace woodcock {

/// Distances with the density p(s) = σt(s) exp(−∫₀ˢ σt) (Woodcock et al. 1965; the paper, alg. 4 and eq. 11), to the ray's end,
/// and a direction uniform on the sphere (§2, eq. 9):
///   L(x, ω) = [σa Le + σs 4π f(ω, ω′) L(y, ω′)]/σt at a distance s < z,   L₀ where the tracking gets through
/// At a tentative collision under the bound σ̄ of the whole medium the ray is dimmed by weight and stops by chance, with
/// probability σt/σ̄: absorption never ends a path. Where extinction differs by channel, or is left out by `--only`, the
/// probability is q = β·κ/β·(κ + σn), with κ = max(σt, σs) and σn = σ̄ − σt, and the weights are those of the general
/// null-collision equation, divided by the probabilities used: (σa Le, σs)/(σ̄ q) and σn/(σ̄ (1 − q)). Without any extinction
/// distances have the density σ̄ e^(−σ̄ s). Unbiased up to `max_depth`.
PathResult trace_woodcock(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count);

/// The same with directions drawn from the phase function, whose weight is 1 (§3.2, eq. 12 and 13).
PathResult trace_woodcock_phase(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count);

}  // namespace woodcock
