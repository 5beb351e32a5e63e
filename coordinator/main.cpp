// woodcock-coordinator: splits frames into tasks, leases them, merges the results.
#include <signal.h>
#include <unistd.h>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "coordinator/server.h"
#include "rpc/channel.h"

namespace {

using namespace woodcock;
using namespace woodcock::coordinator;

/// Fatal: what was acknowledged is durable; nothing more may be.
[[noreturn]] void die(const std::string& reason) {
  spdlog::critical("{}", reason);
  spdlog::shutdown();
  ::_exit(1);
}

void write_address(const std::string& dir, const std::string& address) {
  const std::string path = dir + "/address";
  std::ofstream(path + ".new") << address << "\n";
  std::filesystem::rename(path + ".new", path);
}

int serve(const CoordinatorOptions& options, const std::string& listen) {
  // Blocked before any thread is made, so that all inherit it and sigwait below gets the signal.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  ::signal(SIGPIPE, SIG_IGN);

  spdlog::info("at most {} open files", raise_descriptor_limit());
  std::filesystem::create_directories(options.dir);
  Coordinator coordinator(options);
  CoordinatorServer server(coordinator, listen);
  write_address(options.dir, server.address());
  std::cout << "listening on " << server.address() << std::endl;
  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("stopping on signal {}", signal);
  server.stop();
  std::error_code ignored;
  std::filesystem::remove(options.dir + "/address", ignored);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("coordinator"));
  spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %l %v");
  spdlog::flush_on(spdlog::level::info);

  CLI::App app("Splits frames into tasks, leases them to workers, merges the results.");
  CoordinatorOptions options;
  std::string listen = rpc::kDefaultAddress, assemble_spec, test_hook;
  int64_t lease_seconds = 30, grace_seconds = 10, min_free_mib = 64, pin_seconds = 3600, repin_seconds = 0;
  app.add_option("--dir", options.dir, "Folder of the database and the blobs");
  app.add_option("--listen", listen, "HOST:PORT; port 0 takes any free one. Not encrypted: keep to loopback or a private network")
      ->capture_default_str();
  app.add_option("--lease", lease_seconds, "Seconds without progress after which a worker's lease ends")
      ->check(CLI::Range(1, 86400))
      ->capture_default_str();
  app.add_option("--grace", grace_seconds, "Seconds added to that for delays of the network")
      ->check(CLI::Range(0, 86400))
      ->capture_default_str();
  app.add_option("--min-free", min_free_mib, "MiB of the disk that are kept free")->check(CLI::Range(1, 1 << 20))->capture_default_str();
  app.add_option("--repin-after", repin_seconds,
                 "Seconds after which a frame starts again whose build no connected worker has; 0: only by `woodcock repin`")
      ->check(CLI::Range(0, 1 << 30))
      ->capture_default_str();
  app.add_option("--pin", pin_seconds, "Seconds for which unused files are kept")->check(CLI::Range(1, 1 << 30))->capture_default_str();
  app.add_option("--test-hook", test_hook, "POINT@N: end as by SIGKILL the N-th time it passes a point that coordinator/failpoint.h names")
      ->group("For tests of fault handling only");
  app.add_option("--assemble", assemble_spec, "Merge the tiles that a specification lists, and end (used by the coordinator itself)")
      ->group("");
  try {
    app.parse(argc, argv);
    if (!test_hook.empty()) options.failpoint = kill_at(test_hook);
  } catch (const std::invalid_argument& error) {
    std::cerr << "woodcock-coordinator: " << error.what() << "\n";
    return 2;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (!assemble_spec.empty()) return assemble_main(assemble_spec);
  if (options.dir.empty()) {
    std::cerr << "woodcock-coordinator: --dir is required\n";
    return 2;
  }
  options.scheduler.lease = lease_seconds * kSecond;
  // A held call renews nothing: with short leases it must come back several times within one.
  options.busy_sync_hold = std::min(options.busy_sync_hold, options.scheduler.lease / 4);
  options.scheduler.grace = grace_seconds * kSecond;
  options.min_free_bytes = min_free_mib << 20;
  options.pin = pin_seconds * kSecond;
  options.scheduler.repin_after = repin_seconds * kSecond;
  options.now = boot_time;
  options.unix_ms = unix_time_ms;
  options.on_fatal = die;
  const std::string program = std::filesystem::read_symlink("/proc/self/exe");
  options.assemble_tiles = [program, temporary = options.dir + "/temporary",
                            failpoint = options.failpoint](const AssembleRequest& request) {
    return assemble_in_child(program, temporary, request, [&] { failpoint("during-merge"); });
  };
  try {
    return serve(options, listen);
  } catch (const std::exception& error) {
    std::cerr << "woodcock-coordinator: " << error.what() << "\n";
    return 1;
  }
}
