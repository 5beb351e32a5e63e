// What must hold after every step, whatever has happened: the checker of the simulator. It keeps what the coordinator has told, and
// holds memory, database and disk against it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "coordinator/coordinator.h"
#include "tests/service/simulator/leader.h"
#include "tests/service/simulator/world.h"

namespace woodcock::simulator {

class Checks {
 public:
  explicit Checks(World& world) : world_(world) {}

  /// A coordinator has recovered from what was durable: nothing that it acknowledged before is missing.
  void started(coordinator::Coordinator& coordinator);
  void stopped() { leases_.clear(); }
  void after(coordinator::Coordinator& coordinator, const Step& step);
  /// An answer leaves the coordinator, which another has replaced where it is `outdated`.
  void told(const v1::SyncRequest& request, const v1::SyncResponse& response, bool outdated);
  /// Of a job that a client has just been shown. `extended`: an extension was asked for.
  void shown(const v1::Job& job, bool extended);
  /// The end of a schedule: nothing is leased, memory, database and blobs agree.
  void finally(coordinator::Coordinator& coordinator);

  /// Results that were acknowledged: task → digest.
  const std::map<std::string, std::string>& acknowledged() const { return acknowledged_; }

 private:
  struct Lease {
    coordinator::TaskRef task;
    std::string worker;
    uint64_t epoch = 0, counter = 0;
    Time renewed = 0;
  };
  /// The newest report of a worker.
  struct Heard {
    uint64_t incarnation = 0, sequence = 0;
  };
  struct Shown {
    v1::JobState state{};
    int64_t tasks_done = 0, last_event = 0;
  };

  /// Whether the report is newer than what this leader has heard of the worker; `restarted`: it is of a newer process.
  bool take_in(const v1::SyncRequest& report, bool& restarted);
  void check_leases(const coordinator::Scheduler& scheduler, const Step& given);
  void take_in_leases(const coordinator::Scheduler& scheduler, const Step& step, bool restarted);
  void check_end(const std::string& id, const Lease& lease, const coordinator::Scheduler& scheduler, const Step& step, bool restarted);
  void check_counts(const coordinator::Scheduler& scheduler);
  void check_acknowledged(coordinator::Coordinator& coordinator);
  void compare_with_database(coordinator::Coordinator& coordinator);

  World& world_;
  std::map<std::string, Lease> leases_;              // live ones of this leader
  std::map<std::string, std::string> granted_;       // lease → worker that was told of it
  std::map<std::string, uint64_t> highest_;          // epoch of a task, of this leader
  std::map<std::string, std::string> acknowledged_;  // task → digest
  std::map<std::string, std::string> settled_;       // task → digest, as the database had it
  std::map<std::string, Shown> shown_;               // job → what a client has seen
  std::map<std::string, Heard> heard_;               // worker → what this leader heard of it
  uint64_t term_ = 0;                                // of this leader
  int64_t steps_ = 0;
};

/// Of the id of a lease: the epoch that belongs to it.
uint64_t epoch_of(const std::string& lease_id);

}  // namespace woodcock::simulator
