// The order in which jobs that have something to lease are served: by priority; among jobs of one priority the user with the least work
// under way for their share, of equals who was served longest ago; among a user's jobs the one that got least. Deterministic, without
// clock. No call looks at all jobs.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/policy.h"

namespace woodcock::coordinator {

/// Jobs are grouped by what they demand of a worker, by priority and by user. A change of one user's work moves that user's groups, not
/// their jobs; a worker is compared with each demand once, not with each job.
class RunQueue {
 public:
  /// How much of the workers a user is to have beside others; 1 where it is not listed.
  using Shares = std::map<std::string, double>;
  explicit RunQueue(Shares shares = {}) : shares_(std::move(shares)) {}
  RunQueue(const RunQueue&) = delete;  // its parts point at each other
  RunQueue& operator=(const RunQueue&) = delete;
  RunQueue(RunQueue&&) = default;
  RunQueue& operator=(RunQueue&&) = default;

  /// A job that may be queued later. Its id must be new.
  void add(const std::string& id, int priority, const std::string& user, const Demands& demands);
  /// It must hold no lease.
  void remove(const std::string& id);
  /// Whether the job has something to lease. Who was not queued shares from now on, and does not catch up on what others got meanwhile.
  void set_queued(const std::string& id, bool queued);

  /// A lease of the job begins on a worker that gives it `threads`, and a size of `paths`; or ends.
  void lease_begins(const std::string& id, int64_t threads, double paths);
  void lease_ends(const std::string& id, int64_t threads);

  /// Calls `use` for the queued jobs whose demands `meets` says yes to and for the jobs `others`, which are not queued, in the order of
  /// their turns, until it returns true. Neither may change the queue.
  void visit(const std::function<bool(const Demands&)>& meets, const std::vector<std::string>& others,
             const std::function<bool(const std::string&)>& use) const;

 private:
  /// A job among its user's jobs: what it got, as a virtual time.
  struct JobTurn {
    double served = 0;
    std::string id;
    friend auto operator<=>(const JobTurn&, const JobTurn&) = default;
  };
  /// A user among those who have jobs of some priority.
  struct GroupTurn {
    int before = 0;     ///< the priority with its sign changed
    double load = 0;    ///< threads under way for one share
    uint64_t last = 0;  ///< when the user was served last in this priority, as a number that grows: of equals nobody waits for long
    std::string user{};
    friend auto operator<=>(const GroupTurn&, const GroupTurn&) = default;
  };
  struct Group {
    GroupTurn turn;
    std::set<JobTurn> jobs;
  };
  using Order = std::map<GroupTurn, Group*>;  // of groups with jobs
  struct DemandClass {
    Demands demands;
    std::map<std::pair<int, std::string>, Group> groups;  // with queued jobs: by priority and user
    Order order;
    size_t jobs = 0;  // queued or not
  };
  /// A user's jobs of one priority.
  struct Account {
    uint64_t last = 0;  ///< see GroupTurn
    double clock = 0;   ///< virtual time of the jobs: that of the last one served
    size_t jobs = 0;
  };
  struct User {
    double share = 1;
    int64_t threads = 0;
    std::map<int, Account> accounts;                // by priority
    std::set<std::pair<DemandClass*, int>> groups;  // with queued jobs: demands and priority
  };
  struct Entry {
    int priority = 0;
    std::string user;
    DemandClass* demand_class = nullptr;
    double served = 0;
    bool queued = false;
  };
  struct Cursor;

  GroupTurn turn_of(const User& user, const std::string& name, int priority) const;
  void move_groups(User& user, const std::string& name);

  Shares shares_;
  std::map<Demands, DemandClass> classes_;
  std::map<std::string, User> users_;
  std::map<std::string, Entry> jobs_;
  uint64_t turns_ = 0;  // counts leases that begin, and accounts
};

}  // namespace woodcock::coordinator
