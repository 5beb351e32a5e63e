// Merges in processes of their own, several at once, at the price of a fork.
//
// Starting this program costs a third of a second of processor time: three hundred libraries are linked. So it is started once for each
// merge that runs at a time, as a *merge server* that does nothing but fork: each merge runs in a fresh copy of it, which has read
// nothing before and ends afterwards. A file that corrupts one merge cannot reach another.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "coordinator/assembler.h"

namespace woodcock::coordinator {

/// Safe to call from any thread.
class MergePool {
 public:
  /// `program --merge-server PID` is run: `merge_server_main`. `started` is called when a merge has begun.
  MergePool(
      std::string program, int at_once, std::function<void()> started = [] {});
  /// Kills what still runs.
  ~MergePool();

  /// Waits for its turn, then merges, with bounded memory and time. A merge that crashes or takes too long is an error of the result.
  AssembleResult merge(const AssembleRequest& request);

  /// Kills what runs, and refuses more: those who wait get an error.
  void stop();

  /// A frame of 16k × 16k pixels merges in minutes.
  static constexpr std::chrono::minutes kTimeLimit{60};

 private:
  class Server;
  std::unique_ptr<Server> take();
  void give_back(std::unique_ptr<Server> server);
  void run();

  const std::string program_;
  const std::function<void()> started_;
  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_:
  std::vector<std::unique_ptr<Server>> idle_;
  std::set<Server*> at_work_;  // owned by those who called merge()
  int free_;                   // merges that may begin
  int wanted_ = 0;             // servers that someone waits for
  std::string problem_;
  bool stopping_ = false;
  // A process gets SIGKILL when the thread that started it ends: this one ends with the pool.
  std::thread starter_;
};

/// The main function of a merge server, which ends with `parent`. Returns the exit code.
int merge_server_main(pid_t parent);

}  // namespace woodcock::coordinator
