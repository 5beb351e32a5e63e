// As many schedules as a night has room for.
#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>
#include <thread>

#include "tests/service/simulator/many.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::simulator {
namespace {

TEST(SimulatorLong, AHundredThousandSchedulesHaveNoViolation) {
  const testing::MemoryFolder folder;
  ManyOptions options;
  for (size_t i = 0; i < kProfileNames.size(); ++i) options.profiles.push_back(static_cast<Profile>(i));
  options.schedules = 100'000;
  options.processes = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  options.progress_seconds = 60;
  const Many many = play_many(options, folder.path(), std::cout);
  std::cout << describe(many) << std::endl;
  EXPECT_EQ(many.violations.size(), 0U);
  EXPECT_EQ(many.schedules, options.schedules);
  for (size_t i = 0; i < kFaultKinds; ++i) EXPECT_GT(many.sum.injected.faults[i], 1000) << kFaultNames[i];
  for (size_t i = 0; i < kMishapKinds; ++i) EXPECT_GT(many.sum.injected.mishaps[i], 1000) << kMishapNames[i];
}

}  // namespace
}  // namespace woodcock::simulator
