// How much light gets through.
#pragma once

#include "renderer/core/random.h"
#include "renderer/transport/counters.h"
#include "renderer/world/world.h"

namespace woodcock {

/// More boundaries than this without a scattering mean a defect of the scene (a stack of coincident shells).
inline constexpr int kMaxCrossings = 10000;

/// exp(−σ·t) per channel with exp(−0·∞) = 1: a distant light through an unbounded medium arrives only in the
/// channels without extinction.
Rgb attenuation(Rgb sigma, double t);

/// An unbiased estimate of the transmittance of `medium` along ray.at(0 … t_max), per channel: in closed form where
/// the medium is homogeneous, else by ratio tracking, T̂ = Π (1 − σt(x_i)/σ̄_i) over the tentative collisions x_i of
/// Woodcock tracking (Novák, Selle & Jarosz 2014, section 3), ended by Russian roulette below 0.1.
Rgb estimate_transmittance(const Medium& medium, const Ray& ray, float t_max, Stream& random, PathCounters& count);

/// A shadow ray: the transmittance estimate from ray.o to the distance `t_max`, through interfaces and media, 0 where
/// a surface is in the way. `medium` is the one the ray starts in. `target` is the primitive the light sample lies on.
Rgb shadow_transmittance(const World& world, Ray ray, float t_max, int medium, TargetPrimitive target, Stream& random, PathCounters& count);

}  // namespace woodcock
