// `woodcock submit`: a scene to the coordinator.
#include <fmt/format.h>

#include <chrono>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <set>

#include "client/adaptive_render.h"
#include "client/commands.h"
#include "client/fetch_frames.h"
#include "client/frame_options.h"
#include "client/health.h"
#include "client/job_view.h"
#include "client/progress_line.h"
#include "client/service.h"
#include "client/watch_job.h"
#include "renderer/frame/estimator_settings.h"
#include "renderer/frame/frame_header.h"
#include "renderer/scene/read_scene.h"
#include "rpc/blob_transfer.h"
#include "rpc/convert.h"
#include "rpc/manifest.h"

namespace woodcock {
namespace {

struct SubmitOptions {
  ServiceOptions service;
  FrameSettings settings;
  TargetOptions target;
  std::string scene, output, frames, name;
  int priority = 0, tile = 0;
  bool watch = false, json = false;
};

/// What is to be sent: the request, and the blobs it names.
struct Submission {
  v1::SubmitJobRequest request;
  std::map<std::string, SceneFile> files;        // by digest
  std::map<std::string, std::string> manifests;  // bytes by digest
};

/// "A-B" or "A" as numbers, both included; throws CLI::ValidationError.
std::pair<uint64_t, uint64_t> parse_frames(const std::string& text) {
  if (text.empty()) return {0, 0};
  unsigned long first = 0, last = 0;
  char rest = 0;
  const int fields = std::sscanf(text.c_str(), "%lu-%lu%c", &first, &last, &rest);
  if (fields == 1 && text.find_first_not_of("0123456789") == std::string::npos)
    last = first;
  else if (fields != 2 || text.front() == '-')
    throw CLI::ValidationError("--frames", "found \"" + text + "\", expected A-B with A <= B, e.g. 1-24");
  if (last < first || last - first >= rpc::kMaxFramesPerJob)
    throw CLI::ValidationError("--frames", "found \"" + text + "\", expected A-B with A <= B and at most 10000 frames");
  return {first, last};
}

std::string random_request_id() {
  std::random_device random;
  return fmt::format("{:08x}-{:08x}-{:08x}-{:08x}", random(), random(), random(), random());
}

void add_frame(const SubmitOptions& options, uint64_t number, Submission& submission) {
  FrameSettings settings = options.settings;
  settings.frame = number;
  ReadOptions read;
  read.skip_payload = true;
  read.allow_unsupported = settings.allow_unsupported;
  read.set = settings.set;
  read.warn = [](const std::string& line) { fmt::print(stderr, "warning: {}\n", line); };
  SceneDescription scene = read_scene(options.frames.empty() ? options.scene : with_frame_number(options.scene, number), read);
  apply_settings(settings, scene);
  for (const std::string& warning : setting_warnings(scene)) read.warn(warning);

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
    shared = rpc::to_wire(options.settings, options.tile);
    shared.set_samples(scene.settings.samples_per_pixel);
  } else if (shared.samples() != scene.settings.samples_per_pixel) {
    throw std::runtime_error("the frames of the sequence ask for different numbers of samples: give one with --spp");
  }
}

/// Uploads what the coordinator lacks; returns the bytes sent.
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

int run(const SubmitOptions& options) {
  const auto [first, last] = parse_frames(options.frames);
  check_output(options.output, static_cast<int64_t>(last - first + 1));
  Submission submission;
  submission.request.set_request_id(random_request_id());
  submission.request.set_name(options.name.empty() ? options.scene.substr(options.scene.find_last_of('/') + 1) : options.name);
  submission.request.set_priority(options.priority);
  for (uint64_t number = first; number <= last; ++number) add_frame(options, number, submission);
  if (options.target.adaptive()) {
    const SamplingTarget target = sampling_target(options.target);
    submission.request.mutable_target()->set_error(target.error);
    submission.request.mutable_target()->set_max_samples(target.max_samples);
  }

  Service service(options.service);
  const int64_t uploaded = upload_missing(service, submission, options.json);
  v1::SubmitJobResponse response;
  service.call(&v1::JobsService::Stub::SubmitJob, submission.request, response, "submitting the job");
  const std::string& id = response.job_id();

  nlohmann::json report{{"job_id", id}, {"uploaded_bytes", uploaded}, {"frames", last - first + 1}};
  const bool follow = options.watch || !options.output.empty();
  if (!options.json && !follow) {
    fmt::print("{}\n", id);
    const std::string aim =
        options.target.adaptive() ? fmt::format("a relative error of {:.3g} %, at most ", 100 * *options.target.error) : "";
    fmt::print(stderr, "job {}: {} frame{} of {}{} samples per pixel; follow it with: woodcock watch {}\n", id, last - first + 1,
               last == first ? "" : "s", aim, submission.request.settings().samples(), id);
  }
  int code = 0;
  if (follow) {
    const auto job = watch_job_on_terminal(service, id, options.json);
    if (!job) return 1;
    code = exit_code(job->state());
    report["job"] = job_json(*job);
    if (code == 1) {
      if (!options.json) fmt::print(stderr, "job {} is {}: {}\n", id, state_name(job->state()), job->state_reason());
    } else if (!options.output.empty()) {
      FetchOptions fetch;
      fetch.output = options.output;
      fetch.quiet = options.json;
      report["images"] = fetch_frames(service, *job, fetch).frames;
    } else {
      if (!options.json) {
        fmt::print("{}\n", id);
        fmt::print(stderr, "job {} is {}; get it with: woodcock fetch {} -o OUT.exr\n", id, state_name(job->state()), id);
      }
      report_health(health_of(*job));
    }
  }
  if (options.json) fmt::print("{}\n", report.dump(2));
  return code;
}

}  // namespace

