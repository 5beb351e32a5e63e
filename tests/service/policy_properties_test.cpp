// Rules of the scheduler over random farms: jobs with random demands, limits, users and priorities that come, are paused and cancelled;
// workers that come, fail, drain, leave and are started again. Whatever happens, after each answer to a worker: no job has more workers
// than it may, no task is where it must not be, no worker idles beside a task that it may take, priorities and shares are kept, and
// nobody waits for long. A failure names the seed.
//
// What is checked is counted from the scheduler's actions, not from its own books.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "tests/service/scheduler_fixture.h"

namespace woodcock::coordinator {
namespace {

constexpr int kFarms = 1000, kSteps = 250;
const std::vector<std::string> kNames{"ada", "bob", "eve", ""};
constexpr int kUsers = 4;
constexpr int64_t kGib = int64_t{1} << 30;

struct Machine {
  std::vector<std::string> tags;
  int64_t memory = 0;
  int slots = 1, threads = 1;
  uint64_t incarnation = 1, sequence = 0;
  bool up = true, draining = false;
  std::map<std::string, Grant> held;
};

class Farm {
 public:
  explicit Farm(uint64_t seed) : random_(seed), scheduler_(options()) {
    for (int i = 0, n = 2 + pick(6); i < n; ++i) start(std::string("w").append(std::to_string(i)));
  }

  void step() {
    now_ += kSecond / 4 * (1 + pick(8));
    std::erase_if(passed_, [&](const auto& entry) {
      return std::none_of(scheduler_.jobs().begin(), scheduler_.jobs().end(),
                          [&](const auto& job) { return std::pair(job.second.spec.priority, job.second.spec.policy.user) == entry.first; });
    });
    switch (pick(20)) {
      case 0:
      case 1:
        return submit();
      case 2:
        return any_job([&](const std::string& id) { scheduler_.set_paused(id, pick(2) == 0); });
      case 3:
        return any_job([&](const std::string& id) {
          if (pick(3) == 0) scheduler_.cancel(id);
        });
      case 4:
        return restart_one();
      case 5:
        scheduler_.tick(now_);
        settle("");
        return;
      default:
        return call(std::next(machines_.begin(), pick(static_cast<int>(machines_.size())))->first);
    }
  }

  int leases = 0, copies = 0, ended = 0, full = 0, waited = 0, longest_wait = 0;  // whether the farm had anything to show

 private:
  struct Live {
    TaskRef task;
    std::string worker;
    int64_t threads = 1;
  };

  static SchedulerOptions options() {
    SchedulerOptions options;
    options.shares = {{"ada", 2}};
    return options;
  }
  static double share(const std::string& user) { return user == "ada" ? 2 : 1; }
  int pick(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random_); }

  void start(const std::string& id) {
    Machine& machine = machines_[id];
    machine.tags.clear();
    for (const char* tag : {"big", "gpu", "ssd"})
      if (pick(2) == 0) machine.tags.push_back(tag);
    machine.memory = pick(3) == 0 ? 0 : (1 + pick(4)) * 8 * kGib;
    machine.slots = 1 + pick(3);
    machine.threads = 1 + pick(4);
    machine.up = true;
    machine.draining = false;
  }

  void submit() {
    JobSpec spec = test_job(std::string("j").append(std::to_string(next_job_++)), pick(3) - 1);
    JobPolicy& policy = spec.policy;
    policy.user = kNames[static_cast<size_t>(pick(kUsers))];
    for (const char* tag : {"big", "gpu"})
      if (pick(4) == 0) policy.demands.tags.push_back(tag);
    if (pick(4) == 0) policy.demands.memory = (1 + pick(3)) * 4 * kGib;
    if (pick(2) == 0) policy.max_workers = static_cast<size_t>(1 + pick(3));
    std::set<std::string> after;
    for (int i = 0; i < 2 && !scheduler_.jobs().empty(); ++i)
      if (pick(3) == 0) after.insert(std::next(scheduler_.jobs().begin(), pick(static_cast<int>(scheduler_.jobs().size())))->first);
    if (!ends_.empty() && pick(8) == 0) after.insert(std::next(ends_.begin(), pick(static_cast<int>(ends_.size())))->first);
    policy.after.assign(after.begin(), after.end());
    policy.waits_for = policy.after;
    spec.frames.clear();
    for (int frame = 0, n = 1 + pick(2); frame < n; ++frame) {
      FrameSpec input{test_header(32 * (1 + pick(4)), 32 * (1 + pick(2))), std::string(64, 'c'), "scene.pbrt"};
      input.header.frame = static_cast<uint64_t>(frame);
      // Another picture for each: no result answers another job's task.
      input.header.settings_digest = std::string(62, 'b') + std::to_string(10 + next_job_ % 90);
      spec.frames.push_back(input);
    }
    waited += policy.after.empty() ? 0 : 1;
    scheduler_.add_job(spec);
    settle("");
  }

