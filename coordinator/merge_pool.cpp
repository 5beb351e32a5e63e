#include "coordinator/merge_pool.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "coordinator/merge_messages.h"
#include "rpc/child_program.h"
#include "rpc/file_descriptor.h"

namespace woodcock::coordinator {

using Clock = std::chrono::steady_clock;

/// A merge server as the coordinator sees it.
class MergePool::Server {
 public:
  /// Throws std::runtime_error.
  explicit Server(const std::string& program) {
    int requests[2], replies[2];
    if (::pipe2(requests, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
    const rpc::FileDescriptor its_requests(requests[0]);
    requests_.reset(requests[1]);
    if (::pipe2(replies, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
    const rpc::FileDescriptor its_replies(replies[1]);
    replies_.reset(replies[0]);
    rpc::ChildStart start{.program = program, .arguments = {"--merge-server", std::to_string(::getpid())}};
    start.descriptors = {{STDIN_FILENO, its_requests.get()}, {STDOUT_FILENO, its_replies.get()}};
    start.empty_environment = true;
    child_ = rpc::ChildProgram(start);
  }
  /// Ends a merge that another thread waits for: with an error, there.
  void kill() const { child_.signal(SIGKILL); }

  /// Whether it may be given another merge.
  bool usable() const { return usable_; }

  AssembleResult merge(const AssembleRequest& request, const std::function<void()>& started) {
    AssembleResult result;
    usable_ = false;
    try {
      send_message(requests_.get(), text_of(request));
      started();
      std::optional<std::string> reply = receive_message(replies_.get(), Clock::now() + kTimeLimit);
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
  rpc::FileDescriptor requests_, replies_;
  rpc::ChildProgram child_;
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
