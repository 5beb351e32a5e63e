#include "worker/lease_book.h"

#include <fmt/format.h>

#include <algorithm>

#include "rpc/convert.h"
#include "rpc/limits.h"
#include "rpc/printable.h"

namespace woodcock {
namespace {

constexpr std::chrono::seconds kOfferRetry{3};

v1::LeasePhase phase_of(const std::string& child_phase) {
  if (child_phase == "loading" || child_phase == "idle") return v1::LEASE_PHASE_LOADING;
  if (child_phase == "building") return v1::LEASE_PHASE_BUILDING;
  return v1::LEASE_PHASE_RENDERING;
}

v1::FailureCause to_wire(FailureCause cause) {
  switch (cause) {
    case FailureCause::kCrash:
      return v1::FAILURE_CAUSE_CRASH;
    case FailureCause::kOutOfMemory:
      return v1::FAILURE_CAUSE_OUT_OF_MEMORY;
    case FailureCause::kHang:
      return v1::FAILURE_CAUSE_HANG;
    case FailureCause::kScene:
      return v1::FAILURE_CAUSE_SCENE_ERROR;
    case FailureCause::kMismatch:
      return v1::FAILURE_CAUSE_SCENE_MISMATCH;
    case FailureCause::kTransfer:
      return v1::FAILURE_CAUSE_TRANSFER;
    case FailureCause::kNonFinite:
    case FailureCause::kOutput:
      return v1::FAILURE_CAUSE_OTHER;
  }
  return v1::FAILURE_CAUSE_OTHER;
}

/// Protobuf refuses strings that are not UTF-8, and a child may print anything. An escape may make it longer, and its middle is no
/// place to cut: whole characters stay.
std::string printable(std::string text, size_t limit, bool keep_end) {
  if (text.size() > limit) text = keep_end ? text.substr(text.size() - limit) : text.substr(0, limit);
  text = keep_end ? rpc::printable_lines(text) : rpc::printable(text);
  if (text.size() > limit) text = keep_end ? text.substr(text.size() - limit) : text.substr(0, limit);
  while (!text.empty() && !rpc::is_utf8(text)) keep_end ? text.erase(0, 1) : text.erase(text.size() - 1);
  return text;
}

/// Drops the first `n` elements of what is kept to be said, once it was heard.
template <typename T>
void drop_first(std::vector<T>& list, int n) {
  list.erase(list.begin(), list.begin() + std::min<std::ptrdiff_t>(n, static_cast<std::ptrdiff_t>(list.size())));
}

}  // namespace

LeaseBook::LeaseBook(Spool& spool) : spool_(spool) {
  for (v1::ResultOffer& offer : spool_.offers()) {
    Result result;
    result.offer = std::move(offer);
    result.state = Result::State::kToOffer;  // perhaps uploaded already: the verdict tells
    results_.push_back(std::move(result));
  }
}

LeaseBook::Lease* LeaseBook::find(const std::string& lease_id) {
  const auto it = std::find_if(leases_.begin(), leases_.end(), [&](const Lease& l) { return l.grant.lease_id() == lease_id; });
  return it == leases_.end() ? nullptr : &*it;
}
const LeaseBook::Lease* LeaseBook::find(const std::string& lease_id) const { return const_cast<LeaseBook*>(this)->find(lease_id); }
LeaseBook::Result* LeaseBook::find_result(const std::string& result_key) {
  const auto it = std::find_if(results_.begin(), results_.end(), [&](const Result& r) { return r.offer.result_key() == result_key; });
  return it == results_.end() ? nullptr : &*it;
}
void LeaseBook::erase(const std::string& lease_id) {
  std::erase_if(leases_, [&](const Lease& l) { return l.grant.lease_id() == lease_id; });
}
void LeaseBook::offer_for(v1::ResultOffer& offer, const v1::LeaseGrant& grant) {
  offer.set_lease_id(grant.lease_id());
  offer.set_task_id(grant.task().task_id());
  offer.set_epoch(grant.epoch());
}
void LeaseBook::erase_result(const std::string& result_key) {
  spool_.remove(result_key);
  std::erase_if(results_, [&](const Result& r) { return r.offer.result_key() == result_key; });
}
void LeaseBook::release(const v1::LeaseGrant& grant) {
  v1::LeaseRelease release;
  release.set_lease_id(grant.lease_id());
  release.set_task_id(grant.task().task_id());
  release.set_epoch(grant.epoch());
  releases_.push_back(std::move(release));
  ++news_;
}

// --- the sync call -----------------------------------------------------------------------------------------------

void LeaseBook::fill(v1::SyncRequest& request, BootTime now) {
  const auto room = [](int size) { return static_cast<size_t>(size) < rpc::kMaxSyncListItems; };
  for (Lease& lease : leases_) {
    if (!room(request.leases_size())) break;
    const bool waits = lease.stage == Stage::kToFetch || lease.stage == Stage::kToRender || lease.stage == Stage::kOffering;
    if (waits) ++lease.renewals;
    v1::LeaseReport& report = *request.add_leases();
    report.set_lease_id(lease.grant.lease_id());
    report.set_task_id(lease.grant.task().task_id());
    report.set_epoch(lease.grant.epoch());
    report.set_renewal_counter(lease.renewals);
    report.set_samples_done(static_cast<int64_t>(lease.progress.samples));
    report.set_bounces(static_cast<int64_t>(lease.progress.bounces));
    switch (lease.stage) {
      case Stage::kToFetch:
      case Stage::kToRender:
        report.set_phase(v1::LEASE_PHASE_QUEUED);
        break;
      case Stage::kFetching:
        report.set_phase(v1::LEASE_PHASE_FETCHING);
        break;
      case Stage::kRendering:
        report.set_phase(phase_of(lease.progress.phase));
        break;
      case Stage::kOffering:
        report.set_phase(v1::LEASE_PHASE_OFFERING);
        break;
    }
  }
  for (Result& result : results_) {
    if (!room(request.offers_size())) break;
    if (result.state != Result::State::kToOffer || now < result.not_before) continue;
    *request.add_offers() = result.offer;
  }
  for (const v1::FailureReport& failure : failures_)
    if (room(request.failures_size())) *request.add_failures() = failure;
  for (const v1::LeaseRelease& given_back : releases_)
    if (room(request.releases_size())) *request.add_releases() = given_back;
}

std::vector<std::string> LeaseBook::apply(const v1::SyncRequest& request, BootTime sent_at, const v1::SyncResponse& response,
                                          BootTime now) {
  std::vector<std::string> notes;
  for (const v1::LeaseReport& report : request.leases()) {
    Lease* lease = find(report.lease_id());
    if (lease == nullptr || report.renewal_counter() <= lease->acknowledged) continue;
    lease->acknowledged = report.renewal_counter();
    lease->deadline = sent_at + std::chrono::milliseconds(lease->grant.duration_ms());
  }
  drop_first(failures_, request.failures_size());
  drop_first(releases_, request.releases_size());
  for (const v1::OfferVerdict& verdict : response.verdicts()) take_verdict(verdict, now, notes);
  for (const v1::LeaseCancellation& cancellation : response.cancellations()) take_cancellation(cancellation, notes);
  for (const v1::LeaseGrant& grant : response.grants()) take_grant(grant, now, notes);
  return notes;
}

void LeaseBook::leave_cluster() {
  std::erase_if(leases_, [](Lease& lease) {
    lease.stop = true;
    return lease.stage != Stage::kRendering && lease.stage != Stage::kFetching;
  });
  failures_.clear();
  releases_.clear();
}

void LeaseBook::take_verdict(const v1::OfferVerdict& verdict, BootTime now, std::vector<std::string>& notes) {
  Result* result = find_result(verdict.result_key());
  if (result == nullptr || result->offer.result_digest() != verdict.result_digest()) return;
  switch (verdict.verdict()) {
    case v1::VERDICT_REFUSED:
      notes.push_back(fmt::format("the coordinator refused the result of task {}: {}", result->offer.task_id(), verdict.reason()));
      [[fallthrough]];
    case v1::VERDICT_COMMITTED:
    case v1::VERDICT_ALREADY_COMMITTED:
      erase(result->offer.lease_id());
      // Two jobs may ask for the same result: the other lease has waited for this verdict.
      if (const auto other = std::find_if(
              leases_.begin(), leases_.end(),
              [&](const Lease& l) { return l.stage == Stage::kOffering && l.grant.task().result_key() == verdict.result_key(); });
          other != leases_.end()) {
        offer_for(result->offer, other->grant);
        result->state = Result::State::kToOffer;
        ++news_;
      } else {
        erase_result(verdict.result_key());
      }
      break;
    case v1::VERDICT_UPLOAD_NEEDED:
      result->state = Result::State::kToUpload;
      break;
    default:
      result->not_before = now + kOfferRetry;
      notes.push_back(fmt::format("the coordinator cannot take the result of task {} now: {}", result->offer.task_id(), verdict.reason()));
      break;
  }
}

void LeaseBook::take_cancellation(const v1::LeaseCancellation& cancellation, std::vector<std::string>& notes) {
  Lease* lease = find(cancellation.lease_id());
  if (lease == nullptr || lease->stop) return;
  notes.push_back(fmt::format("task {} is cancelled: {}", lease->grant.task().task_id(), v1::CancelReason_Name(cancellation.reason())));
  // A finished result stays on offer: the verdict decides about it. A slot or the fetcher notices the flag by itself.
  if (lease->stage == Stage::kRendering || lease->stage == Stage::kFetching)
    lease->stop = true;
  else
    erase(cancellation.lease_id());
}

void LeaseBook::take_grant(const v1::LeaseGrant& grant, BootTime now, std::vector<std::string>& notes) {
  if (Lease* known = find(grant.lease_id())) {
    known->grant = grant;
    return;
  }
  if (draining_) {
    release(grant);
    return;
  }
  const std::string& key = grant.task().result_key();
  if (!rpc::is_digest(key) || !rpc::is_identifier(grant.task().task_id()) || grant.duration_ms() <= 0) {
    failed(grant, {FailureCause::kMismatch, "the lease has a malformed result_key, task_id or duration"}, "");
    return;
  }
  Lease lease;
  lease.grant = grant;
  // Counted from the reply, not from the request, which may have been held open for long.
  lease.deadline = now + std::chrono::milliseconds(grant.duration_ms());
  if (Result* result = find_result(key)) {
    // Rendered before, and not acknowledged. An offer for another lease may be under way, whose verdict comes first.
    if (find(result->offer.lease_id()) == nullptr) offer_for(result->offer, grant);
    lease.stage = Stage::kOffering;
    notes.push_back(fmt::format("task {} is in the spool already", grant.task().task_id()));
  }
  leases_.push_back(std::move(lease));
}

std::vector<std::string> LeaseBook::expire(BootTime now) {
  std::vector<std::string> notes;
  std::erase_if(leases_, [&](Lease& lease) {
    if (now < lease.deadline || lease.stop) return false;
    notes.push_back(fmt::format("task {} could not be renewed in time: dropped", lease.grant.task().task_id()));
    lease.stop = true;
    return lease.stage != Stage::kRendering && lease.stage != Stage::kFetching;
  });
  return notes;
}

std::optional<std::chrono::milliseconds> LeaseBook::shortest_duration() const {
  std::optional<std::chrono::milliseconds> shortest;
  for (const Lease& lease : leases_) {
    const std::chrono::milliseconds duration(lease.grant.duration_ms());
    if (!shortest || duration < *shortest) shortest = duration;
  }
  return shortest;
}

// --- fetching ----------------------------------------------------------------------------------------------------

std::optional<v1::LeaseGrant> LeaseBook::next_to_fetch() {
  for (Lease& lease : leases_) {
    if (lease.stage != Stage::kToFetch || lease.stop) continue;
    lease.stage = Stage::kFetching;
    return lease.grant;
  }
  return std::nullopt;
}

void LeaseBook::fetch_moved(const std::string& lease_id) {
  if (Lease* lease = find(lease_id)) ++lease->renewals;
}

void LeaseBook::fetched(const std::string& lease_id) {
  Lease* lease = find(lease_id);
  if (lease == nullptr) return;
  if (lease->stop) return stopped(v1::LeaseGrant(lease->grant));
  lease->stage = Stage::kToRender;
}

std::set<std::string> LeaseBook::manifests_in_use() const {
  std::set<std::string> manifests;
  for (const Lease& lease : leases_) manifests.insert(lease.grant.task().manifest_digest());
  return manifests;
}

// --- rendering ---------------------------------------------------------------------------------------------------

std::optional<v1::LeaseGrant> LeaseBook::next_to_render() {
  for (Lease& lease : leases_) {
    if (lease.stage != Stage::kToRender || lease.stop) continue;
    lease.stage = Stage::kRendering;
    return lease.grant;
  }
  return std::nullopt;
}

void LeaseBook::progressed(const std::string& lease_id, const ChildProgress& progress) {
  if (Lease* lease = find(lease_id)) {
    lease->progress = progress;
    ++lease->renewals;
  }
}

bool LeaseBook::should_stop(const std::string& lease_id, BootTime now) const {
  const Lease* lease = find(lease_id);
  return lease == nullptr || lease->stop || now >= lease->deadline;
}

void LeaseBook::rendered(const v1::LeaseGrant& grant, const RenderedTile& tile) {
  v1::ResultOffer offer;
  offer_for(offer, grant);
  offer.set_result_key(tile.result_key);
  offer.set_result_digest(tile.digest);
  offer.set_bytes(static_cast<int64_t>(tile.bytes));
  offer.mutable_cost()->set_cpu_ns(static_cast<int64_t>(tile.cpu_seconds * 1e9));
  offer.mutable_cost()->set_wall_ns(static_cast<int64_t>(tile.seconds * 1e9));
  offer.mutable_cost()->set_samples(static_cast<int64_t>(tile.samples));
  v1::HealthCounts& health = *offer.mutable_cost()->mutable_health();
  health.set_nonfinite_samples(static_cast<int64_t>(tile.nonfinite));
  health.set_clamped_samples(static_cast<int64_t>(tile.clamped));
  health.set_majorant_violations(static_cast<int64_t>(tile.majorant_violations));
  health.set_truncated_paths(static_cast<int64_t>(tile.truncated));
  spool_.add(offer);
  if (Lease* lease = find(grant.lease_id())) {
    lease->stage = Stage::kOffering;
    lease->stop = false;
    lease->progress.samples = tile.samples;
  }
  std::erase_if(results_, [&](const Result& r) { return r.offer.result_key() == tile.result_key; });
  Result result;
  result.offer = std::move(offer);
  results_.push_back(std::move(result));
}

void LeaseBook::failed(const v1::LeaseGrant& grant, const AttemptFailure& failure, const std::string& log_tail, bool scene_checked) {
  const Lease* lease = find(grant.lease_id());
  const bool unwanted = lease != nullptr && lease->stop;
  erase(grant.lease_id());
  if (unwanted) return;  // a stale report would only be refused
  v1::FailureReport report;
  report.set_lease_id(grant.lease_id());
  report.set_task_id(grant.task().task_id());
  report.set_epoch(grant.epoch());
  report.set_cause(to_wire(failure.cause));
  report.set_scene_checked(scene_checked);
  report.set_message(printable(failure.reason, rpc::kMaxMessageTextBytes, false));
  report.set_log_excerpt(printable(log_tail, rpc::kMaxLogExcerptBytes, true));
  failures_.push_back(std::move(report));
  ++news_;
}

void LeaseBook::stopped(const v1::LeaseGrant& grant) {
  const bool held = find(grant.lease_id()) != nullptr;
  erase(grant.lease_id());
  if (held && draining_) release(grant);
}

// --- results -----------------------------------------------------------------------------------------------------

std::optional<v1::ResultOffer> LeaseBook::next_to_upload(BootTime now) {
  for (Result& result : results_) {
    if (result.state != Result::State::kToUpload || now < result.not_before) continue;
    result.state = Result::State::kUploading;
    return result.offer;
  }
  return std::nullopt;
}

void LeaseBook::uploaded(const std::string& result_key) {
  if (Result* result = find_result(result_key)) {
    result->state = Result::State::kToOffer;
    result->not_before = BootTime{0};
    ++news_;
  }
}

void LeaseBook::upload_failed(const std::string& result_key, BootTime retry_at) {
  if (Result* result = find_result(result_key)) {
    result->state = Result::State::kToUpload;
    result->not_before = retry_at;
  }
}

void LeaseBook::result_lost(const std::string& result_key) {
  const Result* result = find_result(result_key);
  if (result == nullptr) return;
  const Lease* lease = find(result->offer.lease_id());
  if (lease != nullptr) failed(v1::LeaseGrant(lease->grant), {FailureCause::kTransfer, "the result is damaged on the worker's disk"}, "");
  erase_result(result_key);
  ++news_;
}

// --- draining ----------------------------------------------------------------------------------------------------

void LeaseBook::drain() {
  draining_ = true;
  std::erase_if(leases_, [&](const Lease& lease) {
    const bool waits = lease.stage == Stage::kToFetch || lease.stage == Stage::kToRender;
    if (waits) release(lease.grant);
    return waits;
  });
  for (Lease& lease : leases_) lease.stop = lease.stop || lease.stage == Stage::kFetching;
}

void LeaseBook::stop_rendering() {
  for (Lease& lease : leases_) lease.stop = lease.stop || lease.stage == Stage::kRendering;
}

bool LeaseBook::idle() const { return leases_.empty() && results_.empty() && failures_.empty() && releases_.empty(); }

}  // namespace woodcock
