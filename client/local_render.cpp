#include "client/local_render.h"

#include <time.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>

#include "renderer/film/split.h"

namespace woodcock {
namespace {

/// Samples of one pass: short enough that an interrupted render loses little, long enough that passes cost nothing.
constexpr int64_t kPassSamples = 32;

struct Pass {
  Tile whole;
  double cpu_seconds = 0;
};

/// One range of samples of all tiles. Where `progress.cancel` or `stop` becomes true, tiles are missing.
Pass render_pass(const FrameRenderer& frame, SampleRange range, const std::vector<PixelRect>& tiles, int threads, RenderProgress& progress,
                 const std::atomic<bool>& stop, const std::function<void()>& tick) {
  const PixelRect bounds = frame.header().bounds;
  Pass pass{{bounds, range, std::vector<PixelStats>(static_cast<size_t>(bounds.area()))}, 0};
  std::atomic<size_t> next{0};
  std::mutex mutex;
  std::condition_variable finished;
  int running = threads;
  std::exception_ptr failure;
  const auto work = [&] {
    const double start = thread_cpu_seconds();
    try {
      for (size_t i = next++; i < tiles.size() && !progress.cancel; i = next++) {
        const auto tile = frame.render(tiles[i], range, 1, progress);
        if (!tile) break;
        for (int y = tile->rect.y0; y < tile->rect.y1; ++y) {
          const auto row = tile->pixels.begin() + static_cast<ptrdiff_t>(y - tile->rect.y0) * tile->rect.width();
          std::copy_n(row, tile->rect.width(),
                      pass.whole.pixels.begin() + static_cast<ptrdiff_t>(y - bounds.y0) * bounds.width() + (tile->rect.x0 - bounds.x0));
        }
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      failure = std::current_exception();
      progress.cancel = true;
    }
    const std::lock_guard lock(mutex);
    pass.cpu_seconds += thread_cpu_seconds() - start;
    --running;
    finished.notify_all();
  };
  std::vector<std::thread> workers;
  for (int i = 0; i < threads; ++i) workers.emplace_back(work);
  {
    std::unique_lock lock(mutex);
    while (!finished.wait_for(lock, std::chrono::milliseconds(100), [&] { return running == 0; })) {
      if (stop) progress.cancel = true;
      tick();
    }
  }
  for (auto& worker : workers) worker.join();
  if (failure) std::rethrow_exception(failure);
  return pass;
}

}  // namespace

void push_node(std::vector<Tile>& nodes, Tile node) {
  while (!nodes.empty()) {
    const Tile& left = nodes.back();
    const SampleRange both{left.range.begin, node.range.end};
    if (left.range.size() != node.range.size() || left.range.end != node.range.begin || !is_dyadic(both)) break;
    const int level = dyadic_level(node.range);
    for (size_t i = 0; i < node.pixels.size(); ++i) node.pixels[i] = merge(left.pixels[i], node.pixels[i], level);
    node.range = both;
    nodes.pop_back();
  }
  nodes.push_back(std::move(node));
}

double thread_cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

std::vector<SampleRange> render_passes(SampleRange samples) {
  std::vector<SampleRange> passes;
  for (const SampleRange pass : bounded_nodes(samples, kPassSamples)) {
    if (pass.begin != 0) {
      passes.push_back(pass);
      continue;
    }
    passes.push_back({0, 1});
    for (int64_t n = 1; n < pass.end; n *= 2) passes.push_back({n, 2 * n});
  }
  return passes;
}

LocalRender render_locally(const FrameRenderer& frame, SampleRange samples, std::vector<Tile> earlier, int tile_size, int threads,
                           RenderProgress& progress, const std::atomic<bool>& stop, const std::function<void()>& tick) {
  const std::vector<PixelRect> tiles = tile_grid(frame.header().bounds, tile_size);
  LocalRender result;
  result.nodes = std::move(earlier);
  result.samples = {result.nodes.empty() ? samples.begin : result.nodes.front().range.begin, samples.begin};
  result.convergence.timed_from = result.samples.size();

  double cpu_seconds = 0;
  const auto record = [&] {
    const int64_t n = result.samples.size();
    auto& points = result.convergence.points;
    if (n > 0 && (points.empty() || points.back().samples != n)) points.push_back({n, estimate_error(result.nodes), cpu_seconds});
  };
  for (const SampleRange range : render_passes(samples)) {
    if (stop && !result.nodes.empty()) break;
    Pass pass = render_pass(frame, range, tiles, threads, progress, stop, tick);
    const bool partial = progress.cancel;
    if (partial && !result.nodes.empty()) break;
    push_node(result.nodes, std::move(pass.whole));
    result.samples.end = range.end;
    cpu_seconds += pass.cpu_seconds;
    if (partial) break;
    if (std::has_single_bit(static_cast<uint64_t>(result.samples.size()))) record();
  }
  record();
  result.complete = !progress.cancel && result.samples.end >= samples.end;
  return result;
}

}  // namespace woodcock
