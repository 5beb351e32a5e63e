// From committed tiles to a frame's EXR. The tiles come from workers and are not trusted: merge_pool.h runs each merge in a process
// of its own, so that a crafted file ends that process at most.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "coordinator/model.h"

namespace woodcock::coordinator {

struct AssembleRequest {
  FrameHeader header;  ///< pinned: every tile must carry exactly this
  SampleMap map;       ///< what the frame holds
  std::vector<std::string> tile_paths;
  std::string output_path;  ///< appears whole or not at all
  /// Decide what follows in an adaptive frame, whose `closed` blocks take no more samples.
  std::optional<SamplingTarget> target;
  std::vector<bool> closed;
  bool prefixes = false;  ///< tell the errors of its first samples, too
  /// Instead of all that: make the picture of this node file.
  std::string picture_of;
};

/// `error` says why there is no image; `damaged` are the tiles, by index, that are not what they should be.
struct AssembleResult {
  bool ok = false;
  FrameStatistics statistics;
  std::string error;
  std::vector<size_t> damaged;
  Decision decision;  ///< where a target was given
};

/// How a merge is run: in a process of its own, or in this one by tests. Called by several threads.
using AssembleFunction = std::function<AssembleResult(const AssembleRequest&)>;

/// Checks every tile by itself, merges them, and measures the error reached. Throws nothing.
AssembleResult assemble(const AssembleRequest& request);

/// Requests and results as text, for a process of its own (merge_pool.h). The ways back throw std::exception for text that is
/// nothing of the kind; a result comes from a process that has read files which are not trusted, and is held against its request.
std::string text_of(const AssembleRequest& request);
AssembleRequest request_from_text(const std::string& text);
std::string text_of(const AssembleResult& result);
AssembleResult result_from_text(const std::string& text, const AssembleRequest& request);

}  // namespace woodcock::coordinator
