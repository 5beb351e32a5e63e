// Cases of the self test as tests.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string>

#include "renderer/selftest/campaign.h"

namespace woodcock::selftest {

/// The first failure of a test is shrunk; each is told with its scene and the command that repeats it.
class Judge {
 public:
  explicit Judge(uint64_t seed) : seed_(seed) {}

  void expect_right(const Verdict& verdict) {
    if (!verdict.failed) return;
    int attempts = failed_ ? 0 : 150;
    failed_ = true;
    const Case shrunk = shrink(verdict.examined, seed_, {128, 3e6}, [&] { return --attempts > 0; });
    ADD_FAILURE() << report(verdict, shrunk, seed_);
  }

  /// Furnaces first … first + count − 1. No feature's furnaces deviate in the mean by five standard deviations.
  void expect_furnaces(uint64_t first, uint64_t count) {
    Tally tally;
    for (uint64_t i = first; i < first + count; ++i) {
      const Verdict verdict = judge(seed_, i, Draw::kFurnaces, {});
      tally.add(verdict);
      expect_right(verdict);
    }
    const auto [feature, z] = tally.worst_pooled();
    EXPECT_LT(std::abs(z), 5) << "furnaces with " << feature << " deviate in the mean by " << z << " standard deviations";
    EXPECT_GE(tally.comparisons, count * kComparisons * 9 / 10);
  }

  void expect_relation(Relation relation, uint64_t count) {
    uint64_t told = 0;
    for (uint64_t i = 0; i < count; ++i) {
      const Verdict verdict = judge(seed_, i, relation, {});
      told += verdict.first.empty ? 0 : 1;
      expect_right(verdict);
    }
    EXPECT_GE(told, count * 9 / 10) << "few of the scenes are ones of which the relation says something";
  }

 private:
  uint64_t seed_;
  bool failed_ = false;
};

inline std::string relation_name(const ::testing::TestParamInfo<int>& info) {
  std::string name = name_of(static_cast<Relation>(info.param));
  std::erase_if(name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; });
  return name;
}

}  // namespace woodcock::selftest
