#include "client/pilot.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "client/local_render.h"
#include "renderer/core/random.h"
#include "renderer/film/split.h"
#include "renderer/frame/run_units.h"

namespace woodcock {
namespace {

constexpr int kBlock = 8;
constexpr size_t kMinBlocks = 64;
constexpr int64_t kMinSamples = 64;
constexpr int64_t kUntimedSamples = 4;
/// What is quoted may be so many times the pilot's samples: a slope that is off by 0.03 then makes 6 %.
constexpr int64_t kFarthest = 8;
/// The pilot goes on until its interval is narrower than ± this, well inside what makes a quote uncertain.
constexpr double kWanted = 0.06;

/// One block, with the tree of its samples so far.
struct Block {
  PixelRect rect;
  std::vector<Tile> nodes;
  double seconds = 0;  ///< CPU, after the untimed samples
};

/// All blocks of the frame in an order that looks like chance.
std::vector<Block> shuffled_blocks(PixelRect bounds) {
  std::vector<PixelRect> rects = tile_grid(bounds, kBlock);
  const auto key = [](const PixelRect& r) { return hash_combine(static_cast<uint64_t>(r.x0), static_cast<uint64_t>(r.y0)); };
  std::sort(rects.begin(), rects.end(), [&](const PixelRect& a, const PixelRect& b) { return key(a) < key(b); });
  std::vector<Block> blocks;
  for (const PixelRect& rect : rects) blocks.push_back({rect, {}, 0});
  return blocks;
}

/// Adds `range` to every block, or to some where `stop` ends it; returns the CPU time of all threads.
double render_pass(const FrameRenderer& frame, SampleRange range, std::vector<Block>& blocks, int threads, const std::atomic<bool>& stop) {
  RenderProgress progress;
  return run_units(blocks.size(), threads, progress.cancel, [&](size_t i) {
    if (stop) return false;
    const double before = thread_cpu_seconds();
    auto tile = frame.render(blocks[i].rect, range, 1, progress);
    if (!tile) return false;
    append_node(blocks[i].nodes, std::move(*tile));
    if (range.begin >= kUntimedSamples) blocks[i].seconds += thread_cpu_seconds() - before;
    return true;
  });
}

int64_t pixels_of(const std::vector<Block>& blocks) {
  return std::accumulate(blocks.begin(), blocks.end(), int64_t{0}, [](int64_t sum, const Block& b) { return sum + b.rect.area(); });
}

/// The error of the pixels of all blocks together.
ErrorEstimate error_of(const std::vector<Block>& blocks) {
  std::vector<Tile> nodes;
  for (size_t n = 0; n < blocks.front().nodes.size(); ++n) {
    // The rectangle only says how many pixels there are.
    Tile all{{0, 0, static_cast<int>(pixels_of(blocks)), 1}, blocks.front().nodes[n].range, {}};
    for (const Block& block : blocks) all.pixels.insert(all.pixels.end(), block.nodes[n].pixels.begin(), block.nodes[n].pixels.end());
    nodes.push_back(std::move(all));
  }
  return estimate_error(nodes);
}

void measure_time(const std::vector<Block>& blocks, int64_t samples, double frame_pixels, Pilot& pilot) {
  if (samples <= kUntimedSamples) {
    pilot.seconds_per_sample = pilot.cpu_seconds / static_cast<double>(std::max<int64_t>(1, samples)) / pilot.pixel_share;
    return;
  }
  // A ratio estimate: seconds over pixels, blocks being the sampled units; the fraction that was rendered is known.
  double seconds = 0, squares = 0;
  const auto pixels = static_cast<double>(pixels_of(blocks)), count = static_cast<double>(blocks.size());
  for (const Block& block : blocks) seconds += block.seconds;
  for (const Block& block : blocks) {
    const double d = block.seconds - seconds * static_cast<double>(block.rect.area()) / pixels;
    squares += d * d;
  }
  pilot.seconds_per_sample = seconds * frame_pixels / pixels / static_cast<double>(samples - kUntimedSamples);
  if (count > 1 && seconds > 0) pilot.seconds_deviation = std::sqrt(squares * count / (count - 1) * (1 - pilot.pixel_share)) / seconds;
}

}  // namespace

Pilot run_pilot(const FrameRenderer& frame, const PilotOptions& options, const std::atomic<bool>& stop) {
  const PixelRect bounds = frame.header().bounds;
  const auto frame_pixels = static_cast<double>(bounds.area());
  Pilot pilot;
  std::vector<Block> blocks = shuffled_blocks(bounds);
  if (blocks.size() > kMinBlocks) {
    // One sample of some blocks tells how many can be paid for.
    std::vector<Block> few(blocks.begin(), blocks.begin() + kMinBlocks);
    pilot.cpu_seconds = render_pass(frame, {0, 1}, few, options.threads, stop);
    const double a_pixel = pilot.cpu_seconds / static_cast<double>(pixels_of(few));
    const double affordable = options.max_cpu_seconds / 2 / static_cast<double>(kMinSamples) / std::max(1e-12, a_pixel) / (kBlock * kBlock);
    if (affordable < static_cast<double>(blocks.size())) blocks.resize(std::max(kMinBlocks, static_cast<size_t>(affordable)), Block{});
  }
  pilot.pixel_share = static_cast<double>(pixels_of(blocks)) / frame_pixels;

  int64_t samples = 0;
  for (const SampleRange range : render_passes({0, int64_t{1} << 20})) {
    const double seconds = render_pass(frame, range, blocks, options.threads, stop);
    if (stop) break;
    pilot.cpu_seconds += seconds;
    samples = range.end;
    const bool over = pilot.cpu_seconds >= options.max_cpu_seconds;
    if (!over && samples < kMinSamples && !std::has_single_bit(static_cast<uint64_t>(samples))) continue;
    // The record keeps the powers of two, and the last count.
    auto& points = pilot.record.points;
    if (!points.empty() && !std::has_single_bit(static_cast<uint64_t>(points.back().samples))) points.pop_back();
    points.push_back({samples, error_of(blocks), pilot.cpu_seconds});
    if (over) break;
    if (samples < kMinSamples) continue;
    const auto quote = options.error ? quote_error(pilot, *options.error) : quote_samples(pilot, frame.samples());
    if (!quote || quote->samples <= samples) break;
    if (quote->samples > kFarthest * samples) continue;
    const auto n = static_cast<double>(quote->samples);
    if (static_cast<double>(quote->samples_high) <= n * (1 + kWanted) && static_cast<double>(quote->samples_low) >= n * (1 - kWanted))
      break;
  }
  if (samples > 0) measure_time(blocks, samples, frame_pixels, pilot);
  return pilot;
}

}  // namespace woodcock
