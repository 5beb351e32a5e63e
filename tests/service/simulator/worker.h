// A worker: the production lease book, spool and memory of leaders, in a loop that does what the supervisor's threads do.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rpc/error.h"
#include "tests/service/simulator/world.h"
#include "worker/leader_seen.h"
#include "worker/lease_book.h"
#include "worker/spool.h"

namespace woodcock::simulator {

class Worker {
 public:
  Worker(World& world, int number, std::string build);

  const std::string& id() const { return id_; }
  /// A new process, on what the last one left on disk.
  void start();
  void crash(bool power_cut);
  /// SIGSTOP and SIGCONT.
  void freeze();
  void go_on();
  void drain();
  /// Has no lease and nothing to say.
  bool idle() const { return book_ && !frozen_ && book_->idle(); }
  bool running() const { return book_ != nullptr; }
  /// What a program with a fault, or an attacker, might send in this worker's name: its leases, failures and releases with epochs that
  /// are not theirs, and leases that nobody granted.
  void forge();

 private:
  struct Call {
    uint64_t number = 0, news = 0;
    v1::SyncRequest request;
    BootTime sent_at{0};
    Time sent = 0;
    bool draining = false;
  };

  BootTime boot() const { return BootTime(world_.loop.now() + clock_offset_); }
  void later(Time delay, std::function<void()> work);
  void look_around();
  void act();
  v1::SyncRequest make_request();
  void sync();
  void cut_call();
  void call_failed(rpc::Code code, const std::string& message);
  void take_answer(uint64_t number, const rpc::Outcome& outcome, const v1::SyncResponse& response);
  void fetch(const v1::LeaseGrant& grant);
  void render(const std::shared_ptr<v1::LeaseGrant>& grant, Time left);
  void end_attempt(const v1::LeaseGrant& grant);
  void upload(const v1::ResultOffer& offer);
  bool is_poison(const v1::TaskSpec& task) const;

  World& world_;
  const std::string id_, build_;
  const int slots_;
  const Time clock_offset_;
  std::filesystem::path folder_;
  DiskImage left_;
  uint64_t incarnation_ = 0, life_ = 0;
  // Of the process that runs:
  bool frozen_ = false, draining_ = false, fetching_ = false, uploading_ = false, answered_ = false;
  std::vector<std::function<void()>> missed_;  // while it was frozen
  std::unique_ptr<Spool> spool_;
  std::unique_ptr<LeaseBook> book_;
  LeaderSeen leader_;
  uint64_t highest_term_ = 0;
  uint64_t sequence_ = 0, calls_ = 0, news_ = 0;
  std::optional<Call> call_;
  Time sync_at_ = 0, drain_end_ = 0;
  int busy_slots_ = 0, failures_ = 0, aborts_ = 0;
};

}  // namespace woodcock::simulator
