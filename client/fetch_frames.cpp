#include "client/fetch_frames.h"
#include "client/convergence_table.h"

#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <thread>

#include "client/health.h"
#include "client/interrupt.h"
#include "client/job_view.h"
#include "client/output_path.h"
#include "client/print.h"
#include "renderer/accuracy/error.h"
#include "renderer/film/picture_file.h"
#include "renderer/film/png.h"
#include "rpc/blob_transfer.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;
/// A partial image is merged on demand.
constexpr std::chrono::minutes kMergeDeadline{10};

std::string default_name(const v1::Job& job) {
  const std::string stem = fs::path(job.name()).stem().string();
  const bool numbered = job.frame_count() > 1 && stem.find('#') == std::string::npos;
  return (stem.empty() ? job.job_id() : stem) + (numbered ? "-####.exr" : ".exr");
}

}  // namespace

std::string with_frame_number(const std::string& text, uint64_t frame) {
  size_t best = 0, best_length = 0;
  for (size_t i = 0; i < text.size();) {
    size_t end = i;
    while (end < text.size() && text[end] == '#') ++end;
    if (end - i > best_length) best = i, best_length = end - i;
    i = std::max(end, i + 1);
  }
  if (best_length == 0) return text;
  return text.substr(0, best) + fmt::format("{:0{}}", frame, best_length) + text.substr(best + best_length);
}

void check_scene_of_sequence(const std::string& scene_file, size_t frames) {
  if (frames <= 1 || scene_file.find('#') != std::string::npos) return;
  throw std::invalid_argument(
      fmt::format("found {} frames of \"{}\", whose name has no ####: each would be the same scene; name the files of the sequence, as in "
                  "shot.####.pbrt, or give one frame",
                  frames, rpc::printable(scene_file)));
}

void check_output(const std::string& output, int64_t frames) {
  if (output.empty()) return;
  if (frames > 1 && output.find('#') == std::string::npos)
    throw std::runtime_error("--output must hold #### for the frame's number, since there are " + std::to_string(frames) + " frames");
  output_path(with_frame_number(output, 0), "", false);
}

void download_frame(Service& service, const std::string& digest, const fs::path& picture) {
  const fs::path nodes = nodes_path(picture);
  // The old pair stays until the new one is complete.
  const fs::path arrived = nodes.string() + ".new";
  const auto deadline = std::chrono::steady_clock::now() + service.patience();
  for (bool here = false; !here;) {
    try {
      rpc::download_file(service.blobs(), digest, arrived.string(), true);
      here = true;
    } catch (const rpc::RpcError& error) {
      if (!rpc::is_retryable(error.code()) || interrupt_flag() || std::chrono::steady_clock::now() > deadline) throw;
      std::this_thread::sleep_for(std::chrono::seconds(1));
    }
  }
  try {
    const std::unique_ptr<AtomicFile> made = make_picture(arrived, picture);
    fs::rename(arrived, nodes);
    made->commit();
  } catch (...) {
    std::error_code ignored;
    fs::remove(arrived, ignored);
    throw;
  }
}

Fetched fetch_frames(Service& service, const v1::Job& job, const FetchOptions& options) {
  check_output(options.output, options.frame ? 1 : job.frame_count());
  Fetched fetched;
  PathCounters health;
  for (const v1::FrameStatus& status : job.frames()) {
    if (options.frame && status.frame() != *options.frame) continue;
    if (!options.frame && job.frame_count() > 1 && status.state() == v1::FRAME_STATE_FAILED) {
      note("frame {} failed and is left out: {}\n", status.frame(), status.reason());
      fetched.complete = false;
      continue;
    }
    const std::string asked = options.output.empty() ? "" : with_frame_number(options.output, status.frame());
    const fs::path path = output_path(asked, with_frame_number(default_name(job), status.frame()), false);
    v1::GetFrameRequest request;
    request.set_job_id(job.job_id());
    request.set_frame(status.frame());
    request.set_partial(options.partial);
    v1::GetFrameResponse response;
    service.call(&v1::JobsService::Stub::GetFrame, request, response, fmt::format("asking for frame {}", status.frame()), kMergeDeadline);
    const fs::path nodes = nodes_path(path);
    download_frame(service, response.image_digest(), path);
    const fs::path png = fs::path(path).replace_extension(".png");
    write_png(nodes, png);

    health.add(health_of(response.frame()));
    const bool complete = !response.partial() && response.frame().state() != v1::FRAME_STATE_PARTIAL;
    fetched.complete = fetched.complete && complete;
    fetched.frames.push_back({{"frame", status.frame()},
                              {"output", path.string()},
                              {"nodes", nodes.string()},
                              {"png", png.string()},
                              {"digest", response.image_digest()},
                              {"complete", complete},
                              {"statistics", statistics_json(response.statistics())}});
    const Convergence convergence = response.partial() ? Convergence{} : convergence_of(response);
    if (!convergence.points.empty()) {
      const nlohmann::json record = convergence_json(convergence, 0);
      fetched.frames.back()["convergence"] = record;
      write_sidecar(path, {{"picture", path.filename().string()}, {"job", job.job_id()}, {"convergence", record}});
    }
    if (options.quiet) continue;
    say("{}: frame {}{}\n", path.string(), status.frame(), complete ? "" : ", not complete");
    say("{}: the same picture to look at\n{}: its samples, for --resume and merge\n", png.string(), nodes.string());
    const ErrorEstimate error = estimate_error(nodes);
    say("{}{}", Lines{format_error(error)}, Lines{format_bias(job.settings().estimator())});
    if (job.has_target()) {
      if (!response.partial()) say("{}\n", target_line(job, response.frame()));
      continue;
    }
    // Of a sequence the files beside the pictures hold it.
    if (job.frame_count() == 1 || options.frame) say("{}", Lines{format_convergence(convergence, 0)});
    if (!convergence.points.empty()) say("{}: errors and times\n", sidecar_path(path).string());
  }
  if (fetched.frames.empty() && fetched.complete)
    throw std::runtime_error(fmt::format("job {} has no frame {}", job.job_id(), options.frame.value_or(0)));
  if (fetched.frames.empty()) throw std::runtime_error(fmt::format("all frames of job {} failed", job.job_id()));
  if (!options.quiet && fetched.complete && job.has_target())
    say("less error: woodcock extend {} --target-error E\n", job.job_id());
  else if (!options.quiet && fetched.complete)
    say("more samples: woodcock extend {} --spp N\n", job.job_id());
  report_health(health);
  return fetched;
}

}  // namespace woodcock
