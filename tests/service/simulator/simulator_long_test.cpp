// As many schedules as a night has room for.
#include <gtest/gtest.h>

#include "tests/service/simulator/simulation.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::simulator {
namespace {

TEST(SimulatorLong, AHundredThousandSchedulesHaveNoViolation) {
  const testing::MemoryFolder folder;
  for (uint64_t seed = 1; seed <= 100'000; ++seed) {
    const auto profile = static_cast<Profile>(seed % kProfileNames.size());
    const Outcome outcome = simulate(profile, seed, folder.path());
    ASSERT_FALSE(outcome.violation) << *outcome.violation << "\n  " << command_for(profile, seed);
  }
}

}  // namespace
}  // namespace woodcock::simulator
