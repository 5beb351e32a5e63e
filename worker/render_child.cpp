#include "worker/render_child.h"

#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <mutex>
#include <new>
#include <thread>

#include "worker/message_channel.h"

namespace woodcock {
namespace {

using std::chrono::milliseconds;
constexpr milliseconds kProgressInterval{100};
constexpr milliseconds kReportTimeout{30000};  // the supervisor may be stopped for a while

/// Makes this process end with its parent, and be the first to go when memory runs out.
void tie_to_parent(int parent_pid) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (parent_pid != 0 && ::getppid() != parent_pid) ::_exit(0);  // the parent died before prctl took effect
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  std::ofstream("/proc/self/oom_score_adj") << 900;
}

/// The child's two threads: this object's owner renders, `listener_` reads commands and reports progress.
class RenderChild {
 public:
  RenderChild(const RenderChildOptions& options, TaskRenderer& renderer)
      : renderer_(renderer), hook_(options.test_hook), channel_(rpc::FileDescriptor(options.channel_fd)) {}

  int run() {
    report({{"type", "hello"}, {"render_build", renderer_.render_build()}, {"arithmetic_class", renderer_.arithmetic_class()}});
    // The listener ends the process when the line closes, so it is never joined.
    std::thread([this] { listen(); }).detach();
    while (true) {
      std::unique_lock lock(mutex_);
      command_arrived_.wait(lock, [this] { return command_.has_value(); });
      const RenderCommand command = *command_;
      lock.unlock();
      nlohmann::json outcome = carry_out(command);
      outcome["attempt"] = command.attempt;
      lock.lock();
      command_.reset();
      report(outcome);
    }
  }

 private:
  void report(const nlohmann::json& message) {
    const std::lock_guard lock(send_mutex_);
    if (!channel_.send(message, kReportTimeout)) ::_exit(1);  // nobody is left to render for
  }

  nlohmann::json carry_out(const RenderCommand& command) {
    const auto failed = [](FailureCause cause, const std::string& reason) {
      return nlohmann::json{{"type", "failed"}, {"cause", to_string(cause)}, {"reason", reason}};
    };
    try {
      inject_fault();
      const auto tile = renderer_.render(command);
      if (!tile) return {{"type", "cancelled"}};
      nlohmann::json outcome = to_json(*tile);
      outcome["type"] = "done";
      return outcome;
    } catch (const std::bad_alloc&) {
      return failed(FailureCause::kOutOfMemory, "out of memory while rendering");
    } catch (const TaskFailure& failure) {
      return failed(failure.cause(), failure.what());
    } catch (const std::exception& error) {
      return failed(FailureCause::kScene, error.what());
    }
  }

  void inject_fault() {
    ++tasks_;
    if (!hook_ || (hook_->task != 0 && hook_->task != tasks_)) return;
    std::fprintf(stderr, "test hook: %s at task %d\n", hook_->fault.c_str(), tasks_);
    if (hook_->fault == "crash") std::abort();
    if (hook_->fault == "exit") std::_Exit(7);
    if (hook_->fault == "memory") throw std::bad_alloc();
    if (hook_->fault == "nan") throw TaskFailure(FailureCause::kNonFinite, "test hook: every sample is not finite");
    while (hook_->fault == "hang") std::this_thread::sleep_for(std::chrono::hours(1));
  }

  void listen() {
    auto next_progress = std::chrono::steady_clock::now();
    while (true) {
      pollfd wait{channel_.fd(), POLLIN, 0};
      ::poll(&wait, 1, static_cast<int>(kProgressInterval.count()));
      nlohmann::json message;
      const auto state = channel_.receive(message);
      if (state == MessageChannel::State::kClosed) ::_exit(0);
      if (state == MessageChannel::State::kMessage) obey(message);
      const auto now = std::chrono::steady_clock::now();
      if (now < next_progress) continue;
      next_progress = now + kProgressInterval;
      report_progress();
    }
  }

  void obey(const nlohmann::json& message) {
    const std::string type = message.value("type", "");
    const std::lock_guard lock(mutex_);
    if (type == "render" && !command_) {
      renderer_.begin();
      command_ = render_command_from(message);
      command_arrived_.notify_one();
    } else if (type == "cancel" && command_ && command_->attempt == message.value("attempt", uint64_t{0})) {
      renderer_.cancel();
    }
  }

  void report_progress() {
    const std::lock_guard lock(mutex_);
    if (!command_) return;
    nlohmann::json message = to_json(renderer_.progress());
    message["type"] = "progress";
    message["attempt"] = command_->attempt;
    const std::lock_guard send_lock(send_mutex_);
    // Progress that the supervisor has no room for is dropped: the next report says more.
    channel_.send(message, milliseconds(0));
  }

  TaskRenderer& renderer_;
  const std::optional<TestHook> hook_;
  int tasks_ = 0;  // only the rendering thread

  MessageChannel channel_;
  std::mutex send_mutex_;  // guards sending on channel_; taken after mutex_
  std::mutex mutex_;       // guards command_
  std::condition_variable command_arrived_;
  std::optional<RenderCommand> command_;  // set while a task is being carried out
};

}  // namespace

TestHook TestHook::parse(const std::string& text) {
  const size_t at = text.find('@');
  TestHook hook;
  hook.fault = text.substr(0, at);
  const bool known = hook.fault == "crash" || hook.fault == "hang" || hook.fault == "memory" || hook.fault == "nan" || hook.fault == "exit";
  const std::string task = at == std::string::npos ? "" : text.substr(at + 1);
  const bool number = !task.empty() && task.size() < 7 && task.find_first_not_of("0123456789") == std::string::npos;
  if (!known || (!number && task != "*"))
    throw std::invalid_argument("test hook '" + text + "' is not crash@N, hang@N, memory@N, nan@N or exit@N");
  hook.task = task == "*" ? 0 : std::stoi(task);
  return hook;
}

int run_render_child(const RenderChildOptions& options, TaskRenderer& renderer) {
  tie_to_parent(options.parent_pid);
  std::signal(SIGPIPE, SIG_IGN);
  // Ctrl-C reaches the whole process group and systemd signals the whole unit; the supervisor decides what
  // that means for the task.
  std::signal(SIGINT, SIG_IGN);
  std::signal(SIGTERM, SIG_IGN);
  return RenderChild(options, renderer).run();
}

}  // namespace woodcock
