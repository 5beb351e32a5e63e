#include "worker/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

namespace woodcock {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;
constexpr milliseconds kPollInterval{100};
constexpr int kChannelFd = 3;

/// Time without progress. Steps are capped: when this process itself was stopped or starved, the child is not
/// blamed for it.
class Silence {
 public:
  void reset() { total_ = milliseconds(0), last_ = steady_clock::now(); }
  milliseconds measure() {
    const auto now = steady_clock::now();
    total_ += std::min(std::chrono::duration_cast<milliseconds>(now - last_), 3 * kPollInterval);
    last_ = now;
    return total_;
  }

 private:
  milliseconds total_{0};
  steady_clock::time_point last_ = steady_clock::now();
};

milliseconds limit_of(const std::string& phase, const AttemptLimits& limits) {
  if (phase == "loading") return limits.loading;
  if (phase == "building") return limits.building;
  return limits.rendering;
}

bool is_preparation(const std::string& phase) { return phase == "loading" || phase == "building"; }

std::string last_lines(const std::string& tail) {
  const std::string shown = tail.substr(tail.size() - std::min<size_t>(tail.size(), 600));
  return shown.empty() ? "" : "; its last output: " + shown;
}

}  // namespace

ChildProcess::ChildProcess(const std::string& program, const std::vector<std::string>& arguments) {
  auto [ours, theirs] = MessageChannel::make_pair();
  int pipe_ends[2];
  if (::pipe2(pipe_ends, O_CLOEXEC) != 0)
    throw std::system_error(errno, std::generic_category(), "cannot make a pipe for the render child");
  rpc::FileDescriptor read_end(pipe_ends[0]), write_end(pipe_ends[1]);
  ::fcntl(read_end.get(), F_SETFL, O_NONBLOCK);

  rpc::ChildStart start{.program = program, .arguments = arguments};
  // What `ps` shows: the program's own name, also where it is started by way of /proc.
  std::error_code no_link;
  const std::filesystem::path shown = std::filesystem::read_symlink(program, no_link);
  if (!no_link) start.name = shown;
  start.arguments.insert(start.arguments.end(), {"--channel-fd", std::to_string(kChannelFd), "--parent-pid", std::to_string(::getpid())});
  start.descriptors = {{STDOUT_FILENO, write_end.get()}, {STDERR_FILENO, write_end.get()}, {kChannelFd, theirs.fd()}};
  start.no_blocked_signals = true;
  child_ = rpc::ChildProgram(start);
  channel_ = std::move(ours);
  output_ = std::move(read_end);
}

int ChildProcess::kill() {
  if (!alive()) return 0;
  const int status = child_.kill().value_or(0);
  channel_.close();
  return status;
}

void ChildProcess::drain_output(AttemptLog& log) {
  char buffer[16384];
  // At most the pipe's capacity: a child that prints without end must not keep us here.
  for (int i = 0; i < 4; ++i) {
    const ssize_t got = ::read(output_.get(), buffer, sizeof buffer);
    if (got <= 0) return;
    log.append({buffer, static_cast<size_t>(got)});
  }
}

void ChildProcess::wait_for_input(milliseconds timeout, AttemptLog& log) {
  pollfd inputs[2] = {{channel_.fd(), POLLIN, 0}, {output_.get(), POLLIN, 0}};
  ::poll(inputs, 2, static_cast<int>(timeout.count()));
  drain_output(log);
}

std::optional<ChildIdentity> ChildProcess::wait_until_ready(milliseconds timeout, AttemptLog& log) {
  const auto deadline = steady_clock::now() + timeout;
  while (steady_clock::now() < deadline) {
    wait_for_input(kPollInterval, log);
    nlohmann::json message;
    switch (channel_.receive(message)) {
      case MessageChannel::State::kMessage:
        if (message.value("type", "") == "hello")
          return ChildIdentity{message.value("render_build", ""), message.value("arithmetic_class", "")};
        break;
      case MessageChannel::State::kNothing:
        break;
      case MessageChannel::State::kClosed:
        drain_output(log);
        kill();
        return std::nullopt;
    }
  }
  kill();
  return std::nullopt;
}

AttemptFailure ChildProcess::describe_death(AttemptLog& log) {
  // The line closed; the process is gone or about to be. Give it a moment to leave its own status.
  const std::optional<int> ended = child_.wait_until(steady_clock::now() + std::chrono::seconds(1));
  const int status = ended ? *ended : kill();
  channel_.close();
  drain_output(log);
  const std::string output = last_lines(log.tail());
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL)
    return {FailureCause::kOutOfMemory, "the render process was killed from outside; the kernel does so when memory runs out" + output};
  if (WIFSIGNALED(status))
    return {FailureCause::kCrash, fmt::format("the render process crashed with {}{}", ::sigdescr_np(WTERMSIG(status)), output)};
  return {FailureCause::kCrash, fmt::format("the render process ended by itself with code {}{}", WEXITSTATUS(status), output)};
}

AttemptOutcome ChildProcess::run(const RenderCommand& command, const AttemptLimits& limits, AttemptLog& log,
                                 const std::function<bool()>& should_stop, const std::function<void(const ChildProgress&)>& on_progress) {
  if (!alive() || !channel_.send(to_json(command), std::chrono::seconds(5))) return alive() ? describe_death(log) : AttemptFailure{};
  ChildProgress last;
  Silence silence;
  std::optional<steady_clock::time_point> cancelled_at;
  while (true) {
    wait_for_input(kPollInterval, log);
    nlohmann::json message;
    MessageChannel::State state;
    // Everything that has arrived, before any time-out is judged.
    while ((state = channel_.receive(message)) == MessageChannel::State::kMessage) {
      if (message.value("attempt", uint64_t{0}) != command.attempt) continue;
      const std::string type = message.value("type", "");
      if (type != "progress") drain_output(log);
      try {
        if (type == "done") return rendered_tile_from(message);
        if (type == "failed") return AttemptFailure{failure_cause(message.at("cause")), message.at("reason")};
        if (type == "cancelled") return AttemptCancelled{};
        if (type == "progress") {
          ChildProgress now = child_progress_from(message);
          const bool moved = now != last;
          if (moved) silence.reset();
          last = now;
          // Loading and building show no progress of their own; their time-outs bound how long they are trusted.
          if (moved || is_preparation(last.phase)) on_progress(last);
        }
      } catch (const nlohmann::json::exception& error) {
        kill();
        return AttemptFailure{FailureCause::kCrash, std::string("the render process sent a message that cannot be read: ") + error.what()};
      }
    }
    if (state == MessageChannel::State::kClosed) return describe_death(log);
    if (!cancelled_at && should_stop()) {
      cancelled_at = steady_clock::now();
      channel_.send({{"type", "cancel"}, {"attempt", command.attempt}}, milliseconds(0));
    }
    if (cancelled_at && steady_clock::now() - *cancelled_at > limits.cancelling) {
      kill();
      return AttemptCancelled{};
    }
    if (const milliseconds limit = limit_of(last.phase, limits); silence.measure() > limit) {
      kill();
      drain_output(log);
      return AttemptFailure{FailureCause::kHang,
                            fmt::format("no progress for {:.1f} s while {}: the render process was killed{}",
                                        static_cast<double>(limit.count()) / 1000, last.phase, last_lines(log.tail()))};
    }
  }
}

}  // namespace woodcock
