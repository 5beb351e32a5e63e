// What the parts of a schedule share: its random numbers, time, disk and network, and what was found wrong.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tests/service/simulator/forgetful_disk.h"
#include "tests/service/simulator/journal.h"
#include "tests/service/simulator/loop.h"
#include "tests/service/simulator/plan.h"
#include "tests/service/simulator/random.h"

namespace woodcock::simulator {

class Checks;
class Client;
class Leader;
class Worker;

enum class Way { kToCoordinator, kFromCoordinator };

struct World {
  World(uint64_t seed, Profile profile, const std::filesystem::path& folder, std::ostream* log);
  ~World();

  /// Delivers a message some time from now, once, more than once or never. `peer` is who talks with the coordinator.
  void send(const std::string& peer, Way way, std::function<void()> deliver);
  /// A time of [low, high].
  Time time(Time low, Time high) { return random.between(low, high); }
  /// Something that must never be. The first is kept, and ends the schedule.
  void violate(const std::string& what);
  /// Whether this goes wrong now: nothing does once the schedule is calm.
  bool goes_wrong(Mishap mishap, double chance) {
    const bool wrong = !calm && random.chance(chance);
    if (wrong) injected.count(mishap);
    return wrong;
  }

  Random random;
  Loop loop;
  Journal journal;
  const Plan plan;
  const std::filesystem::path folder;
  ForgetfulDisk disk;
  bool calm = false;  ///< faults are over
  std::optional<std::string> violation;
  std::map<std::string, std::set<Way>> cut;  ///< links that carry nothing
  int failed_attempts = 0;                   ///< that were made to fail
  std::set<std::string> damaged;             ///< digests of results whose stored bytes were damaged
  std::set<std::string> crashed_at;          ///< failpoints at which the coordinator was ended
  int64_t restarts = 0, power_cuts = 0, outdated_leaders = 0;
  Injected injected;

  // Made in this order, and gone in the other.
  std::unique_ptr<Checks> checks;
  std::unique_ptr<Leader> leader;
  std::vector<std::unique_ptr<Worker>> workers;
  std::unique_ptr<Client> client;
};

}  // namespace woodcock::simulator
