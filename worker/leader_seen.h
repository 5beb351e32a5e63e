// Who answered the worker last: by it a worker tells an outdated leader from the present one, and another cluster from its own.
#pragma once

#include <cstdint>
#include <string>

#include "woodcock/v1/workers_service.pb.h"

namespace woodcock {

class LeaderSeen {
 public:
  /// What an answer is worth: kOutdated ones are left aside; with kOtherCluster the worker joins anew and keeps no lease.
  enum class Answer { kKnown, kRestarted, kOtherCluster, kOutdated };

  /// Takes in who answered, unless it is outdated.
  Answer recognize(const v1::SyncResponse& response) {
    Answer answer = Answer::kKnown;
    if (!cluster_id_.empty() && response.cluster_id() != cluster_id_)
      answer = Answer::kOtherCluster;
    else if (response.leader_term() < leader_term_)
      return Answer::kOutdated;
    else if (!leader_id_.empty() && response.leader_id() != leader_id_)
      answer = Answer::kRestarted;
    cluster_id_ = response.cluster_id();
    leader_id_ = response.leader_id();
    leader_term_ = response.leader_term();
    return answer;
  }
  /// Says in a request whom the worker believes to talk to.
  void fill(v1::SyncRequest& request) const {
    request.set_cluster_id(cluster_id_);
    request.set_leader_term(leader_term_);
    request.set_leader_id(leader_id_);
  }
  const std::string& cluster_id() const { return cluster_id_; }
  uint64_t leader_term() const { return leader_term_; }

 private:
  std::string cluster_id_, leader_id_;
  uint64_t leader_term_ = 0;
};

/// Whether an answer is to `request`, and not the greeting of another cluster than the request was meant for.
inline bool answers(const v1::SyncResponse& response, const v1::SyncRequest& request) {
  return request.cluster_id().empty() || request.cluster_id() == response.cluster_id();
}

}  // namespace woodcock
