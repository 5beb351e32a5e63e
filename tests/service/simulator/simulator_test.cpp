// Random schedules of faults against the production coordinator, store and lease book, in virtual time. A schedule that fails prints the
// command that plays it again, with its journal. tests/faults/mutants.txt says which of these tests notice which defence that is gone.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <sstream>
#include <string>

#include "coordinator/failpoint.h"
#include "tests/service/simulator/simulation.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::simulator {
namespace {

constexpr int kSchedules = 25;

/// Plays the schedules of these seeds. What they were made of is returned, summed.
Outcome play(Profile profile, int schedules, uint64_t first = 1) {
  const testing::MemoryFolder folder;
  Outcome sum;
  for (uint64_t seed = first; seed < first + static_cast<uint64_t>(schedules); ++seed) {
    const Outcome outcome = simulate(profile, seed, folder.path());
    EXPECT_FALSE(outcome.violation) << *outcome.violation << "\n  " << command_for(profile, seed);
    if (outcome.violation) break;
    sum.add(outcome);
  }
  EXPECT_GE(sum.acknowledged, schedules);
  return sum;
}

TEST(Simulator, F02_reports_with_other_epochs_change_nothing) { play(Profile::kStaleLeases, kSchedules); }

TEST(Simulator, F03_nothing_acknowledged_is_lost_when_the_power_goes) {
  EXPECT_GE(play(Profile::kPowerCuts, 3 * kSchedules).power_cuts, kSchedules);
}

TEST(Simulator, F05_messages_that_come_twice_late_or_never_count_once) { play(Profile::kRepeatedMessages, kSchedules); }

TEST(Simulator, F06_damaged_bytes_are_never_a_result) { EXPECT_GE(play(Profile::kDamagedBytes, kSchedules).damaged, 1); }

TEST(Simulator, F07_a_poisoned_task_spoils_nothing_else) { EXPECT_GE(play(Profile::kPoison, kSchedules).failed_attempts, kSchedules); }

TEST(Simulator, F16_no_lease_expires_because_the_coordinator_was_away) {
  EXPECT_GE(play(Profile::kRestarts, kSchedules).restarts, 3 * kSchedules);
}

TEST(Simulator, F17_an_outdated_leader_changes_nothing) {
  EXPECT_GE(play(Profile::kOutdatedLeader, kSchedules).outdated_leaders, kSchedules);
}

TEST(Simulator, EveryFaultAtOnceLosesNothingAndEndsEveryJob) { play(Profile::kEverything, 2 * kSchedules); }

TEST(Simulator, EveryFailpointEndsTheCoordinatorInSomeSchedule) {
  const testing::MemoryFolder folder;
  std::set<std::string> missing(coordinator::failpoints().begin(), coordinator::failpoints().end());
  // No schedule deletes or copies anything.
  for (const char* point : {"job-taken-out", "job-rows-deleted", "marked", "backup-database-copied", "backup-blobs-taken"})
    EXPECT_EQ(missing.erase(point), 1U) << point;
  for (uint64_t seed = 1; seed <= 2000 && !missing.empty(); ++seed)
    for (const std::string& point :
         simulate(seed % 2 == 0 ? Profile::kPowerCuts : Profile::kRestarts, 5000 + seed, folder.path()).crashed_at)
      missing.erase(point);
  EXPECT_THAT(missing, ::testing::IsEmpty());
}

TEST(Simulator, ASeedIsPlayedTheSameEachTime) {
  const testing::MemoryFolder folder;
  for (const uint64_t seed : {1, 2, 3, 4, 5, 6, 7, 8}) {
    std::ostringstream first, second;
    simulate(Profile::kEverything, seed, folder.path(), &first);
    simulate(Profile::kEverything, seed, folder.path(), &second);
    EXPECT_GT(first.str().size(), 1000U);
    EXPECT_EQ(first.str(), second.str()) << "seed " << seed;
  }
}

}  // namespace
}  // namespace woodcock::simulator
