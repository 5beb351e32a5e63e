// Path tracing through surfaces and media: the default estimator.
#pragma once

#include <atomic>

#include "renderer/core/random.h"
#include "renderer/transport/counters.h"
#include "renderer/transport/features.h"
#include "renderer/world/world.h"

namespace woodcock {

/// How paths that take long show that they live, and are stopped.
struct PathWatch {
  /// Moves by 1024 whenever PathCounters::vertices of one thread passes a multiple of it; the rest is the caller's to add.
  std::atomic<uint64_t>& vertices;
  /// When set, a path ends within 1024 vertices or 65536 look-ups, with a radiance that means nothing.
  const std::atomic<bool>& cancel;
};

/// What the paper's estimators are set by; see estimator.h for which of them takes what.
struct PaperSettings {
  float step = 0;      ///< of ray marching, in render units
  int directions = 1;  ///< a step at the first scattering (march), or distances on the first ray (line)
  int branching = 1;   ///< directions at the first bounce
};

inline constexpr uint32_t kMaxSplits = 8;  ///< a power of two

/// What a user asks for; a RenderPlan (render_plan.h) is what becomes of it in a scene.
struct PathSettings {
  uint64_t frame_seed = 0;
  int max_depth = 5;  ///< scatterings at surfaces and in media; null collisions and interfaces do not count
  const PathWatch* watch = nullptr;
  Features features;         ///< of the estimator `auto`
  bool full_kernel = false;  ///< run the kernel with every effect compiled in; the same bits
  /// Directions that a path takes at its first scattering that samples light (splitting.h finds how many are worth while); 1 to
  /// kMaxSplits.
  uint32_t splits = 1;
  bool plan = true;  ///< off: the general algorithm, without what was found out about the scene
  PaperSettings paper;
  TransferTerms terms;  ///< that the world's media were compiled with
};

/// Vertices between two looks at PathSettings::watch; a power of two.
inline constexpr uint64_t kReportEvery = 1024;

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

struct RenderPlan;

/// A way to estimate the radiance that arrives along a ray. `plan` is made for this world.
using RadianceFunction = PathResult (*)(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count);

/// The radiance that arrives along `ray` at the camera, estimated with one path:
///   L(x, ω) = ∫₀ᶻ T(s) [σa Le + σs ∫ f(ω, ω′) L(ω′) dω′] ds + T(z) L₀,
/// with L₀ from the rendering equation (Kajiya 1986) at surfaces. Unbiased up to `max_depth`. Runs the
/// kernel of the plan.
PathResult trace_path(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count);

/// The camera ray of sample `sample` of pixel (x, y) and the weight of its filter sample.
struct CameraSample {
  Ray ray;
  float weight;
};
CameraSample camera_sample(const World& world, PathKey key, int x, int y);

}  // namespace woodcock
