// Who submits jobs, looks at them, cancels, pauses and extends them; every call is repeated until its answer arrives.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/coordinator.h"
#include "tests/service/simulator/world.h"

namespace woodcock::simulator {

class Client {
 public:
  /// `manifest_digest`: of a scene that the coordinator has.
  Client(World& world, const std::string& manifest_digest);

  /// Every wish is granted, and every job has ended.
  bool satisfied() const;
  /// What the jobs have become, and that their faults allow it.
  void check_end(coordinator::Coordinator& coordinator);
  /// For the journal of a schedule that does not end.
  std::string describe() const;

 private:
  struct Job {
    v1::SubmitJobRequest request;
    std::string id;
    int64_t samples = 0;
    bool accepted = false, cancel_asked = false, cancelled = false, extend_asked = false, paused = false;
    int wishes = 0;  ///< that are not granted yet
    std::optional<v1::Job> seen;
    Time granted = 0, asked = 0;  ///< when the last wish was, and when what is seen was asked for
    std::map<int64_t, std::string> events;
    int64_t cursor = 0;
  };
  /// What a call answers: a job and its events, as far as it tells them.
  using Work = std::function<v1::WatchJobResponse(coordinator::Coordinator&)>;
  using Answered = std::function<void(bool succeeded, const v1::WatchJobResponse&)>;

  v1::SubmitJobRequest request(int number, const std::string& manifest_digest);
  /// Makes the call until it is answered; `work` may throw RpcError, which is an answer unless it says that a repetition helps.
  void ask(Job& job, const std::string& what, Work work, Answered answered);
  void submit(Job& job);
  void wish(Job& job);
  void watch(Job& job);
  void take_events(Job& job, const v1::WatchJobResponse& response);

  World& world_;
  std::vector<Job> jobs_;
};

}  // namespace woodcock::simulator
