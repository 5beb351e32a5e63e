// What jobs ask of workers: tags, memory, and how many of them.
#include <algorithm>

#include "coordinator/scheduler.h"
#include "rpc/quantities.h"

namespace woodcock::coordinator {

/// Each slot has an equal share of the worker's memory.
bool Scheduler::meets(const Worker& worker, const Demands& demands) const {
  return demands.memory <= worker.last.memory / worker.last.slots &&
         std::includes(worker.last.tags.begin(), worker.last.tags.end(), demands.tags.begin(), demands.tags.end());
}

/// What no connected worker has of it, as a sentence; empty where one has all.
std::string Scheduler::unmet_demands(const Demands& demands, Time now) const {
  std::vector<const Worker*> workers;
  for (const auto& [id, worker] : workers_)
    if (connected(worker, now)) workers.push_back(&worker);
  if (std::any_of(workers.begin(), workers.end(), [&](const Worker* w) { return meets(*w, demands); })) return {};
  std::string wanted;
  for (const std::string& tag : demands.tags) {
    const bool any = std::any_of(workers.begin(), workers.end(),
                                 [&](const Worker* w) { return std::binary_search(w->last.tags.begin(), w->last.tags.end(), tag); });
    if (!any) return "no connected worker has the tag " + tag;
    wanted += (wanted.empty() ? "" : ", ") + tag;
  }
  std::erase_if(workers, [&](const Worker* w) { return !meets(*w, {demands.tags, 0}); });
  if (workers.empty()) return "no connected worker has all of the tags " + wanted;
  int64_t most = 0;
  for (const Worker* worker : workers) most = std::max(most, worker->last.memory / worker->last.slots);
  std::string reason = "no connected worker has " + rpc::bytes_text(demands.memory) + " of memory for a task";
  if (!wanted.empty()) reason += " and the tag" + std::string(demands.tags.size() > 1 ? "s " : " ") + wanted;
  return reason + (most > 0 ? "; the most is " + rpc::bytes_text(most) : "");
}

/// Whether the job's number of workers leaves room for this one.
bool Scheduler::may_join(const std::string& worker_id, const Job& job) const { return !job.is_full() || job.workers.contains(worker_id); }

/// Jobs that have as many workers as they may, this one among them: only these go on with them.
std::vector<std::string> Scheduler::full_jobs_of(const Worker& worker) const {
  std::set<std::string> jobs;
  for (const std::string& id : worker.leases) {
    const Job* job = find(leases_.at(id).task.job);
    if (job && job->is_full() && job->is_runnable() && meets(worker, job->spec.policy.demands)) jobs.insert(job->spec.id);
  }
  return {jobs.begin(), jobs.end()};
}

}  // namespace woodcock::coordinator
