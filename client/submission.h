// A job on its way to the coordinator.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "client/service.h"
#include "renderer/frame/settings.h"
#include "renderer/scene/description.h"

namespace woodcock {

/// What is to be sent: the request, and the blobs it names.
struct Submission {
  v1::SubmitJobRequest request;
  std::map<std::string, SceneFile> files;        // by digest
  std::map<std::string, std::string> manifests;  // bytes by digest
};

std::string random_request_id();

/// Prints a warning to standard error.
void warn_user(const std::string& line);

/// Reads the scene and adds it as a frame with these settings, `settings.frame` its number; tiles of edge `tile`, 0 for the
/// coordinator's choice. Throws SceneError, std::invalid_argument, and std::runtime_error where
/// its samples are not those of the frames before it.
void add_frame(const std::string& scene_file, const FrameSettings& settings, int tile, Submission& submission,
               const std::function<void(const std::string&)>& warn = warn_user);

/// Uploads what the coordinator lacks; returns the bytes sent. `quiet` shows no progress.
int64_t upload_missing(Service& service, const Submission& submission, bool quiet);

}  // namespace woodcock
