// Runs a program and keeps what it said.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace woodcock::testing {

struct CommandResult {
  int exit_code = -1;  ///< 128 + signal where one ended it
  std::string out, err;
  double seconds = 0;
};

/// Runs `arguments` (the program first) in `folder` and waits at most `deadline`; a program that takes longer is killed
/// and the exit code says so. `while_running`, when given, is called once after the start with the process id.
template <typename WhileRunning>
CommandResult run_command(const std::vector<std::string>& arguments, const std::filesystem::path& folder, std::chrono::seconds deadline,
                          WhileRunning&& while_running) {
  int out[2], err[2];
  if (pipe2(out, O_CLOEXEC) != 0 || pipe2(err, O_CLOEXEC) != 0) return {};
  const auto start = std::chrono::steady_clock::now();
  const pid_t child = fork();
  if (child == 0) {
    dup2(out[1], STDOUT_FILENO);
    dup2(err[1], STDERR_FILENO);
    if (chdir(folder.c_str()) != 0) _exit(126);
    std::vector<char*> argv;
    for (const auto& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    execv(argv[0], argv.data());
    _exit(127);
  }
  close(out[1]);
  close(err[1]);
  while_running(child);
  CommandResult result;
  pollfd fds[2] = {{out[0], POLLIN, 0}, {err[0], POLLIN, 0}};
  int open_pipes = 2;
  bool killed = false;
  while (open_pipes > 0) {
    poll(fds, 2, 100);
    if (!killed && std::chrono::steady_clock::now() - start > deadline) {
      kill(child, SIGKILL);
      killed = true;
    }
    for (int i = 0; i < 2; ++i) {
      if ((fds[i].revents & (POLLIN | POLLHUP)) == 0) continue;
      char buffer[4096];
      const ssize_t n = read(fds[i].fd, buffer, sizeof buffer);
      if (n > 0) {
        (i == 0 ? result.out : result.err).append(buffer, static_cast<size_t>(n));
      } else {
        close(fds[i].fd);
        fds[i].fd = -1;
        --open_pipes;
      }
    }
  }
  int status = 0;
  waitpid(child, &status, 0);
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

/// Waits until a process has used this much time of a processor: it works, however busy the machine is. False after a minute, or
/// when the process has ended.
inline bool wait_for_cpu_seconds(pid_t process, double seconds) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (std::chrono::steady_clock::now() < deadline) {
    std::ifstream stat("/proc/" + std::to_string(process) + "/stat");
    std::string line;
    if (!std::getline(stat, line)) return false;
    // After the name, which ends with the last bracket: the state, ten numbers, then time as user and as system.
    std::istringstream words(line.substr(line.rfind(')') + 1));
    std::string word;
    double ticks = 0;
    for (int i = 0; i < 13 && words >> word; ++i) {
      if (i == 0 && word == "Z") return false;
      if (i >= 11) ticks += std::stod(word);
    }
    if (ticks >= seconds * static_cast<double>(sysconf(_SC_CLK_TCK))) return true;
    usleep(5000);
  }
  return false;
}

inline CommandResult run_command(const std::vector<std::string>& arguments, const std::filesystem::path& folder = ".",
                                 std::chrono::seconds deadline = std::chrono::seconds(120)) {
  return run_command(arguments, folder, deadline, [](pid_t) {});
}

}  // namespace woodcock::testing
