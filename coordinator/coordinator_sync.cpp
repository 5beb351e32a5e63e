// Sync: a worker's report in, what it must be told out, held until there is something.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "coordinator/coordinator.h"
#include "coordinator/coordinator_locked.h"
#include "coordinator/sync_wire.h"
#include "rpc/convert.h"
#include "rpc/error.h"
#include "rpc/limits.h"

namespace woodcock::coordinator {
namespace {

/// Of workers that have nothing new to tell.
constexpr Time kSyncsPerSecond = 250;

}  // namespace

bool Coordinator::meets_a_stranger(const v1::SyncRequest& request, const SyncDone& done) {
  if (request.cluster_id().empty()) return false;
  if (request.cluster_id() != store_->cluster_id()) {
    spdlog::warn("worker {} comes from another cluster, {}: it joins this one, {}, anew", request.worker_id(), request.cluster_id(),
                 store_->cluster_id());
    v1::SyncResponse response;
    *response.mutable_protocol() = rpc::this_protocol();
    response.set_leader_term(store_->term());
    response.set_sequence(request.sequence());
    response.set_cluster_id(store_->cluster_id());
    response.set_leader_id(leader_id_);
    done({}, response);
    return true;
  }
  // One term has one leader, unless this database does not know of a later one.
  const uint64_t own = store_->term(), seen = request.leader_term();
  if (seen < own || (seen == own && request.leader_id() == leader_id_)) return false;
  const std::string what = fmt::format(
      "worker {} has seen leader term {} of this cluster, and this coordinator has {}: its folder is an older back-up. It takes a higher "
      "term; work since the back-up is rendered again",
      request.worker_id(), seen, own);
  spdlog::warn("{}", what);
  store_->raise_term(seen, [this] {
    locked([&] {
      scheduler_->set_leader_term(store_->term());
      ++changes_;
    });
  });
  done({rpc::Code::kUnavailable, what}, {});
  return true;
}

uint64_t Coordinator::sync(const v1::SyncRequest& request, SyncDone done) {
  WorkerReport report;
  HeldSync held;
  try {
    report = report_from_wire(request);
    held.offers = offers_from_wire(request);
    if (meets_a_stranger(request, done)) return 0;
    if (store_->backlog() > options_.max_backlog)
      throw rpc::RpcError(rpc::Code::kUnavailable, "the coordinator's database is behind; go on rendering and try again");
  } catch (...) {
    done(rpc::outcome_of_current_exception(), {});
    return 0;
  }
  held.verdicts.assign(held.offers.size(), {OfferStatus::Pending, ""});
  held.asked.assign(held.offers.size(), false);
  // Held before they are looked for, until the rows of those that are committed are durable.
  held.hold = std::make_shared<BlobStore::Hold>(blobs_);
  for (const Offer& offer : held.offers) {
    held.hold->add(offer.result.digest);
    held.present.push_back(blobs_.contains(offer.result.digest));
  }
  held.sequence = request.sequence();
  held.done = std::move(done);
  const Time now = options_.now();
  // The first call of a process is not held: its answer tells the worker that it has arrived.
  const bool at_once = request.sequence() == 1 || report.left;
  SyncDone superseded, refused;
  rpc::Outcome refusal;
  uint64_t token = 0;
  const auto take_in = [&]() -> uint64_t {
    const ReportStatus status = stopping_ ? ReportStatus::Accepted : scheduler_->report(report, now);
    if (stopping_) {
      refusal = {rpc::Code::kUnavailable, "the coordinator is stopping; go on rendering and try again"};
    } else if (status == ReportStatus::OlderIncarnation) {
      refusal = {rpc::Code::kAborted, "a newer incarnation of worker " + report.worker_id + " is connected; stop this one"};
    } else if (status == ReportStatus::OlderSequence) {
      refusal = {rpc::Code::kAborted, "a later call of this incarnation was seen"};
    }
    if (!refusal.ok()) {
      refused = std::move(held.done);
      return 0;
    }
    held.deadline = now + (at_once ? 0 : sync_hold(!request.leases().empty()));
    held.token = ++next_token_;
    const uint64_t result = held.token;
    const auto old = held_.find(report.worker_id);
    if (old != held_.end()) {
      superseded = std::move(old->second.done);
      held_.erase(old);
    }
    held_.emplace(report.worker_id, std::move(held));
    return result;
  };
  if (const auto error = rpc::failure_of([&] { token = locked(take_in); })) {
    spdlog::error("the report of worker {} cannot be taken in: {}", report.worker_id, *error);
    if (held.done) held.done({rpc::Code::kInternal, *error}, {});
    return 0;
  }
  if (report.left && token != 0) spdlog::info("worker {} has left", report.worker_id);
  if (superseded) superseded({rpc::Code::kAborted, "a later call of this worker replaces this one"}, {});
  if (refused) refused(refusal, {});
  return token;
}

/// How long a call is held while there is nothing to say, and so when the worker calls again. Of many workers each calls more rarely, so
/// that all of them together stay within what one coordinator answers; never so rarely that a lease ends meanwhile.
Time Coordinator::sync_hold(bool busy) const {
  if (!busy) return options_.sync_hold;
  const Time spread = static_cast<Time>(held_.size()) * kSecond / kSyncsPerSecond;
  return std::clamp(spread, options_.busy_sync_hold, std::max(options_.busy_sync_hold, options_.scheduler.lease / 4));
}

bool Coordinator::cancel_sync(uint64_t token) {
  const std::lock_guard lock(mutex_);
  const auto it = std::find_if(held_.begin(), held_.end(), [&](const auto& h) { return h.second.token == token; });
  if (it == held_.end()) return false;
  held_.erase(it);
  return true;
}

void Coordinator::stop_syncs() {
  std::map<std::string, HeldSync> held;
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    held.swap(held_);
  }
  for (auto& [id, call] : held) call.done({rpc::Code::kUnavailable, "the coordinator is stopping; go on rendering and try again"}, {});
}

