// woodcock-coordinator: splits frames into tasks, leases them, merges the results.
#include <signal.h>
#include <unistd.h>

#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <optional>
#include <thread>

#include "coordinator/control.h"
#include "coordinator/merge_pool.h"
#include "coordinator/server.h"
#include "rpc/address.h"
#include "rpc/channel.h"
#include "rpc/failure.h"
#include "rpc/log.h"
#include "rpc/printable.h"
#include "rpc/quantities.h"
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

/// Throws CLI::ValidationError.
RunQueue::Shares parse_shares(const std::vector<std::string>& texts) {
  RunQueue::Shares shares;
  for (const std::string& text : texts) {
    const size_t equals = text.rfind('=');
    double share = 0;
    const char* const end = text.data() + text.size();
    const auto [read, error] = equals == std::string::npos ? std::from_chars_result{end, std::errc::invalid_argument}
                                                           : std::from_chars(text.data() + equals + 1, end, share);
    if (error != std::errc() || read != end || !(share >= 0.01 && share <= 100) || equals == 0)
      throw CLI::ValidationError("--share", "found \"" + rpc::printable(text) + "\", expected USER=N with N from 0.01 to 100");
    shares[text.substr(0, equals)] = share;
  }
  return shares;
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
  std::optional<ControlSocket> control;
  const auto listen_locally = [&] { control.emplace(options.dir, [&](const std::string& target) { return coordinator.back_up(target); }); };
  if (const auto error = rpc::failure_of(listen_locally)) spdlog::error("no back-up can be made while this coordinator runs: {}", *error);
  write_address(options.dir, server.address());
  std::cout << "listening on " << server.address() << std::endl;
  // Who starts it may read the address there; the farm goes on without.
  if (const auto error = rpc::failure_of(rpc::flush_standard_output))
    spdlog::error("{}; the address is in {}/address", *error, options.dir);
  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("stopping on signal {}; a second one ends at once", signal);
  std::thread([signals] {
    int second = 0;
    sigwait(&signals, &second);
    // As after a crash: what was acknowledged is durable.
    spdlog::warn("ending at once on signal {}", second);
    spdlog::shutdown();
    ::_exit(0);
  }).detach();
  // Merges are begun again at the next start; nobody waits for them here.
  coordinator.stop_syncs();
  pool.stop();
  server.stop();
  control.reset();
  std::error_code ignored;
  std::filesystem::remove(options.dir + "/address", ignored);
  return 0;
}

/// What a back-up, or a restored folder, has.
void describe(const std::string& what, const BackupRecord& record) {
  std::cout << what << ": " << record.blobs << " files, " << rpc::bytes_text(record.bytes) << ", of which " << record.linked
            << " are hard links and take no room of their own" << std::endl;
  if (record.unreadable > 0)
    std::cerr << "woodcock-coordinator: " << record.unreadable
              << " files could not be read and are not in it: what they held is rendered again, or asked for again\n";
}

struct BackupArguments {
  std::string dir, folder;
};

/// Adds a command that takes a folder of a coordinator and one of a back-up.
CLI::App* add_backup_command(CLI::App& app, const std::string& name, const std::string& what, const std::string& folder,
                             const std::string& dir, BackupArguments& arguments) {
  CLI::App* command = app.add_subcommand(name, what);
  command->add_option("folder", arguments.folder, folder)->required();
  command->add_option("--dir", arguments.dir, dir)->required();
  return command;
}

int back_up(const BackupArguments& arguments) {
  // The coordinator that makes it has another current folder.
  const std::string target = std::filesystem::absolute(arguments.folder);
  const std::optional<BackupRecord> record = ask_for_backup(arguments.dir, target);
  describe("back-up " + rpc::printable(target), record ? *record : back_up_stopped(arguments.dir, target, unix_time_ms()));
  return 0;
}

int restore(const BackupArguments& arguments) {
  describe("restored " + rpc::printable(arguments.dir), restore_backup(arguments.folder, arguments.dir));
  std::cout << "start it with woodcock-coordinator --dir " << rpc::printable(arguments.dir) << std::endl;
  return 0;
}

