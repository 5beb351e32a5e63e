// How much light gets through.
#pragma once

#include "renderer/core/random.h"
#include "renderer/transport/path.h"
#include "renderer/world/coincident_hits.h"
#include "renderer/world/world.h"

namespace woodcock {

/// More boundaries than this without a scattering mean a defect of the scene (a stack of coincident shells).
inline constexpr int kMaxCrossings = 10000;

/// Below this transmittance roulette decides whether a tracking goes on, and with which probability it does.
inline constexpr float kTransmittanceRoulette = 0.1f, kRouletteSurvival = 0.25f;

/// Which ways of estimating a transmittance may be used; the expectation is the same with any of them.
struct TransmittanceOptions {
  bool closed_forms = true;          ///< homogeneous media and constant bricks without tracking
  bool bricks = true;                ///< majorants of bricks, not of the whole volume
  bool residual = true;              ///< tracking of what lies above the lower bound of a brick
  bool ray_marching = true;          ///< unbiased ray marching where nothing scatters and the optical depth is moderate
  bool grey = true;                  ///< one channel for all where they are equal
  const PathWatch* watch = nullptr;  ///< ends long flights
};

/// In long flights, at every 65536th look-up: whether the render is to end. What is returned then means nothing.
inline bool flight_is_cancelled(const TransmittanceOptions& options, const PathCounters& count) {
  return (count.medium_lookups & 0xffff) == 0 && options.watch != nullptr && options.watch->cancel.load(std::memory_order_relaxed);
}

/// exp(−σ·t) per channel with exp(−0·∞) = 1: a distant light through an unbounded medium arrives only in the
/// channels without extinction.
Rgb attenuation(Rgb sigma, double t);

/// An unbiased estimate of the transmittance of `medium` along ray.at(0 … t_max), per channel: in closed form where
/// the medium is homogeneous, else by residual ratio tracking, T̂ = e^{−∫σl} Π (1 − (σt(x_i) − σl)/(σ̄ − σl)) over the
/// tentative collisions x_i of rate σ̄ − σl, σl ≤ σt ≤ σ̄ the bounds of a brick (Novák, Selle & Jarosz 2014, sections 3
/// and 4), ended by Russian roulette below 0.1, or by ray marching without bias (ray_marching.h).
Rgb estimate_transmittance(const Medium& medium, const Ray& ray, double t_max, Stream& random, PathCounters& count,
                           const TransmittanceOptions& options = {});

/// What a shadow ray found.
struct Shadow {
  Rgb transmittance{0};  ///< 0 where a surface is in the way
  int medium = kNone;    ///< at the far end
};

/// A shadow ray from ray.o to the distance `t_max`, through interfaces and media. `medium` is the one the ray starts in.
/// `target` names the light sample. Visibility is geometric: what the ray meets before the sampled point is in its way, another part
/// of the light included. `from` is the place that the ray starts at, if surfaces coincide
/// there; ray.o lies beyond all of them.
Shadow trace_shadow(const World& world, Ray ray, double t_max, int medium, TargetPrimitive target, Stream& random,
                    const TransmittanceOptions& options, bool transparent_surfaces, PathCounters& count,
                    const CoincidentHits* from = nullptr);

}  // namespace woodcock
