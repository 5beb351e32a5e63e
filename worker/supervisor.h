// The worker's threads: one that syncs, one that fetches scenes, one that uploads results, and one for each slot with
// its render child. What they share is the lease book.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "woodcock/v1/blobs_service.grpc.pb.h"
#include "woodcock/v1/workers_service.grpc.pb.h"
#include "worker/leader_seen.h"
#include "worker/lease_book.h"
#include "worker/scene_store.h"
#include "worker/spool.h"
#include "worker/worker_folder.h"

namespace woodcock {

struct SupervisorOptions {
  std::vector<std::string> coordinators;  ///< "HOST:PORT", at least one; tried in turn
  std::string worker_id;                  ///< empty: the folder's own
  int slots = 1;                          ///< tasks rendered at once
  int threads = 1;                        ///< of each task
  std::vector<std::string> tags;          ///< that jobs may ask for
  int64_t memory = 0;                     ///< bytes, for all slots together; 0: not known
  uint64_t asset_cache_bytes = uint64_t{20} << 30;
  AttemptLimits limits;
  std::chrono::milliseconds drain{std::chrono::seconds(20)};  ///< for finishing what runs, after the first SIGTERM
  std::string child_program = "/proc/self/exe";
  std::vector<std::string> child_arguments{"--render-child"};
};

class Supervisor {
 public:
  /// Throws std::filesystem::filesystem_error when the folder cannot be used. `folder` must outlive this object.
  Supervisor(SupervisorOptions options, const WorkerFolder& folder);
  ~Supervisor();

  /// Works until it is drained, told to quit, or refused by the coordinator. Returns the process's exit code.
  int run();

  /// These may be called from any thread but no signal handler. drain() finishes what runs, gives back the rest, says that it leaves,
  /// then ends; quit() ends at once: finished results stay in the spool.
  void drain();
  void quit();

 private:
  void sync_loop();
  void fetch_loop();
  void upload_loop();
  void slot_loop(int slot);
  /// Runs one of these until the end: an exception is said in the log and ends what the thread was at, not the process.
  void keep_running(const std::string& name, const std::function<void()>& loop);

  struct Call;
  v1::SyncRequest make_request();
  /// Makes the call and waits for its end; ends it early when there is news. Called and returns with `lock` held.
  void carry_out(Call& call, std::unique_lock<std::mutex>& lock);
  void await(Call& call, std::unique_lock<std::mutex>& lock);
  /// Acts on the answer; returns how long to wait before the next call.
  std::chrono::milliseconds take_answer(const Call& call);
  std::chrono::milliseconds back_off();
  /// Who answered: false where the answer is to be left aside.
  bool recognize(const v1::SyncResponse& response);
  std::optional<std::chrono::milliseconds> renewal_interval() const;
  void check_deadlines();
  v1::WorkerState state() const;
  /// Nothing is left to do: one call more says so, unless nobody would hear it.
  void leave(const std::string& why);
  void end(int exit_code, const std::string& why);
  /// Until the end, or the time-out.
  void pause(std::unique_lock<std::mutex>& lock, std::chrono::milliseconds timeout);

  bool start_child(int slot, std::unique_ptr<ChildProcess>& child);
  void render(int slot, ChildProcess& child, const v1::LeaseGrant& grant);
  AttemptOutcome attempt(ChildProcess& child, const v1::LeaseGrant& grant, AttemptLog& log);
  bool fetch(const v1::LeaseGrant& grant);
  RenderCommand command_for(const v1::LeaseGrant& grant, uint64_t attempt) const;
  std::string log_path(const v1::TaskSpec& task, uint64_t epoch) const;
  std::shared_ptr<grpc::Channel> channel();
  void note(const std::vector<std::string>& notes) const;

  const SupervisorOptions options_;
  const WorkerFolder& folder_;
  Spool spool_;

  std::mutex store_mutex_;
  SceneStore store_;  // guarded by store_mutex_

  mutable std::mutex mutex_;  // guards everything below
  std::condition_variable changed_;
  LeaseBook book_;
  std::optional<ChildIdentity> identity_;  // of the first child; the others must agree
  std::vector<std::string> addresses_;
  size_t address_ = 0;  // the one in use
  std::map<std::string, std::shared_ptr<grpc::Channel>> channels_;
  uint64_t sequence_ = 0;
  LeaderSeen leader_;
  uint64_t attempts_ = 0;
  int failures_in_a_row_ = 0, aborts_in_a_row_ = 0;
  bool connected_ = false;
  std::string last_notice_, last_problem_;
  bool draining_ = false, finished_ = false;
  std::optional<std::string> leaving_;  // why, once nothing is left to do
  BootTime drain_deadline_{0};
  int exit_code_ = 0;
  std::mt19937_64 random_{std::random_device{}()};  // jitter only
};

}  // namespace woodcock