  template <typename Act>
  void any_job(Act act) {
    if (scheduler_.jobs().empty()) return;
    act(std::string(std::next(scheduler_.jobs().begin(), pick(static_cast<int>(scheduler_.jobs().size())))->first));
    settle("");
  }

  /// A worker drains, leaves, vanishes, or is there again with other tags.
  void restart_one() {
    const auto it = std::next(machines_.begin(), pick(static_cast<int>(machines_.size())));
    Machine& machine = it->second;
    if (!machine.up) {
      ++machine.incarnation;
      machine.sequence = 0;
      machine.held.clear();
      return start(it->first);
    }
    switch (pick(3)) {
      case 0:
        machine.draining = true;
        return;
      case 1: {
        WorkerReport last = report(it->first, machine);
        last.left = true;
        machine.up = false;
        ASSERT_EQ(scheduler_.report(last, now_), ReportStatus::Accepted);
        settle("");
        return;
      }
      default:
        machine.up = false;  // it vanishes, and its leases with it
    }
  }

  WorkerReport report(const std::string& id, Machine& machine) {
    WorkerReport r;
    r.worker_id = r.host_name = id;
    r.build = "build";
    r.arithmetic_class = "class";
    r.incarnation = machine.incarnation;
    r.sequence = ++machine.sequence;
    r.slots = machine.slots;
    r.threads = machine.threads;
    r.tags = machine.tags;
    r.memory = machine.memory;
    r.draining = machine.draining;
    for (const auto& [lease, grant] : machine.held) r.leases.push_back({lease, to_string(grant.task), grant.epoch, ++counter_, 5, 0});
    return r;
  }

  /// A worker finishes, or fails, some of what it holds, reports, and gets more.
  void call(const std::string& id) {
    Machine& machine = machines_.at(id);
    if (!machine.up) return;
    std::vector<Grant> finished, failed;
    for (const auto& [lease, grant] : std::map<std::string, Grant>(machine.held)) {
      const int what = pick(30);
      if (what >= 12) continue;
      machine.held.erase(lease);
      (what > 0 ? finished : failed).push_back(grant);
    }
    WorkerReport r = report(id, machine);
    for (const Grant& grant : finished) r.offered_leases.push_back(grant.lease_id);
    failures_[id] += static_cast<int>(failed.size());
    for (const Grant& grant : failed)
      r.failures.push_back({grant.lease_id, to_string(grant.task), grant.epoch, FailureCause::Crash, "it crashed", ""});
    ASSERT_EQ(scheduler_.report(r, now_), ReportStatus::Accepted);
    for (const Grant& grant : finished)
      scheduler_.offer(
          {grant.lease_id, to_string(grant.task), grant.epoch, {grant.result_key, std::string(64, 'd'), 100, {1, kSecond, 1}, {}}}, id,
          true, now_);
    settle("");
    for (bool again = true; again;) {
      const Answer answer = scheduler_.answer(id, now_);
      for (const auto& [lease, reason] : answer.cancellations) machine.held.erase(lease);
      for (const Grant& grant : answer.grants) machine.held[grant.lease_id] = grant;
      again = settle(id);
    }
    check_after_answer(id, machine);
  }

