// Images of a job onto the disk.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "client/service.h"

namespace woodcock {

struct FetchOptions {
  std::string output;             ///< EXR; "####" stands for the frame's number; empty: named after the job
  std::optional<uint64_t> frame;  ///< all frames if absent
  bool partial = false;           ///< what is committed so far will do
  bool quiet = false;             ///< print nothing
};

/// `text` with its longest run of '#' replaced by the number, padded with zeros to the run's length.
std::string with_frame_number(const std::string& text, uint64_t frame);

/// Throws std::invalid_argument when several frames would be one and the same scene.
void check_scene_of_sequence(const std::string& scene_file, size_t frames);

struct Fetched {
  bool complete = true;  ///< no frame lacks samples
  nlohmann::json frames = nlohmann::json::array();
};

/// Writes a frame's nodes, which the service names by `digest`, beside `picture`, and the picture that is made of them: the files
/// that `woodcock render` writes. Throws rpc::RpcError and FilmError.
void download_frame(Service& service, const std::string& digest, const std::filesystem::path& picture);

/// Writes each frame's picture with its nodes and a PNG beside it; prints where and what error was reached.
/// Throws rpc::RpcError, FilmError, and std::runtime_error for an output that cannot be written.
Fetched fetch_frames(Service& service, const v1::Job& job, const FetchOptions& options);

/// Throws std::runtime_error when these options cannot name one file a frame; call it before the work.
void check_output(const std::string& output, int64_t frames);

}  // namespace woodcock
