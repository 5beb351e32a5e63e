// A frame rendered in this process.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <vector>

#include "renderer/accuracy/convergence.h"
#include "renderer/frame/frame_renderer.h"

namespace woodcock {

struct LocalRender {
  /// The maximal dyadic nodes of the samples that are finished, in order; all of one rectangle.
  std::vector<Tile> nodes;
  /// Where not even the first pass was finished: its tiles that were. Then `nodes` is empty and `samples` what they hold.
  std::vector<Tile> first_tiles;
  SampleRange samples;
  bool complete = false;
  /// The error of every finished prefix of 1, 2, 4, … samples from the first on, and of the end.
  Convergence convergence;
};

/// The passes of a local render: of `samples` the maximal dyadic nodes, none longer than 32 samples, and a start at 0 by
/// [0, 1), [1, 2), [2, 4), …, [16, 32), so that the picture is whole at every power of two.
std::vector<SampleRange> render_passes(SampleRange samples);

/// Renders `samples` of the whole frame in passes over tiles of edge `tile_size`, after the nodes in `earlier` (which
/// end where `samples` begins, or beyond where it is empty). When `stop` becomes true the passes finished so far are the result; where not
/// even one is, the tiles of the first that are.
LocalRender render_locally(const FrameRenderer& frame, SampleRange samples, std::vector<Tile> earlier, int tile_size, int threads,
                           RenderProgress& progress, const std::atomic<bool>& stop, const std::function<void()>& tick);

/// The nodes in an earlier node file of the same frame. Throws FilmError where it is of another, or misses samples.
std::vector<Tile> earlier_nodes(const std::filesystem::path& nodes, const FrameHeader& header);

/// Writes what is there to `picture` and the nodes beside it, with the numbers of its error, which it returns; pixels that no
/// finished tile holds are gaps. Throws FilmError.
ErrorEstimate write_picture(const std::filesystem::path& picture, const FrameHeader& header, const LocalRender& render);

}  // namespace woodcock
