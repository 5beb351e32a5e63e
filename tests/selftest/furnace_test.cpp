// N74: in equilibrium the radiance is one, whatever stands in the scene.
#include <gtest/gtest.h>

#include "renderer/selftest/campaign.h"
#include "tests/selftest/judge_cases.h"

namespace woodcock::selftest {
namespace {

/// False alarms: a case of a right renderer fails with 1e-8 (campaign.h), one of 100 features deviates in the mean of its cases by five
/// standard deviations with 6e-5; seeds are fixed.
class Furnaces : public ::testing::TestWithParam<int> {};

TEST_P(Furnaces, N74_have_radiance_one_whatever_stands_in_them) {
  Tally tally;
  judge_cases(kSeed, static_cast<uint64_t>(GetParam()) * kFurnacesATest, kFurnacesATest, Draw::kFurnaces, tally);
  const auto [feature, z] = tally.worst_pooled();
  EXPECT_LT(std::abs(z), 5) << "scenes with " << feature << " deviate in the mean by " << z << " standard deviations";
  EXPECT_GE(tally.comparisons, kFurnacesATest * kComparisons);
}

INSTANTIATE_TEST_SUITE_P(Random, Furnaces, ::testing::Range(0, kFurnaceTests));

}  // namespace
}  // namespace woodcock::selftest
