// N74 on random scenes: a slice with fixed seeds. campaign_long_test.cpp has thousands.
//
// False alarms: a case of a right renderer fails with 1e-8 (campaign.h); one of 150 features deviates in the mean of its furnaces by five
// standard deviations with 1e-4. Seeds are fixed, so a failure is a change of the program.
#include "tests/selftest/judge_cases.h"

namespace woodcock::selftest {
namespace {

constexpr uint64_t kSeed = 1, kFurnacesATest = 100, kCasesARelation = 20;

class Furnaces : public ::testing::TestWithParam<int> {};

TEST_P(Furnaces, N74_have_radiance_one_whatever_stands_in_them) {
  Judge(kSeed).expect_furnaces(static_cast<uint64_t>(GetParam()) * kFurnacesATest, kFurnacesATest);
}
INSTANTIATE_TEST_SUITE_P(HardCases, Furnaces, ::testing::Range(0, 6));

class Relations : public ::testing::TestWithParam<int> {};

TEST_P(Relations, N74_leave_the_picture_as_it_is) { Judge(kSeed).expect_relation(static_cast<Relation>(GetParam()), kCasesARelation); }
INSTANTIATE_TEST_SUITE_P(HardCases, Relations, ::testing::Range(1, kRelationCount), relation_name);

}  // namespace
}  // namespace woodcock::selftest
