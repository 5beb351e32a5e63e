// Schedules that several processes play.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>

#include "tests/service/simulator/many.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::simulator {
namespace {

using ::testing::HasSubstr;

ManyOptions all_profiles(int64_t schedules, int processes) {
  ManyOptions options;
  for (size_t i = 0; i < kProfileNames.size(); ++i) options.profiles.push_back(static_cast<Profile>(i));
  options.schedules = schedules;
  options.processes = processes;
  return options;
}

TEST(ManySchedules, AreTheSameWhoeverPlaysThem) {
  Many by_one, by_three;
  std::ostringstream progress;
  for (Many* many : {&by_one, &by_three}) {
    const testing::MemoryFolder folder;
    ManyOptions options = all_profiles(24, many == &by_one ? 1 : 3);
    options.progress_seconds = 0;
    *many = play_many(options, folder.path(), progress);
    EXPECT_THAT(many->violations, ::testing::IsEmpty());
  }
  EXPECT_EQ(by_one.schedules, 24);
  EXPECT_EQ(by_three.schedules, 24);
  EXPECT_GT(by_one.sum.acknowledged, 24);
  EXPECT_EQ(by_one.sum.acknowledged, by_three.sum.acknowledged);
  EXPECT_EQ(by_one.sum.restarts, by_three.sum.restarts);
  EXPECT_EQ(by_one.sum.crashed_at, by_three.sum.crashed_at);
  EXPECT_EQ(by_one.sum.injected.faults, by_three.sum.injected.faults);
  EXPECT_EQ(by_one.sum.injected.mishaps, by_three.sum.injected.mishaps);
  EXPECT_THAT(progress.str(), HasSubstr(" of 24 schedules in "));
}

TEST(ManySchedules, AViolationIsToldWithTheCommandThatPlaysItAgain) {
  ManyOptions options = all_profiles(16, 2);
  options.first = 100;
  options.play = [](Profile, uint64_t seed, const std::filesystem::path&) {
    Outcome outcome;
    if (seed == 107) outcome.violation = "a lease \"ends\"\nwithout a reason";
    return outcome;
  };
  const testing::MemoryFolder folder;
  std::ostringstream progress;
  const Many many = play_many(options, folder.path(), progress);
  ASSERT_EQ(many.violations.size(), 1U);
  EXPECT_EQ(many.violations[0], "a lease \"ends\"\nwithout a reason\n  " + command_for(static_cast<Profile>(107 % 8), 107));
  EXPECT_EQ(many.schedules, 16);
  EXPECT_THAT(describe(many), HasSubstr("16 schedules"));
  EXPECT_THAT(describe(many), HasSubstr("1 violations"));
}

TEST(ManySchedules, AProcessThatEndsIsAViolationOfTheScheduleThatItPlayed) {
  ManyOptions options = all_profiles(16, 2);
  options.play = [](Profile, uint64_t seed, const std::filesystem::path&) {
    if (seed == 6) ::_exit(3);
    return Outcome();
  };
  const testing::MemoryFolder folder;
  std::ostringstream progress;
  const Many many = play_many(options, folder.path(), progress);
  ASSERT_EQ(many.violations.size(), 1U);
  EXPECT_THAT(many.violations[0], HasSubstr("ended with code 3"));
  EXPECT_THAT(many.violations[0], HasSubstr("--seed 6"));
}

TEST(ManySchedules, TenViolationsAreEnough) {
  ManyOptions options = all_profiles(1'000'000, 2);
  options.play = [](Profile, uint64_t, const std::filesystem::path&) {
    Outcome outcome;
    outcome.violation = "always";
    return outcome;
  };
  const testing::MemoryFolder folder;
  std::ostringstream progress;
  const Many many = play_many(options, folder.path(), progress);
  EXPECT_GE(many.violations.size(), 10U);
  EXPECT_LT(many.schedules, options.schedules);
}

}  // namespace
}  // namespace woodcock::simulator