  /// Carries the actions out as a database that never fails; `asked_by` has just been answered. True when there may be more to lease.
  bool settle(const std::string& asked_by) {
    bool more = false;
    for (std::vector<Action> actions = scheduler_.take_actions(); !actions.empty(); actions = scheduler_.take_actions()) {
      for (const Action& any : actions) {
        if (const auto* pin = std::get_if<action::PinFrame>(&any)) {
          scheduler_.frame_pinned(*pin);
          more = true;
        } else if (const auto* find = std::get_if<action::FindResults>(&any)) {
          scheduler_.results_found(*find, {});
          more = true;
        } else if (const auto* commit = std::get_if<action::CommitTask>(&any)) {
          failures_[commit->worker_id] = 0;
          scheduler_.committed(*commit, now_);
        } else if (const auto* ready = std::get_if<action::AssembleFrame>(&any)) {
          scheduler_.frame_assembled(ready->job, ready->frame, std::string(64, 'e'), 1, {});
        } else if (const auto* released = std::get_if<action::ReleaseJob>(&any)) {
          if (const std::optional<Job> job = scheduler_.release(released->job)) {
            ends_[released->job] = job->row.state;
            ++ended;
          }
        } else if (const auto* asked = std::get_if<action::FindJob>(&any)) {
          const auto end = ends_.find(asked->job);
          scheduler_.job_found(asked->job, end == ends_.end() ? std::nullopt : std::optional(end->second));
        } else if (const auto* dropped = std::get_if<action::DropLease>(&any)) {
          drop(dropped->lease_id);
        } else if (const auto* saved = std::get_if<action::SaveLease>(&any)) {
          check_lease(saved->lease, asked_by);
        }
      }
    }
    return more;
  }

  void drop(const std::string& id) {
    const auto it = live_.find(id);
    if (it == live_.end()) return;
    threads_[it->second.user] -= it->second.lease.threads;
    live_.erase(it);
  }

  // --- the rules -------------------------------------------------------------------------------------------------

  std::set<std::string> workers_of(const std::string& job) const {
    std::set<std::string> workers;
    for (const auto& [id, held] : live_)
      if (held.lease.task.job == job) workers.insert(held.lease.worker);
    return workers;
  }

  static bool meets(const Machine& machine, const Demands& demands) {
    for (const std::string& tag : demands.tags)
      if (std::find(machine.tags.begin(), machine.tags.end(), tag) == machine.tags.end()) return false;
    return demands.memory * machine.slots <= machine.memory;
  }

  bool has_lease(const TaskRef& task) const {
    return std::any_of(live_.begin(), live_.end(), [&](const auto& held) { return held.second.lease.task == task; });
  }

  /// Whether the job has a task that nobody has, and that this worker may take.
  bool may_take(const std::string& worker, const Machine& machine, const Job& job) const {
    if (has_ended(job.row.state) || job.row.paused || !job.spec.policy.waits_for.empty() || !meets(machine, job.spec.policy.demands))
      return false;
    const std::set<std::string> workers = workers_of(job.spec.id);
    if (job.spec.policy.max_workers > 0 && workers.size() >= job.spec.policy.max_workers && !workers.contains(worker)) return false;
    for (size_t i = 0; i < job.frames.size(); ++i) {
      const Frame& frame = job.frames[i];
      if (!frame.being_rendered()) continue;
      for (int64_t number = 0; number < frame.tasks.size(); ++number) {
        if (frame.state(number) != TaskState::Open || has_lease({job.spec.id, static_cast<int>(i), number})) continue;
        // Where it failed it goes only when nobody else can have it.
        const ActiveTask* task = frame.find_active(number);
        if (!task || task->failed_workers.empty()) return true;
      }
    }
    return false;
  }

  double load(const std::string& user) const {
    const auto it = threads_.find(user);
    return it == threads_.end() ? 0 : static_cast<double>(it->second) / share(user);
  }

