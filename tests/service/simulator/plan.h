// What goes wrong in a schedule, and how often: drawn from its seed before it begins.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "tests/service/simulator/loop.h"
#include "tests/service/simulator/random.h"

namespace woodcock::simulator {

/// Which faults a schedule is made of. kEverything takes any of them, and leaves some out.
enum class Profile { kEverything, kStaleLeases, kPowerCuts, kPoison, kRepeatedMessages, kDamagedBytes, kRestarts, kOutdatedLeader };
inline constexpr std::array<const char*, 8> kProfileNames{"everything",        "stale-leases",  "power-cuts", "poison",
                                                          "repeated-messages", "damaged-bytes", "restarts",   "outdated-leader"};
/// Nothing for a name that is none of these.
std::optional<Profile> profile_named(const std::string& name);

/// Faults that happen at moments of their own.
enum class Fault {
  kKillCoordinator,       ///< now
  kKillCoordinatorAt,     ///< at one of the next syncs or failpoints
  kCutCoordinatorsPower,  ///< now
  kCutCoordinatorsPowerAt,
  kStopCoordinator,  ///< by SIGTERM
  kReplaceLeader,    ///< another starts on its folder while it goes on
  kKillWorker,
  kCutWorkersPower,
  kFreezeWorker,  ///< SIGSTOP, later SIGCONT
  kDrainWorker,
  kCutLink,          ///< of a worker, one way or both, for a while
  kStaleReports,     ///< reports with epochs that are not those of the leases, in the name of a worker
  kDamageStoredByte  ///< of a committed result
};
inline constexpr std::array<const char*, 13> kFaultNames{"coordinator killed",
                                                         "coordinator killed at a sync or failpoint",
                                                         "power of the coordinator cut",
                                                         "power of the coordinator cut at a sync or failpoint",
                                                         "coordinator stopped",
                                                         "coordinator replaced while it goes on",
                                                         "worker killed",
                                                         "power of a worker cut",
                                                         "worker frozen",
                                                         "worker drained",
                                                         "link cut",
                                                         "reports with false epochs",
                                                         "stored byte damaged"};
inline constexpr size_t kFaultKinds = kFaultNames.size();

/// What goes wrong with a message, an upload or an attempt, each with a chance of its own.
enum class Mishap {
  kMessageLost,
  kMessageRepeated,
  kMessageLate,
  kUploadDamaged,
  kUploadCut,
  kAttemptCrashed,
  kAttemptSlow,
  kResultMiscomputed,
  kSceneLost
};
inline constexpr std::array<const char*, 9> kMishapNames{"message lost",   "message repeated",   "message late",
                                                         "upload damaged", "upload cut",         "attempt crashed",
                                                         "attempt slow",   "result miscomputed", "scene lost"};
inline constexpr size_t kMishapKinds = kMishapNames.size();

/// How often each kind of fault and of mishap came.
struct Injected {
  std::array<int64_t, kFaultKinds> faults{};
  std::array<int64_t, kMishapKinds> mishaps{};

  void count(Fault fault) { ++faults[static_cast<size_t>(fault)]; }
  void count(Mishap mishap) { ++mishaps[static_cast<size_t>(mishap)]; }
};

struct Plan {
  int workers = 3, jobs = 1;
  Time faulty = 30 * kSecond;                ///< how long there are faults
  Time pause = 2 * kSecond;                  ///< between two of them, in the mean
  std::array<int, kFaultKinds> weight{};     ///< of each kind
  double lose = 0, duplicate = 0, slow = 0;  ///< chance of each message
  double damage_upload = 0, cut_upload = 0;  ///< of each upload
  double crash_task = 0, lose_scene = 0;     ///< of each attempt, of each fetch
  double straggle = 0.05;
  double miscompute = 0;     ///< of each attempt: another result than it should be
  bool poison = false;       ///< the first job has a sample at which every attempt crashes
  bool other_build = false;  ///< the last worker has another render build
  bool adaptive = false;     ///< a job has a target
  bool same_scene = false;   ///< jobs find each other's results
  size_t store_batch = 512;
  Time store_delay = 20 * kMillisecond;  ///< at most, before a transaction begins
};

Plan make_plan(Profile profile, Random& random);

}  // namespace woodcock::simulator