int report_failure(const std::exception& error) {
  std::cerr << "woodcock-coordinator: " << rpc::printable_lines(error.what()) << "\n";
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  rpc::start_log("coordinator", "%Y-%m-%dT%H:%M:%S.%e%z %l %v");
  spdlog::flush_on(spdlog::level::info);

  CLI::App app("Splits frames into tasks, leases them to workers, merges the results.", "woodcock-coordinator");
  app.set_version_flag("--version", "woodcock-coordinator " WOODCOCK_VERSION);
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
  std::optional<std::string> keep_jobs, keep_bytes;
  std::string forget_workers = "24h";
  app.add_option(
      "--keep-jobs", keep_jobs,
      "How long jobs that have ended are kept, e.g. 90d, 12h; without it until somebody deletes them. `woodcock retain --dry-run` "
      "lists what would go");
  app.add_option("--keep-bytes", keep_bytes,
                 "Bytes of results, images and scenes from which on the jobs go that ended first, e.g. 500G; without it any number");
  app.add_option("--forget-workers", forget_workers, "After how long nothing is remembered of a worker that left, e.g. 24h")
      ->capture_default_str();
  BackupArguments to_back_up, to_restore;
  const auto* backup_command =
      add_backup_command(app, "backup", "Write database and files of a coordinator, which may run, to a new folder",
                         "The folder to make; it must not exist", "Folder of the coordinator", to_back_up);
  const auto* restore_command = add_backup_command(app, "restore", "Make a coordinator's folder of a back-up, which stays as it is",
                                                   "Folder of the back-up", "The folder to make; it must not exist", to_restore);
  app.add_option("--test-hook", test_hook, "POINT@N: end as by SIGKILL the N-th time it passes a point; a wrong one lists them")
      ->group("For tests of fault handling only");
  app.add_option("--merges", options.merges_at_once, "Frames that are merged at once, each in a process of its own")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_option_function<std::vector<std::string>>(
         "--share", [&options](const std::vector<std::string>& shares) { options.scheduler.shares = parse_shares(shares); },
         "USER=N: how much of the workers this user is to have beside others, who have 1 each; may be given again")
      ->allow_extra_args(false);
  app.add_flag("--no-scene-reader", no_scene_reader, "Read no scenes for programs that cannot do so themselves: SubmitScene is refused");
  app.add_option("--merge-server", merge_server_parent, "Merge for the coordinator that is this process (used by the coordinator itself)")
      ->group("");
  try {
    app.parse(argc, argv);
    if (!test_hook.empty()) options.failpoint = kill_at(test_hook);
    if (keep_jobs) options.retention.keep_seconds = rpc::parse_seconds("--keep-jobs", *keep_jobs);
    if (keep_bytes) options.retention.keep_bytes = rpc::parse_bytes("--keep-bytes", *keep_bytes);
    const int64_t forget_seconds = std::min<int64_t>(rpc::parse_seconds("--forget-workers", forget_workers), 100LL * 365 * 86400);
    // Shorter than a worker is waited for it would be forgotten while it is connected.
    if (forget_seconds < 120) throw std::invalid_argument("--forget-workers: expected 2min or more, found \"" + forget_workers + "\"");
    options.scheduler.forget_worker = forget_seconds * kSecond;
  } catch (const std::invalid_argument& error) {
    std::cerr << "woodcock-coordinator: " << error.what() << "\n";
    return 2;
  } catch (const CLI::ParseError& error) {
    return rpc::exit_code_with_output(app.exit(error) == 0 ? 0 : 2, "woodcock-coordinator");
  }
  try {
    if (backup_command->parsed()) return rpc::exit_code_with_output(back_up(to_back_up), "woodcock-coordinator");
    if (restore_command->parsed()) return rpc::exit_code_with_output(restore(to_restore), "woodcock-coordinator");
  } catch (const std::exception& error) {
    return report_failure(error);
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
    return report_failure(error);
  }
}
