#include "renderer/frame/frame_renderer.h"

#include <tbb/blocked_range2d.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <stdexcept>

#include "renderer/core/arithmetic.h"
#include "renderer/frame/estimator_settings.h"
#include "renderer/frame/frame_header.h"
#include "renderer/transport/render_plan.h"
#include "renderer/transport/splitting.h"
#include "renderer/world/world.h"

namespace woodcock {
namespace {

/// What the film makes of a sample. One that is not finite contributes nothing but still counts: it is reported with its
/// cause and its place, not hidden. `maxcomponentvalue` holds before the filter's weight, as in pbrt-v4, so that negative
/// lobes are cut alike.
Rgb developed(PathResult& path, float weight, const FilmDescription& film, SampleId id, PathCounters& count) {
  Rgb radiance = path.radiance * film.image_scale;
  if (!is_finite(radiance) || !is_finite(path.albedo) || !is_finite(path.normal) || !std::isfinite(path.depth)) {
    PathCounters bad;
    bad.nonfinite = 1;
    bad.first_nonfinite = id;
    if (!is_finite(radiance)) ++(glm::any(glm::isnan(radiance)) ? bad.nan_radiance : bad.infinite_radiance);
    count.add(bad);
    path = {};
    return Rgb(0);
  }
  if (const float largest = max_component(radiance); largest > film.max_component_value) {
    ++count.clamped;
    radiance *= film.max_component_value / largest;
  }
  return radiance * weight;
}

/// The step in render units. Throws std::invalid_argument where a ray would take more steps than anyone waits for.
float checked_step(double step, const World& world) {
  const double length = step * world.space.scale, diagonal = static_cast<double>(glm::length(world.geometry.bounds().extent()));
  if (std::isfinite(diagonal) && !(diagonal / length <= kMaxSteps)) {
    throw std::invalid_argument("step: found " + std::to_string(step) + ", expected at least " +
                                std::to_string(diagonal / world.space.scale / kMaxSteps) + " world units: the scene is " +
                                std::to_string(diagonal / world.space.scale) + " across");
  }
  return static_cast<float>(length);
}

}  // namespace

struct FrameRenderer::Impl {
  SceneDescription scene;
  FrameHeader header;
  std::shared_ptr<const World> world;
  PathSettings path;
  bool low_discrepancy = false;  ///< leading points of paths
  RadianceFunction radiance = nullptr;
};

FrameRenderer::FrameRenderer(const std::string& scene_path, const FrameSettings& settings, const ReadOptions& options,
                             const std::function<void(const char* phase)>& phase)
    : impl_(std::make_unique<Impl>()) {
  if (const char* fault = arithmetic_fault())
    throw std::runtime_error(std::string("this build cannot render: ") + fault + "; build with the flags of cmake/Compiler.cmake");
  if (phase) phase("loading");
  ReadOptions read = options;
  read.allow_unsupported |= settings.allow_unsupported;
  read.set = settings.set;
  impl_->scene = read_scene(scene_path, read);
  apply_settings(settings, impl_->scene);
  if (phase) phase("building");
  impl_->world = build_world(impl_->scene);
  if (options.warn) {
    for (const auto& note : impl_->world->notes) options.warn(note);
    for (const auto& warning : setting_warnings(impl_->scene)) options.warn(warning);
  }
  const EstimatorSettings estimator = resolve_estimator(settings);
  refuse_media(*estimator.estimator, impl_->scene, *impl_->world);
  impl_->header = frame_header(impl_->scene, settings);
  impl_->header.build = render_build();
  impl_->header.arithmetic_class = arithmetic_class();
  impl_->path.frame_seed = frame_seed(impl_->scene.settings.seed, settings.frame);
  impl_->path.max_depth = impl_->scene.settings.max_depth;
  impl_->path.features = estimator.features;
  impl_->path.full_kernel = settings.full_kernel;
  impl_->path.plan = settings.plan;
  impl_->path.paper = {estimator.estimator->step ? checked_step(estimator.step, *impl_->world) : 0, estimator.directions,
                       estimator.branching};
  impl_->path.terms = estimator.terms;
  impl_->radiance = estimator.estimator->radiance;
  if (estimator.estimator->tunable) impl_->path.splits = find_splits(*impl_->world, impl_->path, impl_->header.width, impl_->header.height);
  impl_->low_discrepancy = estimator.estimator->tunable && estimator.features.has(Feature::kSobol);
}

FrameRenderer::~FrameRenderer() = default;
FrameRenderer::FrameRenderer(FrameRenderer&&) noexcept = default;
FrameRenderer::FrameRenderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

FrameRenderer FrameRenderer::with_seed(uint64_t seed) const {
  auto other = std::make_unique<Impl>(*impl_);
  other->scene.settings.seed = seed;
  other->header.seed = seed;
  other->path.frame_seed = frame_seed(seed, impl_->header.frame);
  return FrameRenderer(std::move(other));
}

const FrameHeader& FrameRenderer::header() const { return impl_->header; }
int64_t FrameRenderer::samples() const { return impl_->scene.settings.samples_per_pixel; }
const SceneDescription& FrameRenderer::description() const { return impl_->scene; }
const World& FrameRenderer::world() const { return *impl_->world; }

std::optional<Tile> FrameRenderer::render(const PixelRect& rect, const SampleRange& range, int threads, RenderProgress& progress) const {
  if (!is_dyadic(range)) throw std::invalid_argument("FrameRenderer::render: the sample range must be one aligned power of two");
  if (threads < 1) throw std::invalid_argument("FrameRenderer::render: at least one thread must render");
  if (rect.empty() || !impl_->header.bounds.contains(rect))
    throw std::invalid_argument("FrameRenderer::render: the rectangle lies outside the frame");

  Tile tile{rect, range, std::vector<PixelStats>(static_cast<size_t>(rect.area()))};
  const FilmDescription& film = impl_->scene.film;

  const PathWatch watch{progress.bounces, progress.cancel};
  PathSettings settings = impl_->path;
  settings.watch = &watch;
  const RenderPlan plan(*impl_->world, settings);

  const auto render_pixel = [&](int x, int y, PathCounters& count) {
    PixelAccumulator accumulator(range);
    uint64_t reported_samples = 0;
    for (int64_t i = range.begin; i < range.end; ++i) {
      const PathKey key = path_key(settings.frame_seed, static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint64_t>(i), 0,
                                   impl_->low_discrepancy);
      const CameraSample camera = camera_sample(*impl_->world, key, x, y);
      PathResult path = impl_->radiance(*impl_->world, plan, camera.ray, key, count);
      accumulator.push(leaf(developed(path, camera.weight, film, {i, x, y}, count), {path.albedo, path.normal, path.depth}, i));
      if (++reported_samples == 64) {
        progress.samples.fetch_add(reported_samples, std::memory_order_relaxed);
        reported_samples = 0;
      }
      if (progress.cancel.load(std::memory_order_relaxed)) return;
    }
    progress.samples.fetch_add(reported_samples, std::memory_order_relaxed);
    tile.pixels[static_cast<size_t>(y - rect.y0) * static_cast<size_t>(rect.width()) + static_cast<size_t>(x - rect.x0)] =
        accumulator.result();
  };

  tbb::enumerable_thread_specific<PathCounters> counters;
  tbb::task_arena arena(threads);
  arena.execute([&] {
    tbb::parallel_for(tbb::blocked_range2d<int>(rect.y0, rect.y1, 4, rect.x0, rect.x1, 4), [&](const tbb::blocked_range2d<int>& block) {
      PathCounters& count = counters.local();
      for (int y = block.rows().begin(); y < block.rows().end(); ++y) {
        for (int x = block.cols().begin(); x < block.cols().end(); ++x) {
          if (progress.cancel.load(std::memory_order_relaxed)) return;
          render_pixel(x, y, count);
        }
      }
    });
  });
  if (progress.cancel) return std::nullopt;
  const std::lock_guard lock(progress.counters_mutex);
  for (const PathCounters& c : counters) {
    progress.counters.add(c);
    progress.bounces.fetch_add(c.vertices % kReportEvery, std::memory_order_relaxed);
  }
  return tile;
}

}  // namespace woodcock
