#include "coordinator/merge_pool.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <utility>

#include "coordinator/merge_messages.h"

namespace woodcock::coordinator {

using Clock = std::chrono::steady_clock;

/// A merge server as the coordinator sees it.
class MergePool::Server {
 public:
  /// Throws std::runtime_error.
  explicit Server(const std::string& program) {
    int requests[2], replies[2];
    if (::pipe2(requests, O_CLOEXEC) != 0) fail("pipe", errno);
    if (::pipe2(replies, O_CLOEXEC) != 0) {
      const int error = errno;
      ::close(requests[0]);
      ::close(requests[1]);
      fail("pipe", error);
    }
    requests_ = requests[1];
    replies_ = replies[0];
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, requests[0], STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, replies[1], STDOUT_FILENO);
    std::string option = "--merge-server", parent = std::to_string(::getpid()), path = program;
    char* arguments[] = {path.data(), option.data(), parent.data(), nullptr};
    // It needs nothing of our environment.
    char* environment[] = {nullptr};
    const int error = ::posix_spawn(&pid_, program.c_str(), &actions, nullptr, arguments, environment);
    posix_spawn_file_actions_destroy(&actions);
    ::close(requests[0]);
    ::close(replies[1]);
    if (error == 0) return;
    ::close(requests_);
    ::close(replies_);
    fail("cannot start " + program, error);
  }
  ~Server() {
    ::close(requests_);
    ::close(replies_);
    ::kill(pid_, SIGKILL);
    while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Ends a merge that another thread waits for: with an error, there.
  void kill() const { ::kill(pid_, SIGKILL); }

  /// Whether it may be given another merge.
  bool usable() const { return usable_; }

  AssembleResult merge(const AssembleRequest& request, const std::function<void()>& started) {
    AssembleResult result;
    usable_ = false;
    try {
      send_message(requests_, text_of(request));
      started();
      std::optional<std::string> reply = receive_message(replies_, Clock::now() + kTimeLimit);
      if (!reply) throw std::runtime_error("the process that merges has ended");
      usable_ = true;
      if (reply->starts_with(kCrashed)) throw std::runtime_error(reply->substr(std::strlen(kCrashed)));
      result = result_from_text(*reply, request);
    } catch (const std::exception& error) {
      result = {};
      result.error = error.what();
    }
    return result;
  }

 private:
  [[noreturn]] static void fail(const std::string& what, int error) { throw std::runtime_error(what + ": " + std::strerror(error)); }

  pid_t pid_ = -1;
  int requests_ = -1, replies_ = -1;
  bool usable_ = true;
};

MergePool::MergePool(std::string program, int at_once, std::function<void()> started)
    : program_(std::move(program)), started_(std::move(started)), free_(at_once), starter_([this] { run(); }) {}

MergePool::~MergePool() {
  stop();
  starter_.join();
}

void MergePool::stop() {
  const std::lock_guard lock(mutex_);
  stopping_ = true;
  for (const Server* server : at_work_) server->kill();
  changed_.notify_all();
}

void MergePool::run() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    changed_.wait(lock, [&] { return stopping_ || wanted_ > 0; });
    if (stopping_) break;
    lock.unlock();
    std::unique_ptr<Server> server;
    std::string problem;
    try {
      server = std::make_unique<Server>(program_);
    } catch (const std::exception& error) {
      problem = error.what();
    }
    lock.lock();
    --wanted_;
    if (server)
      idle_.push_back(std::move(server));
    else
      problem_ = problem;
    changed_.notify_all();
  }
  // Those that are at work are with their callers, whom the owner has waited for.
  idle_.clear();
}

std::unique_ptr<MergePool::Server> MergePool::take() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return stopping_ || free_ > 0; });
  --free_;
  if (!stopping_ && idle_.empty()) {
    problem_.clear();
    ++wanted_;
    changed_.notify_all();
    changed_.wait(lock, [&] { return stopping_ || !idle_.empty() || !problem_.empty(); });
  }
  if (stopping_ || idle_.empty()) {
    ++free_;
    throw std::runtime_error(stopping_ ? "the coordinator is stopping" : problem_);
  }
  std::unique_ptr<Server> server = std::move(idle_.back());
  idle_.pop_back();
  at_work_.insert(server.get());
  return server;
}

void MergePool::give_back(std::unique_ptr<Server> server) {
  std::unique_ptr<Server> spent;  // goes when the lock is given back: it waits for the end of a process
  const std::lock_guard lock(mutex_);
  at_work_.erase(server.get());
  if (!server->usable()) spent = std::move(server);
  ++free_;
  if (server) idle_.push_back(std::move(server));
  changed_.notify_all();
}

AssembleResult MergePool::merge(const AssembleRequest& request) {
  std::unique_ptr<Server> server;
  try {
    server = take();
  } catch (const std::exception& error) {
    AssembleResult result;
    result.error = error.what();
    return result;
  }
  AssembleResult result = server->merge(request, started_);
  give_back(std::move(server));
  return result;
}

}  // namespace woodcock::coordinator
