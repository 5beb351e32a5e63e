// A frame whose blocks get as many samples as the error asks for, rendered in this process: the passes of renderer/accuracy/adaptive.h.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "renderer/accuracy/adaptive.h"
#include "renderer/accuracy/error.h"
#include "renderer/frame/frame_renderer.h"

namespace woodcock {

/// The samples of a frame, block by block.
struct BlockFrame {
  SampleMap map;
  std::vector<std::vector<Tile>> nodes;          ///< of each block: dyadic_nodes({0, its count})
  std::vector<std::vector<PixelStats>> picture;  ///< of each block: their fold

  /// No samples yet.
  explicit BlockFrame(PixelRect bounds);
};

/// The blocks of an earlier node file of the frame `header`: one with a sample map, or one of samples [0, n). Throws FilmError where it is
/// of another frame, begins elsewhere, or misses samples.
BlockFrame read_blocks(const std::filesystem::path& nodes, const FrameHeader& header);

/// Writes the frame's picture and the nodes beside it, whose bytes depend on the map only, and returns its error. Throws FilmError,
/// also for a frame without any sample.
ErrorEstimate write_blocks(const std::filesystem::path& picture, const FrameHeader& header, const BlockFrame& blocks);

/// Who renders, and what is watched meanwhile.
struct PassSetting {
  int tile_size = kBlockEdge;  ///< edge of what a thread takes at once, in pixels; never changes a bit
  int threads = 1;
  std::function<bool()> stop = [] { return false; };  ///< asked about every 100 ms: end now
  std::function<void()> tick = [] {};                 ///< called as often
};

/// Raises the blocks to `counts`, all that are to be raised at once; none is lowered. When `stop` says so the blocks that are
/// complete are kept and the rest left as they were; returns whether all are complete. `cpu_seconds` gets the threads' CPU time added.
bool render_pass(const FrameRenderer& frame, const std::vector<int64_t>& counts, const PassSetting& setting, RenderProgress& progress,
                 BlockFrame& blocks, double& cpu_seconds);

enum class EndOfSampling { kTargetReached, kSampleLimit, kStopped };

/// How far a render has come.
struct AdaptiveProgress {
  int pass = 0;                                 ///< that runs, from 1 on
  double error = 0;                             ///< E after the pass before; 0 in the first
  int64_t active = 0;                           ///< blocks that this pass renders
  int64_t samples = 0;                          ///< camera paths of this pass
  EndOfSampling end = EndOfSampling::kStopped;  ///< why it ended, once it has
};

/// Pass after pass until the target is reached, the limit of samples, or `setting.stop`. `before_pass` is told of each.
AdaptiveProgress render_adaptively(const FrameRenderer& frame, const SamplingTarget& target, const PassSetting& setting,
                                   RenderProgress& progress, BlockFrame& blocks, double& cpu_seconds,
                                   const std::function<void(const AdaptiveProgress&)>& before_pass = {});

}  // namespace woodcock
