// Free-flight distances from marched optical depths, several on one march.
#pragma once

#include "renderer/transport/path.h"

namespace woodcock {

/// The paper's algorithms 1 and 2. n numbers ξᵢ = (i + uᵢ)/n, stratified and so sorted, share one march of a ray. It adds up the
/// optical depth τ̂ in steps Δ until it reaches −ln(1 − ξᵢ), and steps back once by what it went too far, over σt: sᵢ. Then
///   L(x, ω) = (1/n) [Σ_{sᵢ < z} (σa Le + σs Ls)/σt (x − sᵢ ω) + (n − inside) L₀]
/// with directions drawn from the phase function (both algorithms call sample_phase_function). The first ray has n distances, rays
/// after a scattering one. Where extinction differs by channel one channel's depth is inverted, chosen by its share of the
/// throughput, and weights are divided by the mixture of the channels' densities. Sources whose extinction `--only` leaves out
/// are sampled with a density κ e^(−κ s) of its own, κ the bound of σa + σs. Biased by the march where σt varies: τ̂ and σt(sᵢ) are
/// those of different points; unbiased in homogeneous media.
PathResult trace_line(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count);

}  // namespace woodcock
