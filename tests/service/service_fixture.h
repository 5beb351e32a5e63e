// Runs the real programs in a temporary folder: a coordinator on a free port, workers, the client.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace woodcock::testing_service {

/// A running program, of WOODCOCK_BIN_DIR unless its name is a whole path. It is killed with this object, and with the test.
class Program {
 public:
  Program(const std::string& name, const std::vector<std::string>& arguments, const std::filesystem::path& log,
          const std::map<std::string, std::string>& environment = {});
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  pid_t pid() const { return pid_; }
  void signal(int number) const;
  /// Exit code, or 128 + signal; nullopt when it still runs after `timeout`.
  std::optional<int> wait(std::chrono::milliseconds timeout);
  bool running() { return !wait(std::chrono::milliseconds(0)).has_value(); }
  std::string out() const;
  std::string err() const;

 private:
  std::filesystem::path log_;
  pid_t pid_ = -1;
  std::optional<int> code_;
};

/// How a program that ended did so.
struct Ended {
  int code = -1;
  std::string out, err;
  double seconds = 0;
};

/// The bytes of a file, and of a picture's nodes beside it.
std::string contents(const std::filesystem::path& path);
/// Polls until `condition`; false after `timeout`.
bool eventually(std::chrono::milliseconds timeout, const std::function<bool()>& condition);

class ServiceTest : public ::testing::Test {
 protected:
  static constexpr std::chrono::seconds kPatience{150};  ///< the machine may be busy; nothing here should take ten seconds

  ~ServiceTest() override;

  /// Leases are short, so that faults are noticed within seconds. Port 0 takes a free one.
  void start_coordinator(int lease_seconds = 3, int port = 0, const std::vector<std::string>& more = {},
                         const std::map<std::string, std::string>& environment = {});
  /// Kills the coordinator and starts it again on the same folder and port.
  void kill_coordinator();
  void restart_coordinator(int lease_seconds = 3);
  Program& start_worker(const std::vector<std::string>& more = {});

  /// Runs `woodcock` to its end.
  Ended woodcock(const std::vector<std::string>& arguments, std::chrono::milliseconds timeout = kPatience);
  /// Starts `woodcock` and returns.
  std::unique_ptr<Program> woodcock_in_background(const std::vector<std::string>& arguments);
  /// A submit that returns at once; the job's id.
  std::string submit(const std::vector<std::string>& arguments);
  nlohmann::json show(const std::string& job);
  /// Waits until the job has begun to commit tasks and has not ended.
  void wait_until_mid_job(const std::string& job);
  /// Waits until each worker has found the coordinator gone.
  void wait_until_workers_miss_the_coordinator();
  /// Nothing unfinished lies in the coordinator's folder.
  void expect_no_leftovers() const;
  /// Watches the job to its end; the exit code.
  int watch(const std::string& job);

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  /// What `woodcock render` makes of the same arguments.
  std::string rendered(const std::vector<std::string>& arguments);

  testing::TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  std::string address_;
  std::unique_ptr<Program> coordinator_;
  std::vector<std::unique_ptr<Program>> workers_;

 private:
  int runs_ = 0;
};

}  // namespace woodcock::testing_service
