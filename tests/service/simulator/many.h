// Many schedules, by several processes at once.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "tests/service/simulator/simulation.h"

namespace woodcock::simulator {

struct ManyOptions {
  std::vector<Profile> profiles;  ///< by the seed, in turn
  uint64_t first = 1;             ///< seed
  int64_t schedules = 1000;       ///< of the seeds from the first on
  int processes = 1;
  double progress_seconds = 10;  ///< between two lines of progress
  std::function<Outcome(Profile, uint64_t seed, const std::filesystem::path&)> play =
      [](Profile profile, uint64_t seed, const std::filesystem::path& folder) { return simulate(profile, seed, folder); };
};

struct Many {
  int64_t schedules = 0;  ///< that were played
  double seconds = 0;
  std::vector<std::string> violations;  ///< each with the command that plays its schedule again
  Outcome sum;
};

/// Plays the schedules in the folder, which must be empty. Ends early after ten violations. Only where there are no threads: it forks.
Many play_many(const ManyOptions& options, const std::filesystem::path& folder, std::ostream& progress);

/// All counts, one after the other.
std::string describe(const Many& many);

}  // namespace woodcock::simulator
