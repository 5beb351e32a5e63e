// The streams of WatchJob.
#pragma once

#include <grpcpp/support/server_callback.h>

#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "coordinator/coordinator.h"

namespace woodcock::coordinator {

/// One thread looks after all streams, four times a second, so that any number may wait. A stream whose peer does not read is left
/// alone until it does.
class Watchers {
 public:
  explicit Watchers(Coordinator& coordinator);
  ~Watchers();
  Watchers(const Watchers&) = delete;
  Watchers& operator=(const Watchers&) = delete;

  /// Follows the job until it has ended or the caller goes. gRPC owns what is returned.
  grpc::ServerWriteReactor<v1::WatchJobResponse>* watch(const v1::WatchJobRequest& request);
  /// Ends all streams, and those that come, with UNAVAILABLE.
  void stop();

 private:
  class Stream;
  void run();
  void forget(const Stream* stream);

  Coordinator& coordinator_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::vector<std::shared_ptr<Stream>> streams_;  // guarded by mutex_
  bool stopping_ = false, news_ = false;          // guarded by mutex_
  std::thread thread_;
};

}  // namespace woodcock::coordinator
