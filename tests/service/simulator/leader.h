// The coordinator as a process: the production Coordinator without its threads, started on a simulated disk, driven step by step, killed at
// any of them, and started again on what the disk kept.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "coordinator/coordinator.h"
#include "tests/service/simulator/world.h"

namespace woodcock::simulator {

/// What is done to the coordinator in a step; the report of a worker, where it is one.
struct Step {
  const char* name = "";
  const v1::SyncRequest* report = nullptr;
};

class Leader {
 public:
  /// `disk`: what its folder holds at first.
  Leader(World& world, DiskImage disk);
  ~Leader();

  bool up() const { return present_ != nullptr; }
  void start();
  /// Runs `work` on the coordinator, and the checks after it. False where there is none, or it ended meanwhile: then nobody hears of it.
  bool call(const Step& step, const std::function<void(coordinator::Coordinator&)>& work);

  using Reply = std::function<void(const rpc::Outcome&, const v1::SyncResponse&)>;
  /// Sync, by whoever of the coordinators the worker reaches.
  void sync(uint64_t call, const v1::SyncRequest& request, const Reply& reply);
  /// The worker gave the call up.
  void cancel_sync(const std::string& worker, uint64_t call);
  /// Uploads a tile; `reply` says whether it arrived.
  void upload(const std::string& digest, const std::string& bytes, const std::function<void(bool)>& reply);

  void crash(bool power_cut);
  /// At the n-th sync or failpoint from now.
  void crash_at(int n, bool power_cut);
  void stop();
  /// Starts another leader; the present one goes on and does not know.
  void replace();
  /// Nothing of what it does stays undone: for the end of a schedule.
  bool idle();
  /// Some task that is open, if there is one.
  std::optional<std::string> open_task();
  /// Flips a byte of a stored blob. False where there is none.
  bool damage(const std::string& digest);

 private:
  struct Process;

  bool run(std::shared_ptr<Process> process, const Step& step, const std::function<void(coordinator::Coordinator&)>& work);
  void pass(const std::string& point);
  void end(bool power_cut);
  void bury();
  void restart_later();
  void keep_stepping(const std::shared_ptr<Process>& process);
  void write_later(const std::shared_ptr<Process>& process);
  coordinator::CoordinatorOptions options_of(const std::shared_ptr<Process>& process);

  World& world_;
  std::shared_ptr<Process> present_, outdated_;
  std::shared_ptr<Process> running_;  ///< whose code runs
  DiskImage left_;                    ///< by the process that ended last
  uint64_t lives_ = 0, ids_ = 0;
  int until_crash_ = 0;
  bool crash_cuts_power_ = false;
};

}  // namespace woodcock::simulator
