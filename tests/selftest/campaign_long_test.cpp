// Thousands of random scenes with another seed than the default slice has. False alarms: as there, for 6000 cases 6e-5 in all.
#include "tests/selftest/judge_cases.h"

namespace woodcock::selftest {
namespace {

constexpr uint64_t kSeed = 2, kFurnacesATest = 400, kCasesARelation = 120;

class Furnaces : public ::testing::TestWithParam<int> {};

TEST_P(Furnaces, HaveRadianceOneWhateverStandsInThem) {
  Judge(kSeed).expect_furnaces(static_cast<uint64_t>(GetParam()) * kFurnacesATest, kFurnacesATest);
}
INSTANTIATE_TEST_SUITE_P(Campaign, Furnaces, ::testing::Range(0, 10));

class Relations : public ::testing::TestWithParam<int> {};

TEST_P(Relations, LeaveThePictureAsItIs) { Judge(kSeed).expect_relation(static_cast<Relation>(GetParam()), kCasesARelation); }
INSTANTIATE_TEST_SUITE_P(Campaign, Relations, ::testing::Range(1, kRelationCount), relation_name);

}  // namespace
}  // namespace woodcock::selftest
