// Renders tiles of one frame: scene file and settings in, nodes of the accumulation tree out. The local
// `render` command and the workers' render children share it, so that they write the same bits.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "renderer/film/tile.h"
#include "renderer/frame/settings.h"
#include "renderer/scene/read_scene.h"
#include "renderer/transport/counters.h"
#include "renderer/world/world.h"

namespace woodcock {

/// Counters that a render fills while it runs; any thread may read them at any time.
struct RenderProgress {
  std::atomic<uint64_t> samples{0};  ///< camera paths finished
  std::atomic<uint64_t> bounces{0};  ///< path vertices: moves even when one sample takes long
  std::atomic<bool> cancel{false};   ///< set to make render() return early

  std::mutex counters_mutex;  ///< guards `counters`
  PathCounters counters;      ///< of the tiles that are finished
};

/// One frame of a scene, loaded and compiled: immutable, shareable between threads.
class FrameRenderer {
 public:
  /// Reads and compiles the scene. `phase`, when given, is called with "loading", "building" as they begin.
  /// Throws SceneError (bad scene), std::invalid_argument (settings, texts of `set`) or std::runtime_error (a build whose arithmetic cannot
  /// be trusted).
  FrameRenderer(const std::string& scene_path, const FrameSettings& settings, const ReadOptions& options,
                const std::function<void(const char* phase)>& phase = {});
  ~FrameRenderer();
  FrameRenderer(FrameRenderer&&) noexcept;

  /// The same frame with other random numbers; the compiled scene is shared, not made again.
  FrameRenderer with_seed(uint64_t seed) const;

  /// The deterministic fields that every tile of this frame carries: resolution, pixel bounds, scene digest,
  /// settings digest, seed, frame, build, arithmetic class, estimator.
  const FrameHeader& header() const;
  /// Samples per pixel after overrides.
  int64_t samples() const;
  /// The scene with the settings applied.
  const SceneDescription& description() const;
  const World& world() const;

  /// Renders `range` (an aligned power of two) of every pixel of `rect` with up to `threads` threads.
  /// Returns nullopt when cancelled. The result does not depend on `threads`.
  std::optional<Tile> render(const PixelRect& rect, const SampleRange& range, int threads, RenderProgress& progress) const;

 private:
  struct Impl;
  explicit FrameRenderer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// The digest of a fixed small computation (libm and intersection kernels) on this machine: machines with
/// equal digests give equal bits.
std::string arithmetic_class();
/// Names the code that renders, by its digest, and the libraries: equal names give equal bits on machines of one arithmetic class.
std::string render_build();

}  // namespace woodcock
