// What the worker knows about its leases and results: a state machine without thread, network or clock of its own.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "woodcock/v1/workers_service.pb.h"
#include "worker/boot_clock.h"
#include "worker/child_process.h"
#include "worker/spool.h"

namespace woodcock {

/// A lease's way: fetch its scene, wait for a slot, render, offer the result. Deadlines are ours: a lease that could not be
/// renewed for its duration is dropped here, before the coordinator's grace is over, so that a task never runs twice for
/// longer than that (HARD_CASES F02, F13).
class LeaseBook {
 public:
  /// What an earlier process left in the spool is offered again. The spool must outlive this object.
  explicit LeaseBook(Spool& spool);

  // --- the sync call ---------------------------------------------------------------------------------------------

  /// Fills leases, offers, failures and releases, at most 1024 of each. Waiting and offering leases count as progressing.
  void fill(v1::SyncRequest& request, BootTime now);
  /// Takes in the answer to `request`, which was sent at `sent_at`. Returns sentences for the log.
  std::vector<std::string> apply(const v1::SyncRequest& request, BootTime sent_at, const v1::SyncResponse& response, BootTime now);
  /// The cluster is another: nobody waits for what is leased, failed or given back. Results stay on offer.
  void leave_cluster();
  /// Grows with everything that the coordinator should be told without delay.
  uint64_t news() const { return news_; }
  /// Drops leases past their deadline. Returns sentences for the log.
  std::vector<std::string> expire(BootTime now);
  /// The shortest duration among the leases held.
  std::optional<std::chrono::milliseconds> shortest_duration() const;

  // --- fetching --------------------------------------------------------------------------------------------------

  /// The next lease whose scene is to be fetched; it is then in phase FETCHING.
  std::optional<v1::LeaseGrant> next_to_fetch();
  /// Bytes arrived: renews a fetching lease.
  void fetch_moved(const std::string& lease_id);
  void fetched(const std::string& lease_id);
  std::set<std::string> manifests_in_use() const;

  // --- rendering -------------------------------------------------------------------------------------------------

  std::optional<v1::LeaseGrant> next_to_render();
  /// Moves the renewal counter: call it only for what ChildProcess::run reports as progress.
  void progressed(const std::string& lease_id, const ChildProgress& progress);
  /// True when the lease was cancelled, has expired, or is gone.
  bool should_stop(const std::string& lease_id, BootTime now) const;
  /// The tile lies in the spool under its key: makes the offer durable. A result of a lease that has meanwhile gone is
  /// offered all the same.
  void rendered(const v1::LeaseGrant& grant, const RenderedTile& tile);
  /// `scene_checked`: the files that the attempt read have their digests.
  void failed(const v1::LeaseGrant& grant, const AttemptFailure& failure, const std::string& log_tail, bool scene_checked = false);
  /// The child has stopped. While draining, the lease is given back.
  void stopped(const v1::LeaseGrant& grant);

  // --- results ---------------------------------------------------------------------------------------------------

  /// The next result to upload.
  std::optional<v1::ResultOffer> next_to_upload(BootTime now);
  void uploaded(const std::string& result_key);
  void upload_failed(const std::string& result_key, BootTime retry_at);
  /// The tile is damaged on this disk: the result is forgotten, and its lease reported as failed without blame for the task.
  void result_lost(const std::string& result_key);

  // --- draining --------------------------------------------------------------------------------------------------

  /// Gives back what has not begun.
  void drain();
  /// Stops and gives back what is being rendered.
  void stop_rendering();
  /// No leases, nothing to say.
  bool idle() const;
  size_t unacknowledged_results() const { return results_.size(); }

 private:
  enum class Stage { kToFetch, kFetching, kToRender, kRendering, kOffering };
  struct Lease {
    v1::LeaseGrant grant;
    Stage stage = Stage::kToFetch;
    ChildProgress progress;
    uint64_t renewals = 1;
    uint64_t acknowledged = 0;  // the renewal counter that the coordinator last answered to
    BootTime deadline{0};
    bool stop = false;
  };
  struct Result {
    v1::ResultOffer offer;
    enum class State { kToUpload, kUploading, kToOffer } state = State::kToUpload;
    BootTime not_before{0};  // backoff of upload or offer
  };

  Lease* find(const std::string& lease_id);
  const Lease* find(const std::string& lease_id) const;
  Result* find_result(const std::string& result_key);
  void erase(const std::string& lease_id);
  static void offer_for(v1::ResultOffer& offer, const v1::LeaseGrant& grant);
  void erase_result(const std::string& result_key);
  void release(const v1::LeaseGrant& grant);
  void take_verdict(const v1::OfferVerdict& verdict, BootTime now, std::vector<std::string>& notes);
  void take_cancellation(const v1::LeaseCancellation& cancellation, std::vector<std::string>& notes);
  void take_grant(const v1::LeaseGrant& grant, BootTime now, std::vector<std::string>& notes);

  Spool& spool_;
  std::vector<Lease> leases_;    // in the order they were granted
  std::vector<Result> results_;  // in the order they were made
  std::vector<v1::FailureReport> failures_;
  std::vector<v1::LeaseRelease> releases_;
  bool draining_ = false;
  uint64_t news_ = 0;
};

}  // namespace woodcock
