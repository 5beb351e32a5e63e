// One schedule: a farm, what goes wrong with it, and what must hold all the same.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <ostream>
#include <set>
#include <string>

#include "tests/service/simulator/plan.h"

namespace woodcock::simulator {

struct Outcome {
  std::optional<std::string> violation;
  std::set<std::string> crashed_at;  ///< failpoints at which the coordinator was ended
  int64_t acknowledged = 0, restarts = 0, power_cuts = 0, outdated_leaders = 0, failed_attempts = 0, damaged = 0;
  Injected injected;

  /// Adds the counts and failpoints of another; a violation stays its own.
  void add(const Outcome& other);
};

/// Plays a schedule in the folder, which must be empty and is empty afterwards. `log` gets a line an event, where it is given.
Outcome simulate(Profile profile, uint64_t seed, const std::filesystem::path& folder, std::ostream* log = nullptr);

/// The command that plays a schedule again, with its journal.
std::string command_for(Profile profile, uint64_t seed);

}  // namespace woodcock::simulator