void add_submit_command(CLI::App& app, int& code) {
  auto* command = app.add_subcommand("submit", "Give a scene to the coordinator to be rendered by its workers");
  auto options = std::make_shared<SubmitOptions>();
  command->add_option("scene", options->scene, "Scene file in pbrt-v4 format; with --frames, #### stands for the frame's number")
      ->required();
  add_service_options(*command, options->service);
  command->add_option("-o,--output", options->output,
                      "Wait for the end and write the EXR here, a PNG beside it; #### stands for the frame's number");
  command->add_option("--frames", options->frames, "Frames A-B of a sequence, both included");
  command->add_option("--priority", options->priority, "Larger is served first; equal ones share the workers")
      ->check(CLI::Range(-rpc::kMaxPriority, rpc::kMaxPriority))
      ->capture_default_str();
  command->add_option("--name", options->name, "The job's name for people (default: the scene file's)");
  add_frame_options(*command, options->settings);
  add_target_options(*command, options->target);
  command
      ->add_option("--tile", options->tile,
                   "Edge of the leased tiles in pixels, a power of two from 8 to 1024; 0 leaves it to the coordinator")
      ->check(CLI::IsMember({0, 8, 16, 32, 64, 128, 256, 512, 1024}))
      ->capture_default_str();
  command->add_flag("--watch", options->watch, "Show progress until the job has ended");
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer(
      "Examples:\n"
      "  woodcock submit scenes/cloud.pbrt --spp 256 -o cloud.exr       wait for the image\n"
      "  woodcock submit scenes/cloud.pbrt --spp 256                    prints the job's id and returns\n"
      "  woodcock submit scenes/cloud.pbrt --target-error 2% -o cloud.exr\n"
      "  woodcock submit shot.####.pbrt --frames 1-24 -o shot.####.exr  a sequence\n"
      "The image is the one that `woodcock render` makes, to the bit.\n"
      "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 the job ended with parts missing.");
  command->callback([options, &code] {
    settle_targets(options->target, options->settings);
    // The coordinator's limit is the job's number of samples.
    if (options->target.adaptive()) options->settings.samples = sampling_target(options->target).max_samples;
    code = run(*options);
  });
}

}  // namespace woodcock