  /// A lease that the scheduler gives out now.
  void check_lease(const LeaseRow& row, const std::string& asked_by) {
    ++leases;
    ASSERT_EQ(row.worker_id, asked_by) << "only who is answered gets something";
    const Machine& machine = machines_.at(row.worker_id);
    const Job& job = *scheduler_.find(row.task.job);
    const JobPolicy& policy = job.spec.policy;
    EXPECT_TRUE(meets(machine, policy.demands)) << row.worker_id << " got a task of " << job.spec.id;
    EXPECT_TRUE(policy.waits_for.empty() && !job.row.paused && !has_ended(job.row.state))
        << job.spec.id << " has not begun, or must not go on";
    EXPECT_FALSE(machine.draining || !machine.up);
    const bool copy = has_lease(row.task);
    copies += copy;
    std::set<std::string> passed;
    for (const auto& [id, other] : scheduler_.jobs()) {
      if (copy || id == job.spec.id || !may_take(row.worker_id, machine, other)) continue;
      EXPECT_LE(other.spec.priority, job.spec.priority) << id << " has a higher priority than " << job.spec.id;
      if (other.spec.priority != job.spec.priority || other.spec.policy.user == policy.user) continue;
      EXPECT_GE(load(other.spec.policy.user), load(policy.user))
          << "user " << other.spec.policy.user << " has less under way than " << policy.user;
      if (passed.insert(other.spec.policy.user).second) count_wait(other);
    }
    passed_.erase({job.spec.priority, policy.user});
    live_[row.lease_id] = {{row.task, row.worker_id, machine.threads}, policy.user};
    threads_[policy.user] += machine.threads;
    const size_t workers = workers_of(job.spec.id).size();
    if (policy.max_workers > 0) {
      EXPECT_LE(workers, policy.max_workers) << job.spec.id;
      full += workers == policy.max_workers;
    }
  }

  /// A user with nothing under way, and with a task that this worker might have taken, lets each other one pass once.
  void count_wait(const Job& waits) {
    const std::string& user = waits.spec.policy.user;
    if (load(user) > 0) return;
    const int passed = ++passed_[{waits.spec.priority, user}];
    longest_wait = std::max(longest_wait, passed);
    EXPECT_LE(passed, kUsers - 1) << "user " << user << " starves";
  }

  void check_after_answer(const std::string& id, const Machine& machine) {
    for (const WorkerView& view : scheduler_.list_workers("", 100, now_)) {
      if (view.last->worker_id != id || view.condition != WorkerCondition::Ready) continue;
      if (view.leases >= static_cast<size_t>(machine.slots)) continue;
      // One that fails again and again is asked ever less often.
      if (failures_[id] >= 3) continue;
      for (const auto& [job_id, job] : scheduler_.jobs()) EXPECT_FALSE(may_take(id, machine, job)) << id << " idles beside " << job_id;
    }
  }

  struct Held {
    Live lease;
    std::string user;
  };

  std::mt19937_64 random_;
  Time now_ = 1000 * kSecond;
  Scheduler scheduler_;
  std::map<std::string, Machine> machines_;
  std::map<std::string, Held> live_;                   // leases that were given out and not dropped
  std::map<std::string, int64_t> threads_;             // by user
  std::map<std::pair<int, std::string>, int> passed_;  // how often others were served before this user of this priority
  std::map<std::string, int> failures_;                // of a worker, since its last success
  std::map<std::string, JobState> ends_;
  int next_job_ = 0;
  uint64_t counter_ = 0;
};

TEST(PolicyProperties, HoldOverRandomFarms) {
  int leases = 0, copies = 0, ended = 0, full = 0, waited = 0, longest_wait = 0;
  for (uint64_t seed = 1; seed <= kFarms; ++seed) {
    SCOPED_TRACE(::testing::Message() << "farm of seed " << seed);
    Farm farm(seed);
    for (int i = 0; i < kSteps; ++i) {
      farm.step();
      if (HasFailure()) FAIL() << "in step " << i;
    }
    leases += farm.leases;
    copies += farm.copies;
    ended += farm.ended;
    full += farm.full;
    waited += farm.waited;
    longest_wait = std::max(longest_wait, farm.longest_wait);
  }
  RecordProperty("leases", leases);
  // Otherwise the rules held of nothing.
  EXPECT_GT(leases, 50 * kFarms);
  EXPECT_GT(copies, kFarms / 10);
  EXPECT_GT(ended, kFarms);
  EXPECT_GT(full, 5 * kFarms);
  EXPECT_GT(waited, kFarms);
  EXPECT_GT(longest_wait, 0);
}

}  // namespace
}  // namespace woodcock::coordinator
