#include "client/local_render.h"

#include <fmt/format.h>

#include <bit>

#include "renderer/accuracy/error_summary.h"
#include "renderer/film/merge.h"
#include "renderer/film/picture_file.h"
#include "renderer/film/split.h"
#include "renderer/frame/run_units.h"

namespace woodcock {
namespace {

/// Samples of one pass: short enough that an interrupted render loses little, long enough that passes cost nothing.
constexpr int64_t kPassSamples = 32;

}  // namespace

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
  const PixelRect bounds = frame.header().bounds;
  const std::vector<PixelRect> tiles = tile_grid(bounds, tile_size);
  LocalRender result;
  result.nodes = std::move(earlier);
  result.samples = {samples.begin, samples.begin};
  if (!result.nodes.empty()) result.samples = {result.nodes.front().range.begin, result.nodes.back().range.end};
  result.convergence.timed_from = result.samples.size();

  double cpu_seconds = 0;
  const auto record = [&] {
    const int64_t n = result.samples.size();
    auto& points = result.convergence.points;
    if (!result.nodes.empty() && (points.empty() || points.back().samples != n))
      points.push_back({n, estimate_error(result.nodes), cpu_seconds});
  };
  for (const SampleRange range : render_passes(samples)) {
    if (stop && !result.nodes.empty()) break;
    std::vector<std::optional<Tile>> parts(tiles.size());
    const auto render_tile = [&](size_t i) {
      parts[i] = frame.render(tiles[i], range, 1, progress);
      return parts[i].has_value();
    };
    const double pass_seconds = run_units(tiles.size(), threads, progress.cancel, render_tile, [&] {
      if (stop) progress.cancel = true;
      tick();
    });
    if (progress.cancel) {
      if (!result.nodes.empty()) break;
      for (auto& part : parts)
        if (part) result.first_tiles.push_back(std::move(*part));
      if (!result.first_tiles.empty()) result.samples.end = range.end;
      break;
    }
    Tile whole{bounds, range, std::vector<PixelStats>(static_cast<size_t>(bounds.area()))};
    for (const auto& part : parts) paste(*part, whole);
    append_node(result.nodes, std::move(whole));
    result.samples.end = range.end;
    cpu_seconds += pass_seconds;
    if (std::has_single_bit(static_cast<uint64_t>(result.samples.size()))) record();
  }
  record();
  result.complete = !progress.cancel && result.samples.end >= samples.end;
  return result;
}

std::vector<Tile> earlier_nodes(const std::filesystem::path& nodes, const FrameHeader& header) {
  NodeFile file = read_exr(nodes);
  const std::string difference = header_difference(file.info.header, nodes.string(), header, "this render");
  if (!difference.empty()) throw FilmError(nodes.string(), "cannot be resumed: " + difference);
  if (file.info.missing_pixels > 0)
    throw FilmError(nodes.string(), fmt::format("cannot be resumed: {} pixels miss samples; render it again", file.info.missing_pixels));
  return std::move(file.nodes);
}

ErrorEstimate write_picture(const std::filesystem::path& picture, const FrameHeader& header, const LocalRender& render) {
  const std::filesystem::path nodes = nodes_path(picture);
  ErrorEstimate error;
  const PictureSummary summary = error_summary(error);
  if (!render.nodes.empty()) {
    write_exr(nodes, header, render.nodes, &summary, picture);
    return error;
  }
  const auto shared = std::make_shared<const FrameHeader>(header);
  std::vector<MergeInput> inputs;
  for (const Tile& tile : render.first_tiles) inputs.push_back({"a tile", shared, tile.rect, tile.range});
  merge_tiles(
      inputs, [&](size_t i) { return render.first_tiles[i]; }, nodes, {header.bounds, render.samples, {}}, &summary, picture);
  return error;
}

}  // namespace woodcock
