// Ray marching with fixed steps.
#pragma once

#include "renderer/transport/path.h"

namespace woodcock {

/// Fixed steps Δ and uniform directions (the paper, §2, alg. 3, eq. 2 and 9):
///   L(x, ω) = Σᵢ Δ T(yᵢ) [σa Le + σs (4π/N) Σⱼ f(ω, ωⱼ) L(yᵢ, ωⱼ)] + T(z) L₀,   T(yᵢ) = exp(−Σ_{k<i} σt(y_k) Δ − σt(yᵢ) uΔ)
/// with yᵢ = (i + u) Δ, u uniform once a ray. On the first ray that scatters all steps scatter, into N directions each. After that
/// the tree would grow without bound, so a ray follows one term of its sum, a step or L₀, chosen in proportion to
/// Δ T σs and T(z), and divides by the probability: the mean is the marched sum. Where T has fallen below 0.1 a march goes on with
/// probability ¼ and four times the weight. Biased where σt varies: E exp(−τ̂) ≥ exp(−τ) (Jensen), by Var(τ̂)/2 to first order, which
/// falls with Δ²; unbiased in homogeneous media.
PathResult trace_march(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count);

/// The same with directions drawn from the phase function: weight σs Ls (alg. 5, eq. 12 and 13).
PathResult trace_march_phase(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count);

}  // namespace woodcock