void Coordinator::decide_offers(const std::string& worker_id, HeldSync& held) {
  for (size_t i = 0; i < held.offers.size(); ++i) {
    auto& [status, reason] = held.verdicts[i];
    if (status != OfferStatus::Pending || held.asked[i]) continue;
    const OfferDecision decision = scheduler_->offer(held.offers[i], worker_id, held.present[i], options_.now());
    if (decision.status == OfferStatus::Settled) {
      ask_store(worker_id, held, i);
      continue;
    }
    status = decision.status;
    reason = decision.reason;
  }
}

/// The call that offered the result, where it is still held, is told its verdict.
void Coordinator::tell_committed(const action::CommitTask& commit) {
  const auto call = held_.find(commit.worker_id);
  if (call == held_.end()) return;
  const std::string task = to_string(commit.task);
  for (size_t i = 0; i < call->second.offers.size(); ++i) {
    const Offer& offer = call->second.offers[i];
    auto& verdict = call->second.verdicts[i];
    if (verdict.first == OfferStatus::Pending && offer.task_id == task && offer.result.digest == commit.result.digest)
      verdict = {OfferStatus::Committed, ""};
  }
}

/// What was settled is in the database only: its answer is the verdict of a call that is still held then.
void Coordinator::ask_store(const std::string& worker_id, HeldSync& held, size_t index) {
  held.asked[index] = true;
  // An offer that waited for a commit waited for its own.
  const bool waited = held.tried > 0;
  const Offer offer = held.offers[index];
  const TaskRef task = parse_task_id(offer.task_id).value_or(TaskRef{});
  auto row = std::make_shared<std::optional<SettledTask>>();
  store_->write([task, row](StoreSession& session) { *row = session.settled(task); },
                [this, worker_id, token = held.token, index, offer, task, waited, row] {
                  locked([&] {
                    OfferDecision decision = verdict_of_settled(*row, offer);
                    if (waited && decision.status == OfferStatus::AlreadyCommitted) decision.status = OfferStatus::Committed;
                    if (decision.alarm) raise_alarm(task, worker_id, decision.reason);
                    const auto call = held_.find(worker_id);
                    if (call == held_.end() || call->second.token != token) return;
                    call->second.verdicts[index] = {decision.status, decision.reason};
                    ++changes_;
                  });
                });
}

/// mutex_ held. Of a job that has ended the database numbers the event.
void Coordinator::raise_alarm(const TaskRef& task, const std::string& worker_id, const std::string& message) {
  spdlog::error("task {}: {}", to_string(task), message);
  if (scheduler_->find(task.job)) return scheduler_->alarm(task, worker_id, message);
  const JobEvent event{0, options_.unix_ms(), EventKind::DeterminismAlarm, {}, to_string(task), worker_id, message};
  store_->write([job = task.job, event](StoreSession& session) { session.append_event(job, event); });
  forget_stored();
}

bool Coordinator::try_answer(const std::string& worker_id, HeldSync& held, Completions& completions) {
  const Time now = options_.now();
  const bool overdue = now >= held.deadline;
  if (!overdue && held.tried == changes_) return false;
  const uint64_t seen = changes_;
  decide_offers(worker_id, held);
  held.tried = seen;
  // A commit takes one disk flush: its verdict is worth the wait.
  const bool undecided =
      std::any_of(held.verdicts.begin(), held.verdicts.end(), [](const auto& v) { return v.first == OfferStatus::Pending; });
  if (undecided && !overdue) return false;
  const Answer answer = scheduler_->answer(worker_id, now);
  if (!overdue && answer.grants.empty() && answer.cancellations.empty() && held.offers.empty()) return false;

  v1::SyncResponse response;
  *response.mutable_protocol() = rpc::this_protocol();
  response.set_leader_term(store_->term());
  if (!address_.empty()) response.add_coordinator_addresses(address_);
  response.set_cluster_id(store_->cluster_id());
  response.set_leader_id(leader_id_);
  response.set_sequence(held.sequence);
  for (const Grant& grant : answer.grants)
    *response.add_grants() = grant_to_wire(grant, must_find(grant.task.job), options_.scheduler.lease);
  for (const auto& [id, reason] : answer.cancellations) {
    v1::LeaseCancellation* cancellation = response.add_cancellations();
    cancellation->set_lease_id(id);
    cancellation->set_reason(static_cast<v1::CancelReason>(static_cast<int>(reason)));
  }
  for (size_t i = 0; i < held.offers.size(); ++i)
    *response.add_verdicts() = verdict_to_wire(held.offers[i], held.verdicts[i].first, held.verdicts[i].second);
  if (std::any_of(held.verdicts.begin(), held.verdicts.end(), [](const auto& v) { return v.first == OfferStatus::Committed; }))
    options_.failpoint("before-verdict");  // a commit is known here, who offered the result is not told
  response.set_next_sync_ms(undecided ? 1000 : 0);
  response.set_notice(answer.notice);
  // A commit that it made just now may still have to be carried out.
  answered_holds_[worker_id] = held.hold;
  completions.push_back([done = std::move(held.done), response = std::move(response)] { done(rpc::Outcome{}, response); });
  return true;
}

}  // namespace woodcock::coordinator
