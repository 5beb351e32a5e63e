// woodcock-worker: renders tasks for a coordinator.
#include <signal.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <thread>

#include "rpc/address.h"
#include "rpc/channel.h"
#include "rpc/convert.h"
#include "rpc/limits.h"
#include "rpc/log.h"
#include "rpc/machine_memory.h"
#include "rpc/printable.h"
#include "rpc/quantities.h"
#include "rpc/standard_output.h"
#include "worker/frame_task_renderer.h"
#include "worker/supervisor.h"

namespace woodcock {
namespace {

struct Arguments {
  std::vector<std::string> coordinators{rpc::kDefaultAddress};
  std::string folder, name;
  int slots = 1, threads = 0;
  std::vector<std::string> tags;
  int64_t memory = 0;
  double cache_gb = 20, progress_timeout = 120, loading_timeout = 900, drain = 20;
  bool render_child = false;
  RenderChildOptions child;
  std::string test_hook;
};

void declare(CLI::App& app, Arguments& arguments) {
  app.add_option("--coordinator", arguments.coordinators, "HOST:PORT of the coordinator; several, separated by commas, are tried in turn")
      ->delimiter(',')
      ->envname("WOODCOCK_COORDINATOR")
      ->check(rpc::problem_of_address)
      ->capture_default_str();
  app.add_option("--dir", arguments.folder, "this worker's own folder: identity, scenes, unacknowledged results, logs; made if absent");
  app.add_option("--slots", arguments.slots, "tasks rendered at once, each in a process of its own")
      ->check(CLI::Range(1, static_cast<int>(rpc::kMaxSlots)))
      ->capture_default_str();
  app.add_option("--threads", arguments.threads, "threads of each task; 0 shares the processors among the slots")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_option("--name", arguments.name, "the worker's id instead of the one kept in DIR; unique: letters, digits, '.', '_', '-'");
  app.add_option("--tag", arguments.tags, "what jobs may ask for with --require-tag, e.g. gpu-room; may be given again")
      ->type_name("TAG")
      ->allow_extra_args(false)
      ->check([](const std::string& tag) {
        return rpc::is_identifier(tag) ? std::string() : std::string("expected 1 to 64 letters, digits, '.', '_' or '-', no '.' first");
      });
  app.add_option_function<std::string>(
         "--memory",
         [&arguments](const std::string& text) {
           try {
             arguments.memory = rpc::parse_bytes("--memory", text);
           } catch (const std::invalid_argument& error) {
             throw CLI::ValidationError(error.what());
           }
         },
         "memory for all slots together, e.g. 32G; each gives its task an equal share (0: what the machine has)")
      ->type_name("SIZE");
  app.add_option("--cache-gb", arguments.cache_gb, "scenes kept on disk, in GB; those in use are kept in any case")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  app.add_option("--progress-timeout", arguments.progress_timeout, "seconds without progress after which a render is killed as hung")
      ->check(CLI::Range(0.5, 86400.0))
      ->capture_default_str();
  app.add_option("--loading-timeout", arguments.loading_timeout, "the same for loading, and for building, a scene")
      ->check(CLI::Range(0.5, 86400.0))
      ->capture_default_str();
  app.add_option("--drain", arguments.drain, "seconds for finishing what runs after the first SIGTERM; a second one quits at once")
      ->check(CLI::Range(0.0, 86400.0))
      ->capture_default_str();
  app.add_option("--test-hook", arguments.test_hook,
                 "inject a fault into the render process: crash@N, exit@N, hang@N, memory@N or nan@N at its N-th task, @* at every one")
      ->group("For tests of fault handling only");
  const std::string internal = "Internal: how this program starts its render processes";
  app.add_flag("--render-child", arguments.render_child, "be a render process")->group(internal);
  app.add_option("--channel-fd", arguments.child.channel_fd, "socket to the worker")->group(internal);
  app.add_option("--parent-pid", arguments.child.parent_pid, "process of the worker")->group(internal);
  app.footer(
      "Examples:\n"
      "  woodcock-worker --dir /var/lib/woodcock/worker1 --coordinator farm:7420\n"
      "  woodcock-worker --dir w1 --slots 2 --threads 8\n"
      "  woodcock-worker --dir w2 --tag big --tag gpu-room --memory 32G\n"
      "Renders until it gets SIGTERM or Ctrl-C: then it finishes what runs for at most --drain seconds, gives back the rest and says that "
      "it\n"
      "leaves. Exit codes: 0 ended as told, 1 failed or refused by the coordinator, 2 wrong usage.");
}

/// Hands signals to the supervisor until `done`: the first SIGTERM or SIGINT drains, the second quits.
void watch_signals(Supervisor& supervisor, const sigset_t& signals, const std::atomic<bool>& done) {
  int seen = 0;
  while (!done) {
    const timespec tick{0, 100'000'000};
    if (::sigtimedwait(&signals, nullptr, &tick) < 0) continue;
    if (++seen == 1)
      supervisor.drain();
    else
      supervisor.quit();
  }
}

int work(const Arguments& arguments) {
  // Before any thread starts, so that all inherit it.
  sigset_t signals;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGTERM);
  ::sigaddset(&signals, SIGINT);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  ::signal(SIGPIPE, SIG_IGN);

