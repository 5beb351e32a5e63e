// `woodcock resolve-scene`: how a coordinator reads the scenes that programs without a scene reader hand in. It is started by the
// coordinator in a folder that holds the scene's files, which are not trusted.
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <string>

#include "client/adaptive_render.h"
#include "client/commands.h"
#include "client/fetch_frames.h"
#include "client/submission.h"
#include "renderer/frame/estimator_settings.h"
#include "rpc/convert.h"
#include "rpc/scene_paths.h"
#include "woodcock/v1/scenes_service.pb.h"

namespace woodcock {
namespace {

struct ResolveOptions {
  std::string manifests;
  pid_t parent = 0;
};

[[maybe_unused]] constexpr rlim_t kMemoryLimit = rlim_t{16} << 30;

void bound_this_process(pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
#ifndef __SANITIZE_ADDRESS__  // its shadow is larger than any limit
  const rlimit memory{kMemoryLimit, kMemoryLimit};
  ::setrlimit(RLIMIT_AS, &memory);
#endif
  const rlimit core{0, 0};
  ::setrlimit(RLIMIT_CORE, &core);
}

/// What `woodcock submit` would send for these files, which lie in the current folder.
Submission resolve(const v1::SubmitSceneRequest& request, v1::SubmitSceneResponse& response) {
  Submission submission;
  const auto add = [&](const std::string& scene_file, uint64_t number) {
    FrameSettings settings = rpc::from_wire(request.settings(), number);
    if (request.has_target()) {
      const int64_t limit = request.target().max_samples();
      if (limit > 0) settings.samples = limit;
      if (!settings.samples) settings.samples = SamplingTarget{}.max_samples;
    }
    resolve_estimator(settings);
    add_frame(scene_file, settings, static_cast<int>(request.settings().tile_size()), submission,
              [&](const std::string& line) { response.add_warnings(rpc::without_folder(line, std::filesystem::current_path())); });
  };
  check_scene_of_sequence(request.scene_file(), static_cast<size_t>(request.frames_size()));
  if (request.frames().empty()) add(request.scene_file(), 0);
  for (const uint64_t number : request.frames()) add(with_frame_number(request.scene_file(), number), number);
  v1::SubmitJobRequest& job = submission.request;
  job.set_request_id(request.request_id());
  job.set_name(request.name());
  job.set_priority(request.priority());
  if (request.has_policy()) *job.mutable_policy() = request.policy();
  if (request.has_target()) {
    *job.mutable_target() = request.target();
    job.mutable_target()->set_max_samples(job.settings().samples());
  }
  return submission;
}

int run(const ResolveOptions& options) {
  bound_this_process(options.parent);
  v1::SubmitSceneRequest request;
  if (!request.ParseFromIstream(&std::cin)) throw std::runtime_error("standard input holds no SubmitSceneRequest");
  v1::SubmitSceneResponse response;
  Submission submission;
  try {
    submission = resolve(request, response);
  } catch (const std::exception& error) {
    throw std::runtime_error(rpc::without_folder(error.what(), std::filesystem::current_path()));
  }
  for (const auto& [digest, bytes] : submission.manifests) {
    std::ofstream file(std::filesystem::path(options.manifests) / digest, std::ios::binary);
    file << bytes;
    file.close();
    if (!file) throw std::runtime_error("a manifest cannot be written");
  }
  *response.mutable_resolved() = submission.request;
  if (!response.SerializeToOstream(&std::cout)) throw std::runtime_error("standard output cannot be written");
  return 0;
}

}  // namespace

void add_resolve_command(CLI::App& app, int& code) {
  auto* command = app.add_subcommand("resolve-scene", "Internal: read a scene for a coordinator")->group("");
  auto options = std::make_shared<ResolveOptions>();
  command->add_option("--manifests", options->manifests, "Folder for the manifests")->required();
  command->add_option("--parent", options->parent, "Process of the coordinator")->required();
  command->callback([options, &code] { code = run(*options); });
}

}  // namespace woodcock
