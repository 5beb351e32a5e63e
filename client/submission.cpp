#include "client/submission.h"

#include <fmt/format.h>

#include <chrono>
#include <random>
#include <stdexcept>
#include <vector>

#include "client/print.h"
#include "client/progress_line.h"
#include "renderer/frame/estimator_settings.h"
#include "renderer/frame/frame_header.h"
#include "renderer/scene/read_scene.h"
#include "rpc/blob_transfer.h"
#include "rpc/convert.h"
#include "rpc/manifest.h"

namespace woodcock {

std::string random_request_id() {
  std::random_device random;
  return fmt::format("{:08x}-{:08x}-{:08x}-{:08x}", random(), random(), random(), random());
}

void warn_user(const std::string& line) { note("warning: {}\n", line); }

void add_frame(const std::string& scene_file, const FrameSettings& settings, int tile, Submission& submission,
               const std::function<void(const std::string&)>& warn) {
  ReadOptions read;
  read.skip_payload = true;
  read.allow_unsupported = settings.allow_unsupported;
  read.set = settings.set;
  read.warn = warn;
  SceneDescription scene = read_scene(scene_file, read);
  apply_settings(settings, scene);
  for (const std::string& warning : setting_warnings(scene)) warn(warning);

  v1::SceneManifest manifest;
  for (const SceneFile& file : scene.files) {
    v1::SceneFile& entry = *manifest.add_files();
    entry.set_path(file.relative_path);
    entry.set_content_digest(file.sha256);
    entry.set_bytes(static_cast<int64_t>(file.bytes));
    submission.files[file.sha256] = file;
  }
  const std::string bytes = rpc::serialize_manifest(manifest);
  const std::string digest = rpc::blob_digest(bytes);
  submission.manifests[digest] = bytes;

  v1::FrameInput& input = *submission.request.add_frames();
  input.set_manifest_digest(digest);
  input.set_scene_file(scene.files.front().relative_path);
  *input.mutable_header() = rpc::to_wire(frame_header(scene, settings));

  v1::RenderSettings& shared = *submission.request.mutable_settings();
  if (submission.request.frames_size() == 1) {
    shared = rpc::to_wire(settings, tile);
    shared.set_samples(scene.settings.samples_per_pixel);
  } else if (shared.samples() != scene.settings.samples_per_pixel) {
    throw std::runtime_error("the frames of the sequence ask for different numbers of samples: give one with --spp");
  }
}

int64_t upload_missing(Service& service, const Submission& submission, bool quiet) {
  std::vector<std::string> digests;
  for (const auto& [digest, file] : submission.files) digests.push_back(digest);
  for (const auto& [digest, bytes] : submission.manifests) digests.push_back(digest);
  const std::vector<std::string> missing = rpc::find_missing(service.blobs(), digests);
  int64_t total = 0, sent = 0;
  for (const std::string& digest : missing)
    if (const auto file = submission.files.find(digest); file != submission.files.end()) total += static_cast<int64_t>(file->second.bytes);
  ProgressLine line("uploading", quiet);
  const auto begin = std::chrono::steady_clock::now();
  for (const std::string& digest : missing) {
    const auto file = submission.files.find(digest);
    if (file == submission.files.end()) {
      rpc::upload_bytes(service.blobs(), submission.manifests.at(digest));
      continue;
    }
    rpc::TransferControl control;
    control.progress = [&](int64_t bytes) {
      const double done = static_cast<double>(sent + bytes);
      const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      line.show(total > 0 ? done / static_cast<double>(total) : 1, format_count(done / std::max(1e-3, seconds)) + "B/s");
    };
    rpc::upload_file(service.blobs(), file->second.absolute_path, digest, control);
    sent += static_cast<int64_t>(file->second.bytes);
  }
  return sent;
}

}  // namespace woodcock
