#include "coordinator/run_queue.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace woodcock::coordinator {

void RunQueue::add(const std::string& id, int priority, const std::string& user, const Demands& demands) {
  DemandClass& demand_class = classes_[demands];
  demand_class.demands = demands;
  ++demand_class.jobs;
  User& owner = users_[user];
  if (const auto share = shares_.find(user); share != shares_.end()) owner.share = share->second;
  // Who comes anew waits for those who are here: to end a job and begin another gains nothing.
  if (Account& account = owner.accounts[priority]; account.jobs++ == 0) account.last = ++turns_;
  jobs_[id] = {priority, user, &demand_class, 0, false};
}

void RunQueue::remove(const std::string& id) {
  set_queued(id, false);
  const auto job = jobs_.find(id);
  const Entry entry = std::move(job->second);
  jobs_.erase(job);
  User& owner = users_.at(entry.user);
  if (--owner.accounts.at(entry.priority).jobs == 0) owner.accounts.erase(entry.priority);
  if (owner.accounts.empty()) users_.erase(entry.user);
  if (--entry.demand_class->jobs == 0) classes_.erase(Demands(entry.demand_class->demands));
}

RunQueue::GroupTurn RunQueue::turn_of(const User& user, const std::string& name, int priority) const {
  return {-priority, static_cast<double>(user.threads) / user.share, user.accounts.at(priority).last, name};
}

/// To where the user's turns are now.
void RunQueue::move_groups(User& user, const std::string& name) {
  for (const auto& [demand_class, priority] : user.groups) {
    Group& group = demand_class->groups.at({priority, name});
    auto node = demand_class->order.extract(group.turn);
    group.turn = node.key() = turn_of(user, name, priority);
    demand_class->order.insert(std::move(node));
  }
}

void RunQueue::set_queued(const std::string& id, bool queued) {
  Entry& entry = jobs_.at(id);
  if (entry.queued == queued) return;
  entry.queued = queued;
  User& owner = users_.at(entry.user);
  DemandClass& demand_class = *entry.demand_class;
  Group& group = demand_class.groups[{entry.priority, entry.user}];  // none is kept without jobs
  if (!queued) {
    group.jobs.erase({entry.served, id});
    if (!group.jobs.empty()) return;
    demand_class.order.erase(group.turn);
    owner.groups.erase({&demand_class, entry.priority});
    demand_class.groups.erase({entry.priority, entry.user});
    return;
  }
  entry.served = std::max(entry.served, owner.accounts.at(entry.priority).clock);
  group.jobs.insert({entry.served, id});
  if (group.jobs.size() > 1) return;
  group.turn = turn_of(owner, entry.user, entry.priority);
  demand_class.order.emplace(group.turn, &group);
  owner.groups.emplace(&demand_class, entry.priority);
}

void RunQueue::lease_begins(const std::string& id, int64_t threads, double paths) {
  Entry& entry = jobs_.at(id);
  User& owner = users_.at(entry.user);
  Account& account = owner.accounts.at(entry.priority);
  account.clock = std::max(account.clock, entry.served);
  owner.threads += threads;
  account.last = ++turns_;
  if (entry.queued) {
    std::set<JobTurn>& jobs = entry.demand_class->groups.at({entry.priority, entry.user}).jobs;
    auto node = jobs.extract({entry.served, id});
    node.value().served += paths;
    jobs.insert(std::move(node));
  }
  entry.served += paths;
  move_groups(owner, entry.user);
}

void RunQueue::lease_ends(const std::string& id, int64_t threads) {
  User& owner = users_.at(jobs_.at(id).user);
  owner.threads -= threads;
  move_groups(owner, jobs_.at(id).user);
}

/// How far the jobs of one order are visited.
struct RunQueue::Cursor {
  Order::const_iterator group, end;
  std::set<JobTurn>::const_iterator job;

  explicit Cursor(const Order& order) : group(order.begin()), end(order.end()), job(group->second->jobs.begin()) {}
  bool next() {
    if (++job != group->second->jobs.end()) return true;
    if (++group == end) return false;
    job = group->second->jobs.begin();
    return true;
  }
  /// For a heap whose first is the next: whether this one's turn is later.
  friend bool operator<(const Cursor& a, const Cursor& b) { return std::tie(a.group->first, *a.job) > std::tie(b.group->first, *b.job); }
};

void RunQueue::visit(const std::function<bool(const Demands&)>& meets, const std::vector<std::string>& others,
                     const std::function<bool(const std::string&)>& use) const {
  // The others as an order of their own.
  std::map<std::pair<int, std::string>, Group> groups;
  Order order;
  for (const std::string& id : others) {
    const Entry& entry = jobs_.at(id);
    Group& group = groups[{entry.priority, entry.user}];
    group.turn = turn_of(users_.at(entry.user), entry.user, entry.priority);
    group.jobs.insert({entry.served, id});
    order.emplace(group.turn, &group);
  }
  std::vector<Cursor> cursors;
  if (!order.empty()) cursors.emplace_back(order);
  for (const auto& [demands, demand_class] : classes_)
    if (!demand_class.order.empty() && meets(demands)) cursors.emplace_back(demand_class.order);
  std::make_heap(cursors.begin(), cursors.end());
  while (!cursors.empty()) {
    std::pop_heap(cursors.begin(), cursors.end());
    if (use(cursors.back().job->id)) return;
    if (cursors.back().next())
      std::push_heap(cursors.begin(), cursors.end());
    else
      cursors.pop_back();
  }
}

}  // namespace woodcock::coordinator