  const auto milliseconds = [](double seconds) { return std::chrono::milliseconds(static_cast<int64_t>(seconds * 1000)); };
  SupervisorOptions options;
  options.coordinators = arguments.coordinators;
  options.worker_id = arguments.name;
  options.slots = arguments.slots;
  const int processors = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  options.threads = arguments.threads > 0 ? arguments.threads : std::max(1, processors / arguments.slots);
  options.tags = arguments.tags;
  options.memory = arguments.memory > 0 ? arguments.memory : rpc::machine_memory();
  options.asset_cache_bytes = static_cast<uint64_t>(arguments.cache_gb * 1e9);
  options.limits.rendering = milliseconds(arguments.progress_timeout);
  options.limits.loading = options.limits.building = milliseconds(arguments.loading_timeout);
  options.drain = milliseconds(arguments.drain);
  if (!arguments.test_hook.empty()) {
    options.child_arguments.push_back("--test-hook");
    options.child_arguments.push_back(arguments.test_hook);
  }
  const WorkerFolder folder(arguments.folder);
  spdlog::info("worker {} (start {}) in {}: {} slots of {} threads, {} of memory",
               arguments.name.empty() ? folder.worker_id() : arguments.name, folder.incarnation(), arguments.folder, options.slots,
               options.threads, rpc::bytes_text(options.memory));
  Supervisor supervisor(options, folder);
  std::atomic<bool> done{false};
  std::thread watcher([&] { watch_signals(supervisor, signals, done); });
  const int exit_code = supervisor.run();
  done = true;
  watcher.join();
  return exit_code;
}

int run(int argc, char** argv) {
  CLI::App app("Renders tasks for a Woodcock coordinator.", "woodcock-worker");
  app.set_version_flag("--version", "woodcock-worker " WOODCOCK_VERSION);
  Arguments arguments;
  declare(app, arguments);
  try {
    app.parse(argc, argv);
    if (!arguments.test_hook.empty()) arguments.child.test_hook = TestHook::parse(arguments.test_hook);
    if (!arguments.render_child && arguments.folder.empty()) throw CLI::RequiredError("--dir");
    if (!arguments.name.empty() && !rpc::is_identifier(arguments.name))
      throw CLI::ValidationError("--name", "1 to 64 letters, digits, '.', '_' or '-'");
    if (arguments.tags.size() > static_cast<size_t>(rpc::kMaxTags))
      throw CLI::ValidationError("--tag", "found " + std::to_string(arguments.tags.size()) + " tags, expected at most 32");
  } catch (const CLI::ParseError& error) {
    return rpc::exit_code_with_output(app.exit(error) == 0 ? 0 : 2, "woodcock-worker");
  } catch (const std::invalid_argument& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  if (arguments.render_child) {
    FrameTaskRenderer renderer;
    return run_render_child(arguments.child, renderer);
  }
  rpc::start_log("worker", "%Y-%m-%d %H:%M:%S.%e %^%l%$ %v");
  return work(arguments);
}

}  // namespace
}  // namespace woodcock

int main(int argc, char** argv) {
  try {
    return woodcock::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "woodcock-worker: %s\n", woodcock::rpc::printable_lines(error.what()).c_str());
    return 1;
  }
}
