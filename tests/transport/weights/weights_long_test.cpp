// The same as weights_test.cpp over a thousand random scenes and more than a million contributions.
#include <gtest/gtest.h>

#include <cstdio>

#include "tests/transport/weights/weights_check.h"

namespace woodcock::testing {
namespace {

TEST(WeightsLong, N69_weights_sum_to_one_over_a_thousand_scenes_and_a_million_contributions) {
  CheckReport report;
  constexpr int kScenes = 1200;
  for (uint64_t i = 1; i <= kScenes; ++i) report.add(check_random_scene(1000 + i, 1500));
  std::puts(describe(report).c_str());
  EXPECT_EQ(report.failed, 0) << describe(report);
  EXPECT_GT(report.total(), 1000000);
  EXPECT_LT(report.too_near, report.total() / 500);
}

}  // namespace
}  // namespace woodcock::testing
