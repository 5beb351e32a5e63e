// What a job costs beside its rendering: many jobs of one tiny task each on a coordinator and workers of this machine, all given away
// at once. Prints time and processor time by program, and how long the median job was in each stage.
#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "rpc/address.h"
#include "rpc/channel.h"
#include "rpc/child_program.h"
#include "rpc/file_descriptor.h"
#include "tests/support/processes.h"
#include "woodcock/v1/jobs_service.grpc.pb.h"
#include "woodcock/v1/scenes_service.grpc.pb.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
constexpr std::chrono::seconds kPatience{600};

struct Options {
  int jobs = 200, workers = 2, threads = 1, samples = 4, edge = 16;
  std::string programs = WOODCOCK_BIN_DIR;
};

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

/// A new folder, which goes with this object.
struct Folder {
  fs::path path;
  Folder() {
    std::string pattern = fs::temp_directory_path() / "woodcock-tiny-jobs-XXXXXX";
    if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("cannot make a folder " + pattern);
    path = pattern;
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
};

template <typename Condition>
void wait_until(const std::string& what, Condition condition) {
  const auto begin = Clock::now();
  while (!condition()) {
    if (Clock::now() - begin > kPatience) throw std::runtime_error(what + " takes longer than ten minutes");
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

/// A call of `method` with a deadline. Throws std::runtime_error.
template <typename Stub, typename Method, typename Request, typename Response>
void call(Stub& stub, Method method, const Request& request, Response& response) {
  grpc::ClientContext context;
  rpc::set_deadline(context, kPatience);
  const grpc::Status status = (stub.*method)(&context, request, &response);
  if (!status.ok()) throw std::runtime_error(status.error_message());
}

class Farm {
 public:
  explicit Farm(const Options& options) {
    coordinator_ = start(options, "woodcock-coordinator", {"--dir", folder_.path / "coordinator", "--listen", "127.0.0.1:0"});
    wait_until("the start of the coordinator", [&] { return !(address_ = rpc::read_address_file(folder_.path / "coordinator")).empty(); });
    for (int i = 1; i <= options.workers; ++i) {
      const fs::path folder = folder_.path / fmt::format("worker-{}", i);
      workers_.push_back(
          start(options, "woodcock-worker", {"--dir", folder, "--coordinator", address_, "--threads", std::to_string(options.threads)}));
      wait_until("the start of a worker", [&] { return fs::exists(folder / "ready"); });
    }
  }

  const std::string& address() const { return address_; }
  /// Seconds of a processor, by what they were used for.
  std::map<std::string, double> processor_seconds() const {
    std::map<std::string, double> used;
    const auto add = [&](const std::string& what, pid_t pid) {
      if (const auto now = testing::process_now(pid)) used[what] += now->cpu_seconds;
    };
    add("coordinator", coordinator_.pid());
    for (const pid_t server : testing::children_of(coordinator_.pid())) add("merges", server);
    for (const rpc::ChildProgram& worker : workers_) {
      add("workers", worker.pid());
      for (const pid_t child : testing::children_of(worker.pid())) add("render processes", child);
    }
    return used;
  }

 private:
  rpc::ChildProgram start(const Options& options, const std::string& program, std::vector<std::string> arguments) {
    fs::create_directories(folder_.path / "coordinator");
    const rpc::FileDescriptor log(::open((folder_.path / "log").c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644));
    rpc::ChildStart how{.program = options.programs + "/" + program, .arguments = std::move(arguments)};
    how.descriptors = {{STDOUT_FILENO, log.get()}, {STDERR_FILENO, log.get()}};
    return rpc::ChildProgram(how);
  }

  const Folder folder_;
  std::string address_;
  rpc::ChildProgram coordinator_;
  std::vector<rpc::ChildProgram> workers_;
};

v1::SubmitSceneRequest first_job(const Options& options) {
  v1::SubmitSceneRequest request;
  request.set_request_id("first");
  for (const std::string name : {"cornell.pbrt", "data/cube.pbrt"}) {
    std::ifstream file(fs::path(WOODCOCK_SOURCE_DIR) / "scenes" / name, std::ios::binary);
    v1::SceneInput& input = *request.add_files();
    input.set_path(name);
    input.set_content({std::istreambuf_iterator<char>(file), {}});
  }
  request.mutable_settings()->mutable_resolution()->set_width(options.edge);
  request.mutable_settings()->mutable_resolution()->set_height(options.edge);
  request.mutable_settings()->set_samples(options.samples);
  return request;
}

/// Milliseconds from the job's submit to the first event of each kind.
std::map<v1::JobEventKind, int64_t> stages_of(v1::JobsService::Stub& stub, const std::string& job) {
  v1::ListEventsRequest request;
  request.set_job_id(job);
  request.set_page_size(1000);
  v1::ListEventsResponse response;
  call(stub, &v1::JobsService::Stub::ListEvents, request, response);
  std::map<v1::JobEventKind, int64_t> stages;
  for (const v1::JobEvent& event : response.events()) stages.emplace(event.kind(), event.unix_ms() - response.events(0).unix_ms());
  return stages;
}

void run(const Options& options) {
  Farm farm(options);
  const auto channel = rpc::make_channel(farm.address());
  const auto scenes = v1::ScenesService::NewStub(channel);
  const auto stub = v1::JobsService::NewStub(channel);
  v1::SubmitSceneResponse first;
  call(*scenes, &v1::ScenesService::Stub::SubmitScene, first_job(options), first);
  const auto has_ended = [&](const std::string& job) {
    v1::GetJobRequest request;
    request.set_job_id(job);
    v1::GetJobResponse response;
    call(*stub, &v1::JobsService::Stub::GetJob, request, response);
    if (response.job().state() > v1::JOB_STATE_DONE) throw std::runtime_error("job " + job + " failed: " + response.job().state_reason());
    return response.job().state() == v1::JOB_STATE_DONE;
  };
  wait_until("the first job", [&] { return has_ended(first.job_id()); });

  // Each has a seed of its own, so that nothing is there already.
  const auto before = farm.processor_seconds();
  const auto begin = Clock::now();
  std::vector<std::string> jobs;
  for (int i = 1; i <= options.jobs; ++i) {
    v1::SubmitJobRequest request = first.resolved();
    request.set_request_id(fmt::format("tiny-{}", i));
    request.mutable_settings()->set_seed(static_cast<uint64_t>(i));
    request.mutable_frames(0)->mutable_header()->set_seed(static_cast<uint64_t>(i));
    v1::SubmitJobResponse response;
    call(*stub, &v1::JobsService::Stub::SubmitJob, request, response);
    jobs.push_back(response.job_id());
  }
  const double submitted = seconds_since(begin);
  for (const std::string& job : jobs) wait_until("a job", [&] { return has_ended(job); });
  const double seconds = seconds_since(begin);
  const auto after = farm.processor_seconds();

  fmt::print("{} jobs of {}x{} pixels and {} samples on {} workers of {} threads: {:.2f} s, {:.1f} ms a job; submitted in {:.2f} s\n",
             options.jobs, options.edge, options.edge, options.samples, options.workers, options.threads, seconds,
             1e3 * seconds / options.jobs, submitted);
  double all = 0;
  for (const auto& [what, used] : after) {
    const auto earlier = before.find(what);
    const double now = used - (earlier == before.end() ? 0 : earlier->second);
    all += now;
    fmt::print("  {:<18} {:6.2f} s of a processor, {:5.1f} ms a job\n", what, now, 1e3 * now / options.jobs);
  }
  fmt::print("  {:<18} {:6.2f} s of a processor, {:5.1f} ms a job\n", "together", all, 1e3 * all / options.jobs);
  const std::array<std::pair<v1::JobEventKind, const char*>, 4> stages{{{v1::JOB_EVENT_KIND_FRAME_PINNED, "pinned"},
                                                                        {v1::JOB_EVENT_KIND_LEASE_GRANTED, "leased"},
                                                                        {v1::JOB_EVENT_KIND_TASK_COMMITTED, "committed"},
                                                                        {v1::JOB_EVENT_KIND_FRAME_DONE, "image there"}}};
  std::map<v1::JobEventKind, std::vector<int64_t>> times;
  for (const std::string& job : jobs) {
    const auto of_job = stages_of(*stub, job);
    int64_t last = 0;
    for (const auto& [kind, name] : stages) {
      const auto found = of_job.find(kind);
      if (found == of_job.end()) continue;
      times[kind].push_back(found->second - last);
      last = found->second;
    }
  }
  fmt::print("  median of the jobs, from the stage before:");
  for (const auto& [kind, name] : stages) {
    std::vector<int64_t>& list = times[kind];
    if (list.empty()) continue;
    std::nth_element(list.begin(), list.begin() + static_cast<std::ptrdiff_t>(list.size() / 2), list.end());
    fmt::print(" {} {} ms;", name, list[list.size() / 2]);
  }
  fmt::print("\n");
}

}  // namespace
}  // namespace woodcock

int main(int argc, char** argv) {
  woodcock::Options options;
  CLI::App app("Many tiny jobs on a coordinator and workers of this machine: what a job costs beside its rendering.");
  app.add_option("--jobs", options.jobs, "How many")->check(CLI::Range(1, 100000))->capture_default_str();
  app.add_option("--workers", options.workers, "Workers, of one slot each")->check(CLI::Range(1, 64))->capture_default_str();
  app.add_option("--threads", options.threads, "Threads of each")->check(CLI::Range(1, 256))->capture_default_str();
  app.add_option("--spp", options.samples, "Samples per pixel of a job")->check(CLI::Range(1, 1 << 20))->capture_default_str();
  app.add_option("--edge", options.edge, "Width and height of its picture")->check(CLI::Range(1, 4096))->capture_default_str();
  app.add_option("--bin", options.programs, "Folder of the three programs")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    woodcock::run(options);
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "tiny_jobs: {}\n", error.what());
    return 1;
  }
}
