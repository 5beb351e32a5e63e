// What the supervisor and its render child say to each other.
//
//   supervisor → child   render {command}, cancel {attempt}
//   child → supervisor   hello {render_build, arithmetic_class}, progress {attempt, …}, then exactly one of
//                        done {attempt, …}, failed {attempt, cause, reason}, cancelled {attempt} per render
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "renderer/frame/settings.h"

namespace woodcock {

/// One task for the child: a tile and a sample range of a frame whose scene lies ready on disk.
struct RenderCommand {
  uint64_t attempt = 0;      ///< chosen by the supervisor; echoed in every report
  std::string scene_path;    ///< the scene file in its laid-out folder
  std::string scene_digest;  ///< with the settings, the key of the compiled worlds that the child keeps
  FrameSettings settings;
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;        ///< tile in pixels of the full image, upper bounds exclusive
  int64_t sample_begin = 0, sample_end = 0;  ///< an aligned power of two
  int threads = 1;
  std::string output_path;  ///< where the tile's EXR goes
  std::string result_key;   ///< what the coordinator says the result is
  std::string header;       ///< serialized v1::FrameHeader to compare with what was loaded; empty skips the check
};

/// How far a render is. `phase` is "idle", "loading", "building" or "rendering".
struct ChildProgress {
  std::string phase = "idle";
  uint64_t samples = 0;  ///< camera paths finished
  uint64_t bounces = 0;  ///< path vertices
  bool operator==(const ChildProgress&) const = default;
};

/// Why an attempt failed; decides what the coordinator does next (HARD_CASES F07, F08).
enum class FailureCause {
  kCrash,
  kOutOfMemory,
  kHang,
  kScene,      ///< the scene cannot be read or compiled
  kMismatch,   ///< what was loaded is not what the coordinator pinned
  kNonFinite,  ///< too many samples are not finite
  kTransfer,   ///< a blob could not be fetched
  kOutput,     ///< the tile could not be written
};
const char* to_string(FailureCause cause);
FailureCause failure_cause(const std::string& name);

/// A finished tile on disk.
struct RenderedTile {
  std::string path;
  std::string digest;  ///< SHA-256 of the file, lower-case hex
  std::string result_key;
  uint64_t bytes = 0;
  uint64_t samples = 0;  ///< camera paths in it
  uint64_t bounces = 0;
  double seconds = 0;      ///< wall time of the rendering phase
  double cpu_seconds = 0;  ///< of all threads
  /// What went wrong by cause: see PathCounters.
  uint64_t nonfinite = 0, clamped = 0, majorant_violations = 0, truncated = 0;
  bool world_reused = false;  ///< the compiled scene was still there from an earlier task
};

nlohmann::json to_json(const RenderCommand& command);
nlohmann::json to_json(const ChildProgress& progress);
nlohmann::json to_json(const RenderedTile& tile);
/// These throw nlohmann::json::exception when a field is missing or of the wrong type.
RenderCommand render_command_from(const nlohmann::json& message);
ChildProgress child_progress_from(const nlohmann::json& message);
RenderedTile rendered_tile_from(const nlohmann::json& message);

}  // namespace woodcock
