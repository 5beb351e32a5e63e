// `woodcock up`: a coordinator and workers on this machine.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "client/background_program.h"
#include "client/commands.h"
#include "client/interrupt.h"
#include "client/print.h"
#include "rpc/address.h"
#include "rpc/channel.h"
#include "rpc/machine_memory.h"
#include "rpc/standard_output.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using Programs = std::vector<std::unique_ptr<BackgroundProgram>>;

constexpr std::chrono::seconds kStart{60};
constexpr milliseconds kTick{50};
/// For finishing what runs when we end; what takes longer is rendered again at the next start.
constexpr int kDrainSeconds = 3;

/// Between the end of a program and its next start: doubled each time, and short again once it has run for a while.
constexpr milliseconds kFirstRestart{500}, kLastRestart{30'000};
constexpr std::chrono::seconds kRunsWell{60};

struct UpOptions {
  std::string folder = "woodcock-service", host = "127.0.0.1";
  int workers = 2, threads = 0, port = 7420;
  bool json = false;
};

/// Throws with the log's end when a program is no longer there.
void check_running(const Programs& programs) {
  for (const auto& program : programs)
    if (!program->running())
      throw std::runtime_error(
          fmt::format("{} {}. Its last output:\n{}", program->name(), program->how_it_ended(), program->last_output()));
}

/// False when interrupted. Throws when a program ends, or after a minute.
template <typename Condition>
bool wait_until(const Programs& programs, const std::string& what, Condition condition) {
  const auto deadline = std::chrono::steady_clock::now() + kStart;
  while (!condition()) {
    if (interrupt_flag()) return false;
    check_running(programs);
    if (std::chrono::steady_clock::now() > deadline) throw std::runtime_error(what + " is not ready after a minute: see the logs");
    std::this_thread::sleep_for(kTick);
  }
  return true;
}

/// Starts programs again that have ended, one by one, each with a back-off of its own.
class Keeper {
 public:
  explicit Keeper(Programs& programs) : programs_(programs), states_(programs.size()) {}

  /// Call it often.
  void look_after() {
    const auto now = Clock::now();
    for (size_t i = 0; i < programs_.size(); ++i) {
      BackgroundProgram& program = *programs_[i];
      State& state = states_[i];
      if (program.running()) continue;
      if (!state.again_at) {
        if (now - state.started > kRunsWell) state.pause = kFirstRestart;
        note("{} {}: it is started again in {:.1f} s. Its last output:\n{}\n", program.name(), program.how_it_ended(),
             1e-3 * static_cast<double>(state.pause.count()), Lines{program.last_output()});
        state.again_at = now + state.pause;
        state.pause = std::min(2 * state.pause, kLastRestart);
      } else if (now >= *state.again_at) {
        state.again_at.reset();
        state.started = now;
        try {
          program.start_again();
        } catch (const std::exception& error) {
          note("{}\n", error.what());
        }
      }
    }
  }

 private:
  using Clock = std::chrono::steady_clock;
  struct State {
    Clock::time_point started = Clock::now();
    std::optional<Clock::time_point> again_at;
    milliseconds pause = kFirstRestart;
  };
  Programs& programs_;
  std::vector<State> states_;
};

/// IPv6 as it stands before a port.
std::string with_brackets(const std::string& host) {
  return host.find(':') == std::string::npos || host[0] == '[' ? host : "[" + host + "]";
}

/// Ends them in this order: workers first, so that they can hand in what they have.
void stop(Programs& programs) {
  std::reverse(programs.begin(), programs.end());
  const auto end = [](auto first, auto last, std::chrono::seconds patience) {
    for (auto it = first; it != last; ++it) (*it)->ask_to_end();
    const auto deadline = std::chrono::steady_clock::now() + patience;
    const auto gone = [](const auto& program) { return !program->running(); };
    while (!std::all_of(first, last, gone) && std::chrono::steady_clock::now() < deadline) std::this_thread::sleep_for(kTick);
  };
  if (programs.empty()) return;
  end(programs.begin(), programs.end() - 1, std::chrono::seconds(kDrainSeconds + 10));
  end(programs.end() - 1, programs.end(), std::chrono::seconds(10));
  programs.clear();  // kills what did not heed
}

void serve(const UpOptions& options, const fs::path& folder, Programs& programs) {
  const fs::path coordinator_folder = folder / "coordinator", logs = folder / "logs";
  fs::create_directories(logs);
  std::error_code ignored;
  fs::remove(coordinator_folder / "address", ignored);  // of an earlier run
  programs.push_back(
      std::make_unique<BackgroundProgram>("woodcock-coordinator",
                                          std::vector<std::string>{"--dir", coordinator_folder.string(), "--listen",
                                                                   fmt::format("{}:{}", with_brackets(options.host), options.port)},
                                          logs / "coordinator.log"));
  std::string address;
  const auto coordinator_listens = [&] { return !(address = rpc::read_address_file(coordinator_folder.string())).empty(); };
  if (!wait_until(programs, "the coordinator", coordinator_listens)) return;

  const int processors = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  const int threads = options.threads > 0 ? options.threads : std::max(1, processors / options.workers);
  std::vector<fs::path> ready;
  for (int i = 1; i <= options.workers; ++i) {
    const fs::path worker = folder / fmt::format("worker-{}", i);
    fs::remove(worker / "ready", ignored);
    ready.push_back(worker / "ready");
    std::vector<std::string> worker_arguments{"--dir",     worker.string(),         "--coordinator", address,
                                              "--threads", std::to_string(threads), "--drain",       std::to_string(kDrainSeconds)};
    // They share the machine's.
    if (const int64_t memory = rpc::machine_memory() / options.workers; memory > 0)
      worker_arguments.insert(worker_arguments.end(), {"--memory", std::to_string(memory)});
    programs.push_back(std::make_unique<BackgroundProgram>("woodcock-worker", worker_arguments, logs / fmt::format("worker-{}.log", i)));
  }
  const auto workers_connected = [&] {
    return std::all_of(ready.begin(), ready.end(), [](const fs::path& file) { return fs::exists(file); });
  };
  if (!wait_until(programs, "a worker", workers_connected)) return;

  if (options.json) {
    say_json({{"address", address}, {"dir", folder.string()}, {"workers", options.workers}, {"threads_per_worker", threads}}, -1);
  } else {
    const std::string where = address == rpc::kDefaultAddress ? "" : " --coordinator " + address;
    say("coordinator at {}, {} workers of {} threads, everything in {}\n", address, options.workers, threads, folder.string());
    say("render there:  woodcock submit SCENE{} -o OUT.exr\n", where);
    say("stop with Ctrl-C; jobs go on at the next start\n");
  }
  rpc::flush_standard_output();
  // Workers know this address: a coordinator that is started again listens there, also where the port was any free one.
  programs.front()->set_arguments({"--dir", coordinator_folder.string(), "--listen", address});
  Keeper keeper(programs);
  while (!interrupt_flag()) {
    keeper.look_after();
    std::this_thread::sleep_for(kTick);
  }
}

int run(const UpOptions& options) {
  interrupt_flag();
  const fs::path folder = fs::absolute(options.folder);
  Programs programs;
  try {
    serve(options, folder, programs);
  } catch (...) {
    stop(programs);
    throw;
  }
  stop(programs);
  return 0;
}

}  // namespace

