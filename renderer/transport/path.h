// Path tracing through surfaces and media: the default estimator.
#pragma once

#include "renderer/core/random.h"
#include "renderer/transport/counters.h"
#include "renderer/world/world.h"

namespace woodcock {

struct PathSettings {
  uint64_t frame_seed = 0;
  int max_depth = 5;  ///< scatterings at surfaces and in media; null collisions and interfaces do not count
};

/// What one sample saw.
struct PathResult {
  Rgb radiance{0};
  /// Of the first event that is not an interface: reflectance of the surface or single-scattering albedo σs/σt of
  /// the medium; shading normal (zero in a medium); distance along the ray in world units. All zero where the ray
  /// left the scene.
  Rgb albedo{0};
  Vec3 normal{0};
  float depth = 0;
};

/// The radiance that arrives along `ray` at the camera, estimated with one path:
///   L(x, ω) = ∫₀ᶻ T(s) [σa Le + σs ∫ f(ω, ω′) L(ω′) dω′] ds + T(z) L₀,
/// with L₀ from the rendering equation (Kajiya 1986) at surfaces. Unbiased up to `max_depth`.
PathResult trace_path(const World& world, const PathSettings& settings, Ray ray, PathKey key, PathCounters& count);

/// The camera ray of sample `sample` of pixel (x, y) and the weight of its filter sample.
struct CameraSample {
  Ray ray;
  float weight;
};
CameraSample camera_sample(const World& world, PathKey key, int x, int y);

}  // namespace woodcock
