#include "coordinator/assembler.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <fstream>
#include <iostream>

#include "renderer/accuracy/error.h"
#include "renderer/accuracy/error_summary.h"
#include "renderer/film/exr.h"
#include "renderer/film/merge.h"
#include "rpc/convert.h"

namespace woodcock::coordinator {
namespace {

using Clock = std::chrono::steady_clock;
/// A frame of 16k × 16k pixels merges in minutes.
constexpr std::chrono::minutes kTimeLimit{60};
[[maybe_unused]] constexpr rlim_t kMemoryLimit = rlim_t{16} << 30;

/// The powers of two below `samples` that no tile reaches across.
std::vector<int64_t> prefix_counts(const std::vector<SampleRange>& ranges, int64_t samples) {
  std::vector<int64_t> counts;
  for (int64_t n = 1; n < samples; n *= 2)
    if (std::none_of(ranges.begin(), ranges.end(), [&](SampleRange r) { return r.begin < n && n < r.end; })) counts.push_back(n);
  return counts;
}

FrameStatistics statistics_of(const ErrorEstimate& e) {
  FrameStatistics s;
  s.image_mean = e.image_mean;
  s.standard_error = e.standard_error;
  if (e.relative_error) {
    s.relative_error = e.relative_error->value;
    s.relative_error_half_width = e.relative_error->half_width;
  }
  s.firefly_share = e.firefly_share;
  s.samples = e.samples;
  s.pixels = e.pixels;
  s.missing_pixels = e.missing_pixels;
  return s;
}

std::string header_json(const FrameHeader& header) {
  std::string json;
  if (!google::protobuf::util::MessageToJsonString(rpc::to_wire(header), &json).ok()) return {};
  return json;
}

nlohmann::json to_json(const Decision& decision) {
  return {{"error", decision.error}, {"counts", to_text(decision.counts)}, {"active", decision.active}, {"reached", decision.reached}};
}

/// Throws std::exception for what cannot follow `present`: the child has read files that are not trusted.
Decision decision_from_json(const nlohmann::json& json, const std::vector<int64_t>& present) {
  Decision decision;
  decision.error = json.at("error");
  decision.active = json.at("active");
  decision.reached = json.at("reached");
  auto counts = parse_counts(json.at("counts").get<std::string>(), present.size());
  if (!counts) throw std::runtime_error("the child decided nonsense");
  decision.counts = std::move(*counts);
  int64_t raised = 0;
  for (size_t b = 0; b < present.size(); ++b) {
    if (decision.counts[b] < present[b]) throw std::runtime_error("the child decided nonsense");
    raised += decision.counts[b] > present[b];
  }
  if (raised != decision.active) throw std::runtime_error("the child decided nonsense");
  return decision;
}

/// Reads what the child writes until it closes the pipe or the time is up. False then.
bool read_all(int fd, Clock::time_point deadline, std::string& text) {
  for (char buffer[4096];;) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
    pollfd item{fd, POLLIN, 0};
    const int ready = left > 0 ? ::poll(&item, 1, static_cast<int>(std::min<int64_t>(left, 1000))) : -1;
    if (left <= 0 || (ready < 0 && errno != EINTR)) return false;
    if (ready <= 0) continue;
    const ssize_t n = ::read(fd, buffer, sizeof buffer);
    if (n == 0) return true;
    if (n > 0) text.append(buffer, static_cast<size_t>(n));
    if (n < 0 && errno != EINTR) return false;
    if (text.size() > (8 << 20)) return false;
  }
}

}  // namespace

AssembleResult assemble(const AssembleRequest& request) {
  AssembleResult result;
  std::vector<std::filesystem::path> tiles;
  std::vector<SampleRange> ranges;
  for (size_t i = 0; i < request.tile_paths.size(); ++i) {
    try {
      const ExrReader reader(request.tile_paths[i]);
      const std::string difference = header_difference(request.header, "the frame", reader.info().header, "the tile");
      if (!difference.empty()) throw FilmError(request.tile_paths[i], difference);
      tiles.emplace_back(request.tile_paths[i]);
      ranges.insert(ranges.end(), reader.info().nodes.begin(), reader.info().nodes.end());
    } catch (const std::exception& error) {
      result.damaged.push_back(i);
      result.error = error.what();
    }
  }
  if (!result.damaged.empty()) return result;
  try {
    ErrorEstimate error;
    const PictureSummary summary = error_summary(error);
    merge_files(tiles, request.output_path, {{}, {}, request.map}, &summary);
    result.statistics = statistics_of(error);
    if (request.prefixes && request.map.uniform() && error.missing_pixels == 0) {
      for (const ErrorEstimate& prefix : estimate_prefixes(tiles, prefix_counts(ranges, error.samples)))
        result.statistics.convergence.points.push_back({prefix.samples, prefix, 0});
      result.statistics.convergence.points.push_back({error.samples, error, 0});
    }
    if (request.target)
      result.decision = decide(request.map, block_statistics(request.output_path, request.map), request.closed, *request.target);
    result.ok = true;
  } catch (const std::exception& error) {
    result.error = error.what();
  }
  return result;
}

