#include "rpc/child_program.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>

#include "rpc/file_descriptor.h"

namespace woodcock::rpc {
namespace {

constexpr int kFirstFree = 10;  ///< above every number that a child's descriptor may have
constexpr std::chrono::milliseconds kPoll{5};
/// Code 127: somebody else in this process has taken its status.
constexpr int kUnknownEnd = 127 << 8;

/// What the child needs, made before the fork: after it only async-signal-safe calls are allowed.
struct Prepared {
  const char* program = nullptr;
  const char* folder = nullptr;  ///< null: ours
  char* const* arguments = nullptr;
  char* const* environment = nullptr;
  std::vector<std::pair<int, int>> descriptors{};  ///< number in the child, ours
  int problem = -1;                                ///< gets errno when the program cannot be started
  pid_t parent = -1;
  bool own_group = false, no_blocked_signals = false;
};

[[noreturn]] void fail(int problem) {
  const int error = errno;
  // Nobody is there to tell when this fails.
  [[maybe_unused]] const ssize_t told = ::write(problem, &error, sizeof error);
  ::_exit(127);
}

[[noreturn]] void become(Prepared& prepared) {
  // The kernel ends the child with the thread that started it; one that lost it before is not started.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != prepared.parent) ::_exit(127);
  if (prepared.own_group) ::setpgid(0, 0);
  // Out of the way of the numbers that are assigned below.
  const int problem = ::fcntl(prepared.problem, F_DUPFD_CLOEXEC, kFirstFree);
  if (problem < 0) fail(prepared.problem);
  for (auto& [number, ours] : prepared.descriptors) {
    ours = ours < 0 ? ::open("/dev/null", O_RDONLY | O_CLOEXEC) : ::fcntl(ours, F_DUPFD_CLOEXEC, kFirstFree);
    if (ours < 0) fail(problem);
  }
  // Whatever a library has opened without a thought of children. Kernels before 5.11 do not know this call; what is ours is closed anyway.
  ::close_range(STDERR_FILENO + 1, ~0U, CLOSE_RANGE_CLOEXEC);
  for (const auto& [number, ours] : prepared.descriptors)
    if (::dup2(ours, number) < 0) fail(problem);
  if (prepared.folder != nullptr && ::chdir(prepared.folder) != 0) fail(problem);
  if (prepared.no_blocked_signals) {
    sigset_t none;
    ::sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
  }
  ::execve(prepared.program, prepared.arguments, prepared.environment);
  fail(problem);
}

}  // namespace

ChildProgram::ChildProgram(const ChildStart& start) {
  std::vector<std::string> words{start.name.empty() ? start.program : start.name};
  words.insert(words.end(), start.arguments.begin(), start.arguments.end());
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  char* nothing[] = {nullptr};

  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "cannot make a pipe for " + start.program);
  const FileDescriptor told(ends[0]);
  FileDescriptor problem(ends[1]);
  Prepared prepared;
  prepared.program = start.program.c_str();
  prepared.folder = start.folder.empty() ? nullptr : start.folder.c_str();
  prepared.arguments = arguments.data();
  prepared.environment = start.empty_environment ? nothing : environ;
  prepared.descriptors.assign(start.descriptors.begin(), start.descriptors.end());
  for (const auto& [number, ours] : prepared.descriptors)
    if (number < 0 || number >= kFirstFree || ours < 0) throw std::logic_error("a descriptor of a child has no number from 0 to 9");
  if (!start.descriptors.contains(STDIN_FILENO)) prepared.descriptors.emplace_back(STDIN_FILENO, -1);
  prepared.problem = problem.get();
  prepared.parent = ::getpid();
  prepared.own_group = start.own_group;
  prepared.no_blocked_signals = start.no_blocked_signals;

  pid_ = ::fork();
  if (pid_ == 0) become(prepared);
  if (pid_ < 0) throw std::system_error(errno, std::generic_category(), "cannot start " + start.program);
  // The other end closes when the program begins.
  problem.reset();
  int error = 0;
  ssize_t got = 0;
  while ((got = ::read(told.get(), &error, sizeof error)) < 0 && errno == EINTR) {
  }
  if (got != static_cast<ssize_t>(sizeof error)) return;
  wait();
  throw std::system_error(error, std::generic_category(), "cannot start " + start.program);
}

ChildProgram::ChildProgram(ChildProgram&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)), status_(std::exchange(other.status_, std::nullopt)) {}

ChildProgram& ChildProgram::operator=(ChildProgram&& other) noexcept {
  if (this != &other) {
    kill();
    pid_ = std::exchange(other.pid_, -1);
    status_ = std::exchange(other.status_, std::nullopt);
  }
  return *this;
}

std::optional<int> ChildProgram::status() { return wait_until(std::chrono::steady_clock::time_point::min()); }

std::optional<int> ChildProgram::wait_until(std::chrono::steady_clock::time_point deadline) {
  while (pid_ > 0) {
    int status = 0;
    const pid_t ended = ::waitpid(pid_, &status, WNOHANG);
    if (ended == pid_ || (ended < 0 && errno == ECHILD)) {
      status_ = ended == pid_ ? status : kUnknownEnd;
      pid_ = -1;
      break;
    }
    const auto now = std::chrono::steady_clock::now();
    if (now >= deadline) return std::nullopt;
    std::this_thread::sleep_for(std::min<std::chrono::steady_clock::duration>(kPoll, deadline - now));
  }
  return status_;
}

int ChildProgram::wait() {
  if (pid_ > 0) {
    int status = 0;
    pid_t ended = 0;
    while ((ended = ::waitpid(pid_, &status, 0)) < 0 && errno == EINTR) {
    }
    status_ = ended == pid_ ? status : kUnknownEnd;
    pid_ = -1;
  }
  if (!status_) throw std::logic_error("no program was started");
  return *status_;
}

void ChildProgram::signal(int number) const {
  if (pid_ > 0) ::kill(pid_, number);
}

std::optional<int> ChildProgram::kill() {
  if (pid_ <= 0) return status_;
  signal(SIGKILL);
  return wait();
}

}  // namespace woodcock::rpc
