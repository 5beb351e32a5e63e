// Frames that are pinned to a build which nobody has any more.
#include <algorithm>

#include "coordinator/scheduler.h"

namespace woodcock::coordinator {

bool Scheduler::nobody_fits(const Job& job, const Frame& frame, Time now) const {
  return frame.row.pinned && frame.being_rendered() && frame.unsettled > 0 &&
         std::none_of(workers_.begin(), workers_.end(),
                      [&](const auto& w) { return connected(w.second, now) && fits(w.second, job, frame); });
}

/// The frame as it was submitted: tiles of two builds never make one picture. False while something of it is under way.
bool Scheduler::start_again(Job& job, int index) {
  Frame& frame = job.frames[static_cast<size_t>(index)];
  if (frame.pin_pending || frame.looking_up > frame.looked_up || frame.any_committing()) return false;
  end_leases(frame, CancelReason::TaskSettled);
  const std::string build = frame.row.build;
  Frame fresh;
  fresh.spec = frame.spec;
  fresh.revision = frame.revision + 1;
  frame = std::move(fresh);
  lay_out(job.spec, frame, {});
  job.first_unfinished = 0;
  set_ready(job, frame);
  actions_.push_back(action::ResetFrame{job.spec.id, index, frame.row});
  log(job.spec.id, EventKind::StateChanged, frame.spec.header.frame, "", "",
      "frame " + std::to_string(frame.spec.header.frame) + " starts again: no connected worker has build " + build);
  update_job(job);
  return true;
}

std::optional<int64_t> Scheduler::repin(const std::string& id, Time now) {
  Job* job = job_of(id);
  if (!job || has_ended(job->row.state)) return 0;
  int64_t started = 0;
  for (size_t i = 0; i < job->frames.size(); ++i) {
    if (!nobody_fits(*job, job->frames[i], now)) continue;
    if (!start_again(*job, static_cast<int>(i))) return std::nullopt;
    ++started;
  }
  return started;
}

void Scheduler::repin_overdue(Time now) {
  if (options_.repin_after <= 0 || connected_workers(now) == 0) return;
  for (auto& [id, job] : jobs_) {
    if (has_ended(job.row.state)) continue;
    for (size_t i = job.first_unfinished; i < job.frames.size(); ++i) {
      Frame& frame = job.frames[i];
      if (!nobody_fits(job, frame, now))
        frame.unfit_since = 0;
      else if (frame.unfit_since == 0)
        frame.unfit_since = now;
      else if (now - frame.unfit_since >= options_.repin_after)
        start_again(job, static_cast<int>(i));
    }
  }
}

}  // namespace woodcock::coordinator
