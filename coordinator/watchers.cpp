#include "coordinator/watchers.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "rpc/error.h"
#include "rpc/status.h"

namespace woodcock::coordinator {
namespace {

constexpr std::chrono::milliseconds kInterval{250};
constexpr int kFullAnswer = 1000;

grpc::Status stopping() { return {grpc::StatusCode::UNAVAILABLE, "the coordinator is stopping; watch again from the last event"}; }

}  // namespace

/// One write is in flight at most, and nothing is begun after the end. The flags decide under the mutex; gRPC is called without it,
/// since it may call back at once.
class Watchers::Stream final : public grpc::ServerWriteReactor<v1::WatchJobResponse> {
 public:
  Stream(Watchers& owner, const v1::WatchJobRequest& request) : owner_(owner), job_(request.job_id()), cursor_(request.after_event()) {}

  /// Sends what is new. True when there is more at once. For the one thread.
  bool look(Coordinator& coordinator) {
    {
      const std::lock_guard lock(mutex_);
      if (writing_ || ended_ || end_) return false;
    }
    bool finished = false;
    v1::WatchJobResponse response;
    try {
      response = coordinator.watch(job_, cursor_, finished);
    } catch (...) {
      end(rpc::status_of_current_exception());
      return false;
    }
    if (!response.events().empty()) cursor_ = response.events().rbegin()->number();
    std::string progress = response.job().progress().SerializeAsString() + response.job().state_reason();
    const bool news = !response.events().empty() || progress != last_ || finished;
    last_ = std::move(progress);
    if (!news) return false;
    const bool more = response.events_size() >= kFullAnswer;
    {
      const std::lock_guard lock(mutex_);
      if (ended_) return false;
      response_ = std::move(response);
      writing_ = true;
      ended_ = finished;
    }
    if (finished)
      StartWriteAndFinish(&response_, grpc::WriteOptions(), grpc::Status::OK);
    else
      StartWrite(&response_);
    return more;
  }

  /// At once, or when the write in flight is over.
  void end(const grpc::Status& status) {
    {
      const std::lock_guard lock(mutex_);
      if (ended_) return;
      if (writing_) {
        end_ = status;
        return;
      }
      ended_ = true;
    }
    Finish(status);
  }

  void OnWriteDone(bool ok) override {
    std::optional<grpc::Status> status;
    {
      const std::lock_guard lock(mutex_);
      writing_ = false;
      if (ended_) return;
      if (!ok) end_ = grpc::Status::CANCELLED;
      status = end_;
      ended_ = status.has_value();
    }
    if (status) Finish(*status);
  }
  void OnCancel() override { end(grpc::Status::CANCELLED); }
  void OnDone() override { owner_.forget(this); }

 private:
  Watchers& owner_;
  const std::string job_;
  int64_t cursor_;    // of the one thread
  std::string last_;  // of the one thread
  std::mutex mutex_;
  v1::WatchJobResponse response_;    // gRPC's while writing_
  bool writing_ = false;             // guarded by mutex_
  bool ended_ = false;               // guarded by mutex_: Finish was called, or is about to be
  std::optional<grpc::Status> end_;  // guarded by mutex_: Finish with this after the write
};

Watchers::Watchers(Coordinator& coordinator) : coordinator_(coordinator) {
  thread_ = std::thread([this] { run(); });
}

Watchers::~Watchers() {
  stop();
  thread_.join();
}

grpc::ServerWriteReactor<v1::WatchJobResponse>* Watchers::watch(const v1::WatchJobRequest& request) {
  const auto stream = std::make_shared<Stream>(*this, request);
  bool late = false;
  {
    const std::lock_guard lock(mutex_);
    streams_.push_back(stream);
    news_ = true;
    late = stopping_;
  }
  if (late) stream->end(stopping());
  wake_.notify_one();
  return stream.get();
}

void Watchers::stop() {
  std::vector<std::shared_ptr<Stream>> streams;
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    streams = streams_;
  }
  for (const auto& stream : streams) stream->end(stopping());
  wake_.notify_one();
}

void Watchers::forget(const Stream* stream) {
  std::shared_ptr<Stream> last;
  const std::lock_guard lock(mutex_);
  const auto it = std::find_if(streams_.begin(), streams_.end(), [&](const auto& s) { return s.get() == stream; });
  if (it == streams_.end()) return;
  last = std::move(*it);
  streams_.erase(it);
}

void Watchers::run() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    const std::vector<std::shared_ptr<Stream>> streams = streams_;
    news_ = false;
    lock.unlock();
    bool more = false;
    for (const auto& stream : streams) more = stream->look(coordinator_) || more;
    lock.lock();
    if (!more) wake_.wait_for(lock, kInterval, [this] { return stopping_ || news_; });
  }
}

}  // namespace woodcock::coordinator
