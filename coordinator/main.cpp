// woodcock-coordinator: splits frames into tasks, leases them, merges the results.
#include <signal.h>
#include <unistd.h>

#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <thread>

#include "coordinator/merge_pool.h"
#include "coordinator/server.h"
#include "rpc/address.h"
#include "rpc/channel.h"
#include "rpc/failure.h"
#include "rpc/log.h"
#include "rpc/printable.h"
#include "rpc/standard_output.h"

namespace {

using namespace woodcock;
using namespace woodcock::coordinator;

constexpr int kPreviewsAtOnce = 2;

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

int serve(CoordinatorOptions options, const std::string& listen, const std::string& program) {
  // Blocked before any thread is made, so that all inherit it and sigwait below gets the signal.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  ::signal(SIGPIPE, SIG_IGN);

  spdlog::info("at most {} open files", raise_descriptor_limit());
  std::filesystem::create_directories(options.dir);
  // Previews are merged beside the frames.
  MergePool pool(program, options.merges_at_once + kPreviewsAtOnce, [&options] {
    options.failpoint("during-merge"); /* the child that merges was started */
  });
  options.assemble_tiles = [&pool](const AssembleRequest& request) { return pool.merge(request); };
  Coordinator coordinator(options);
  CoordinatorServer server(coordinator, listen);
  write_address(options.dir, server.address());
  std::cout << "listening on " << server.address() << std::endl;
  // Who starts it may read the address there; the farm goes on without.
  if (const auto error = rpc::failure_of(rpc::flush_standard_output))
    spdlog::error("{}; the address is in {}/address", *error, options.dir);
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
  rpc::start_log("coordinator", "%Y-%m-%dT%H:%M:%S.%e%z %l %v");
  spdlog::flush_on(spdlog::level::info);

  CLI::App app("Splits frames into tasks, leases them to workers, merges the results.");
  CoordinatorOptions options;
  options.merges_at_once = static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 2u, 8u));
  std::string listen = rpc::kDefaultAddress, test_hook;
  pid_t merge_server_parent = 0;
  bool no_scene_reader = false;
  int64_t lease_seconds = 30, grace_seconds = 10, min_free_mib = 64, pin_seconds = 3600, repin_seconds = 0;
  app.add_option("--dir", options.dir, "Folder of the database and the blobs");
  app.add_option("--listen", listen, "HOST:PORT; port 0 takes any free one. Not encrypted: keep to loopback or a private network")
      ->check(rpc::problem_of_listen_address)
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
  app.add_option("--test-hook", test_hook, "POINT@N: end as by SIGKILL the N-th time it passes a point; a wrong one lists them")
      ->group("For tests of fault handling only");
  app.add_option("--merges", options.merges_at_once, "Frames that are merged at once, each in a process of its own")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_flag("--no-scene-reader", no_scene_reader, "Read no scenes for programs that cannot do so themselves: SubmitScene is refused");
  app.add_option("--merge-server", merge_server_parent, "Merge for the coordinator that is this process (used by the coordinator itself)")
      ->group("");
  try {
    app.parse(argc, argv);
    if (!test_hook.empty()) options.failpoint = kill_at(test_hook);
  } catch (const std::invalid_argument& error) {
    std::cerr << "woodcock-coordinator: " << error.what() << "\n";
    return 2;
  } catch (const CLI::ParseError& error) {
    return rpc::exit_code_with_output(app.exit(error) == 0 ? 0 : 2, "woodcock-coordinator");
  }
  if (merge_server_parent > 0) return merge_server_main(merge_server_parent);
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
  if (!no_scene_reader) options.scene_reader = std::filesystem::path(program).replace_filename("woodcock");
  try {
    return rpc::exit_code_with_output(serve(options, listen, program), "woodcock-coordinator");
  } catch (const std::exception& error) {
    std::cerr << "woodcock-coordinator: " << rpc::printable_lines(error.what()) << "\n";
    return 1;
  }
}