void add_up_command(CLI::App& app, int& code) {
  auto* command =
      app.add_subcommand("up", "Run a coordinator and workers on this machine until Ctrl-C; what ends by itself is started again");
  auto options = std::make_shared<UpOptions>();
  command->add_option("--workers", options->workers, "Number of workers")->check(CLI::Range(1, 256))->capture_default_str();
  command->add_option("--threads-per-worker", options->threads, "Threads of each; 0 shares the processors among them")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command->add_option("--dir", options->folder, "Folder for jobs, results, scenes and logs; made if absent, used again if there")
      ->capture_default_str();
  command->add_option("--host", options->host, "Address to listen on; anyone who reaches it may submit jobs")
      ->check([](const std::string& host) {
        return rpc::problem_of_address(with_brackets(host) + ":1").empty() ? ""
                                                                           : "expected the name or number of one address of this machine";
      })
      ->capture_default_str();
  command->add_option("--port", options->port, "Port to listen on; 0 takes a free one")->check(CLI::Range(0, 65535))->capture_default_str();
  command->add_flag("--json", options->json, "When ready, one JSON object on standard output: address, dir, workers");
  command->footer(
      "Examples:\n"
      "  woodcock up --workers 2\n"
      "  woodcock up --workers 4 --threads-per-worker 2 --dir /var/tmp/woodcock --port 7500");
  command->callback([options, &code] { code = run(*options); });
}

}  // namespace woodcock
