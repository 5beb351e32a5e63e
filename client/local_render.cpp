#include "client/local_render.h"

#include <algorithm>
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

/// Puts the next node behind the others: siblings become their parent.
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

}  // namespace

LocalRender render_locally(const FrameRenderer& frame, SampleRange samples, std::vector<Tile> earlier, int tile_size, int threads,
                           RenderProgress& progress, const std::atomic<bool>& stop, const std::function<void()>& tick) {
  const PixelRect bounds = frame.header().bounds;
  const std::vector<PixelRect> tiles = tile_grid(bounds, tile_size);
  LocalRender result;
  result.nodes = std::move(earlier);
  result.samples = {result.nodes.empty() ? samples.begin : result.nodes.front().range.begin, samples.begin};

  for (const SampleRange pass : bounded_nodes(samples, kPassSamples)) {
    Tile whole{bounds, pass, std::vector<PixelStats>(static_cast<size_t>(bounds.area()))};
    std::atomic<size_t> next{0};
    std::mutex mutex;
    std::condition_variable finished;
    int running = threads;
    std::exception_ptr failure;
    const auto work = [&] {
      try {
        for (size_t i = next++; i < tiles.size() && !progress.cancel; i = next++) {
          const auto tile = frame.render(tiles[i], pass, 1, progress);
          if (!tile) break;
          for (int y = tile->rect.y0; y < tile->rect.y1; ++y) {
            const auto row = tile->pixels.begin() + static_cast<ptrdiff_t>(y - tile->rect.y0) * tile->rect.width();
            std::copy_n(row, tile->rect.width(),
                        whole.pixels.begin() + static_cast<ptrdiff_t>(y - bounds.y0) * bounds.width() + (tile->rect.x0 - bounds.x0));
          }
        }
      } catch (...) {
        const std::lock_guard lock(mutex);
        failure = std::current_exception();
        progress.cancel = true;
      }
      const std::lock_guard lock(mutex);
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
    const bool partial = progress.cancel;
    if (partial && !result.nodes.empty()) return result;
    push_node(result.nodes, std::move(whole));
    result.samples.end = pass.end;
    if (partial || (stop && pass.end != samples.end)) return result;
  }
  result.complete = true;
  return result;
}

}  // namespace woodcock
