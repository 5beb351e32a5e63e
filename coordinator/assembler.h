// From committed tiles to a frame's EXR. The tiles come from workers and are not trusted: the merge runs in a child process, so
// that a crafted file ends the child at most.
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
};

/// `error` says why there is no image; `damaged` are the tiles, by index, that are not what they should be.
struct AssembleResult {
  bool ok = false;
  FrameStatistics statistics;
  std::string error;
  std::vector<size_t> damaged;
  Decision decision;  ///< where a target was given
};

/// How a merge is run: in a child, or in this process by tests.
using AssembleFunction = std::function<AssembleResult(const AssembleRequest&)>;

/// Checks every tile by itself, merges them, and measures the error reached. Throws nothing.
AssembleResult assemble(const AssembleRequest& request);

/// Runs `assemble` in a child: `program --assemble SPEC`, with bounded memory and time. `temporary_dir` holds the
/// specification meanwhile. A child that crashes or takes too long is an error of the result.
/// `started` is called when the child runs. The child ends with the thread that started it, and so with this process.
AssembleResult assemble_in_child(
    const std::string& program, const std::string& temporary_dir, const AssembleRequest& request,
    const std::function<void()>& started = [] {});

/// The child's main function: reads the specification, writes one JSON object to standard output. Returns the exit code.
int assemble_main(const std::string& spec_path);

}  // namespace woodcock::coordinator