AssembleResult assemble_in_child(const std::string& program, const std::string& temporary_dir, const AssembleRequest& request,
                                 const std::function<void()>& started) {
  static std::atomic<int> counter{0};
  AssembleResult result;
  const std::string spec_path = temporary_dir + "/assemble-" + std::to_string(++counter) + ".json";
  {
    std::ofstream spec(spec_path);
    nlohmann::json json{{"header", header_json(request.header)}, {"samples", request.map.largest()}, {"tiles", request.tile_paths},
                        {"output", request.output_path},         {"prefixes", request.prefixes},     {"parent", ::getpid()}};
    if (!request.map.uniform()) json["map"] = to_text(request.map.counts);
    if (request.target)
      json["target"] = {{"error", request.target->error}, {"max_samples", request.target->max_samples}, {"closed", request.closed}};
    spec << json;
    spec.close();
    if (!spec) {
      result.error = "cannot write " + spec_path;
      return result;
    }
  }
  int pipe_fds[2];
  if (::pipe2(pipe_fds, O_CLOEXEC) != 0) {
    result.error = std::string("pipe: ") + std::strerror(errno);
    return result;
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, pipe_fds[1], STDOUT_FILENO);
  const std::string option = "--assemble";
  char* arguments[] = {const_cast<char*>(program.c_str()), const_cast<char*>(option.c_str()), const_cast<char*>(spec_path.c_str()),
                       nullptr};
  // The child needs nothing of our environment.
  char* environment[] = {nullptr};
  pid_t child = 0;
  const int spawned = ::posix_spawn(&child, program.c_str(), &actions, nullptr, arguments, environment);
  posix_spawn_file_actions_destroy(&actions);
  ::close(pipe_fds[1]);
  std::string output;
  if (spawned != 0) {
    result.error = "cannot start " + program + ": " + std::strerror(spawned);
  } else {
    started();
    const bool finished = read_all(pipe_fds[0], Clock::now() + kTimeLimit, output);
    if (!finished) ::kill(child, SIGKILL);
    int status = 0;
    while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    try {
      if (WIFSIGNALED(status)) throw std::runtime_error(std::string("the merge ended by signal ") + strsignal(WTERMSIG(status)));
      const nlohmann::json json = nlohmann::json::parse(output);
      result.ok = json.at("ok").get<bool>();
      result.error = json.at("error").get<std::string>();
      result.damaged = json.at("damaged").get<std::vector<size_t>>();
      result.statistics = statistics_from_json(json.at("statistics").dump());
      if (request.target && result.ok) result.decision = decision_from_json(json.at("decision"), request.map.counts);
    } catch (const std::exception& error) {
      result.ok = false;
      result.error = finished ? error.what() : "the merge took too long";
    }
  }
  ::close(pipe_fds[0]);
  ::unlink(spec_path.c_str());
  return result;
}

int assemble_main(const std::string& spec_path) {
#ifndef __SANITIZE_ADDRESS__  // its shadow is larger than any limit
  const rlimit memory{kMemoryLimit, kMemoryLimit};
  ::setrlimit(RLIMIT_AS, &memory);
#endif
  const rlimit core{0, 0};
  ::setrlimit(RLIMIT_CORE, &core);
  AssembleResult result;
  try {
    std::ifstream file(spec_path);
    const nlohmann::json spec = nlohmann::json::parse(file);
    // A coordinator that was killed is started again and clears its temporary files: nothing may write there any more.
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != spec.at("parent").get<pid_t>()) return 1;
    v1::FrameHeader header;
    if (!google::protobuf::util::JsonStringToMessage(spec.at("header").get<std::string>(), &header).ok())
      throw std::runtime_error("malformed header");
    AssembleRequest request;
    request.header = rpc::from_wire(header);
    request.map.rect = request.header.bounds;
    request.map.counts.assign(request.map.grid().size(), spec.at("samples").get<int64_t>());
    if (spec.contains("map")) {
      auto counts = parse_counts(spec.at("map").get<std::string>(), request.map.grid().size());
      if (!counts) throw std::runtime_error("malformed sample map");
      request.map.counts = std::move(*counts);
    }
    request.tile_paths = spec.at("tiles");
    request.output_path = spec.at("output");
    request.prefixes = spec.at("prefixes");
    if (spec.contains("target")) {
      const nlohmann::json& target = spec.at("target");
      request.target = SamplingTarget{target.at("error"), target.at("max_samples")};
      request.closed = target.at("closed").get<std::vector<bool>>();
    }
    result = assemble(request);
  } catch (const std::exception& error) {
    result.error = error.what();
  }
  std::cout << nlohmann::json{{"ok", result.ok},
                              {"error", result.error},
                              {"damaged", result.damaged},
                              {"statistics", nlohmann::json::parse(to_json(result.statistics))},
                              {"decision", to_json(result.decision)}}
            << std::endl;
  return result.ok ? 0 : 1;
}

}  // namespace woodcock::coordinator
