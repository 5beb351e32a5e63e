#include "coordinator/sync_wire.h"

#include <algorithm>

#include "coordinator/policy.h"
#include "rpc/convert.h"
#include "rpc/error.h"
#include "rpc/limits.h"

namespace woodcock::coordinator {
namespace {

void check_list(int size, const char* name) {
  if (static_cast<size_t>(size) > rpc::kMaxSyncListItems) rpc::fail_exhausted(std::string(name) + ": at most 1024 in one call");
}

void check_text(const std::string& text, size_t limit, const char* name) {
  if (text.size() > limit) rpc::fail_invalid(std::string(name) + ": expected at most " + std::to_string(limit) + " bytes");
}

/// What users see in lists of workers.
void check_shown(const std::string& text, size_t limit, const char* name) {
  check_text(text, limit, name);
  if (!rpc::is_plain_text(text)) rpc::fail_invalid(std::string(name) + ": expected text without control characters");
}

FailureCause cause_from_wire(v1::FailureCause cause) {
  switch (cause) {
    case v1::FAILURE_CAUSE_CRASH:
      return FailureCause::Crash;
    case v1::FAILURE_CAUSE_OUT_OF_MEMORY:
      return FailureCause::OutOfMemory;
    case v1::FAILURE_CAUSE_HANG:
      return FailureCause::Hang;
    case v1::FAILURE_CAUSE_SCENE_ERROR:
      return FailureCause::SceneError;
    case v1::FAILURE_CAUSE_SCENE_MISMATCH:
      return FailureCause::SceneMismatch;
    case v1::FAILURE_CAUSE_TRANSFER:
      return FailureCause::Transfer;
    default:
      return FailureCause::Other;
  }
}

}  // namespace

WorkerReport report_from_wire(const v1::SyncRequest& request) {
  if (request.protocol().major() != rpc::kProtocolMajor)
    rpc::fail_precondition("this coordinator speaks protocol " + std::to_string(rpc::kProtocolMajor) + ", the worker speaks " +
                           std::to_string(request.protocol().major()) + "; install matching programs");
  if (!rpc::is_identifier(request.worker_id())) rpc::fail_invalid("worker_id: expected 1 to 64 characters of [A-Za-z0-9._-]");
  if (request.slots() < 1 || request.slots() > rpc::kMaxSlots) rpc::fail_invalid("slots: expected 1 to 256");
  if (request.build().empty() || request.arithmetic_class().empty()) rpc::fail_invalid("build and arithmetic_class are required");
  if (request.state() == v1::WORKER_STATE_UNSPECIFIED) rpc::fail_invalid("state is required");
  check_shown(request.host_name(), 255, "host_name");
  check_shown(request.build(), rpc::kMaxBuildBytes, "build");
  check_shown(request.arithmetic_class(), rpc::kMaxBuildBytes, "arithmetic_class");
  if (!request.cluster_id().empty() && !rpc::is_identifier(request.cluster_id()))
    rpc::fail_invalid("cluster_id: expected at most 64 characters of [A-Za-z0-9._-]");
  if (request.leader_term() >= uint64_t{1} << 31) rpc::fail_invalid("leader_term: expected less than 2^31");
  check_list(request.leases_size(), "leases");
  check_list(request.offers_size(), "offers");
  check_list(request.failures_size(), "failures");
  check_list(request.releases_size(), "releases");

  WorkerReport report;
  report.worker_id = request.worker_id();
  report.host_name = request.host_name();
  report.build = request.build();
  report.arithmetic_class = request.arithmetic_class();
  report.incarnation = request.incarnation();
  report.sequence = request.sequence();
  report.slots = static_cast<int>(request.slots());
  report.threads = static_cast<int>(std::clamp<uint32_t>(request.threads(), 1, 4096));
  report.draining = request.state() == v1::WORKER_STATE_DRAINING;
  report.left = request.state() == v1::WORKER_STATE_LEFT;
  report.tags = checked_tags({request.tags().begin(), request.tags().end()}, "tags");
  report.memory = std::clamp<int64_t>(request.memory_bytes(), 0, rpc::kMaxWorkerMemory);
  for (const v1::LeaseReport& lease : request.leases()) {
    check_text(lease.lease_id(), rpc::kMaxIdBytes, "leases.lease_id");
    check_text(lease.task_id(), rpc::kMaxIdBytes, "leases.task_id");
    report.leases.push_back({lease.lease_id(), lease.task_id(), lease.epoch(), lease.renewal_counter(), lease.phase(),
                             std::clamp<int64_t>(lease.samples_done(), 0, int64_t{1} << 62)});
  }
  for (const v1::ResultOffer& offer : request.offers()) report.offered_leases.push_back(offer.lease_id());
  for (const v1::FailureReport& failure : request.failures()) {
    check_text(failure.message(), rpc::kMaxMessageTextBytes, "failures.message");
    check_text(failure.log_excerpt(), rpc::kMaxLogExcerptBytes, "failures.log_excerpt");
    report.failures.push_back({failure.lease_id(), failure.task_id(), failure.epoch(), cause_from_wire(failure.cause()), failure.message(),
                               failure.log_excerpt(), failure.scene_checked()});
  }
  for (const v1::LeaseRelease& release : request.releases()) report.releases.push_back({release.lease_id(), release.epoch()});
  return report;
}

std::vector<Offer> offers_from_wire(const v1::SyncRequest& request) {
  std::vector<Offer> offers;
  for (const v1::ResultOffer& wire : request.offers()) {
    check_text(wire.lease_id(), rpc::kMaxIdBytes, "offers.lease_id");
    check_text(wire.task_id(), rpc::kMaxIdBytes, "offers.task_id");
    Offer offer;
    offer.lease_id = wire.lease_id();
    offer.task_id = wire.task_id();
    offer.epoch = wire.epoch();
    offer.result.key = rpc::checked_digest(wire.result_key(), "offers.result_key");
    offer.result.digest = rpc::checked_digest(wire.result_digest(), "offers.result_digest");
    if (wire.bytes() < 0 || wire.bytes() > rpc::kMaxBlobBytes) rpc::fail_invalid("offers.bytes: out of bounds");
    offer.result.bytes = wire.bytes();
    const auto bounded = [](int64_t value) { return std::clamp<int64_t>(value, 0, int64_t{1} << 53); };
    offer.result.cost = {bounded(wire.cost().cpu_ns()), bounded(wire.cost().wall_ns()), bounded(wire.cost().samples())};
    // A million tasks of so many add up within 64 bits.
    const auto counted = [](int64_t value) { return std::clamp<int64_t>(value, 0, int64_t{1} << 42); };
    const v1::HealthCounts& health = wire.cost().health();
    offer.result.health = {counted(health.nonfinite_samples()), counted(health.clamped_samples()), counted(health.majorant_violations()),
                           counted(health.truncated_paths())};
    offers.push_back(std::move(offer));
  }
  return offers;
}

v1::LeaseGrant grant_to_wire(const Grant& grant, const Job& job, Time lease) {
  const Frame& frame = job.frames[static_cast<size_t>(grant.task.frame)];
  v1::LeaseGrant wire;
  wire.set_lease_id(grant.lease_id);
  wire.set_epoch(grant.epoch);
  wire.set_duration_ms(lease / 1'000'000);
  v1::TaskSpec& task = *wire.mutable_task();
  task.set_job_id(grant.task.job);
  task.set_task_id(to_string(grant.task));
  task.set_manifest_digest(frame.spec.manifest_digest);
  task.set_scene_file(frame.spec.scene_file);
  *task.mutable_settings() = rpc::to_wire(job.spec.settings, job.spec.tile_size);
  *task.mutable_header() = rpc::to_wire(frame.pinned_header());
  *task.mutable_rect() = rpc::to_wire(grant.area.rect);
  *task.mutable_range() = rpc::to_wire(grant.area.range);
  task.set_result_key(grant.result_key);
  return wire;
}

v1::OfferVerdict verdict_to_wire(const Offer& offer, OfferStatus status, const std::string& reason) {
  static constexpr v1::Verdict kVerdicts[] = {v1::VERDICT_COMMITTED, v1::VERDICT_ALREADY_COMMITTED, v1::VERDICT_UPLOAD_NEEDED,
                                              v1::VERDICT_REFUSED,   v1::VERDICT_RETRY_LATER,       v1::VERDICT_RETRY_LATER};
  v1::OfferVerdict verdict;
  verdict.set_lease_id(offer.lease_id);
  verdict.set_result_key(offer.result.key);
  verdict.set_result_digest(offer.result.digest);
  verdict.set_verdict(kVerdicts[static_cast<int>(status)]);
  verdict.set_reason(reason);
  return verdict;
}

}  // namespace woodcock::coordinator
