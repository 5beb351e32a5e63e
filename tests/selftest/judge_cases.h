// Cases of the self test as tests.
#pragma once

#include <gtest/gtest.h>

#include "renderer/selftest/campaign.h"

namespace woodcock::selftest {

inline constexpr uint64_t kSeed = WOODCOCK_SELFTEST_SEED;
/// Scenes: a slice in the default run, thousands in the long one.
inline constexpr int kFurnaceTests = 4;
inline constexpr uint64_t kFurnacesATest = WOODCOCK_SELFTEST_FURNACES / kFurnaceTests;
inline constexpr uint64_t kCasesARelation = WOODCOCK_SELFTEST_RELATIONS;

/// A failure is shrunk and told with its scene and command.
inline void expect_right(const Verdict& verdict, uint64_t seed) {
  if (!verdict.failed) return;
  int attempts = 150;
  const Case shrunk = shrink(verdict.examined, seed, {128, 3e6}, [&] { return --attempts > 0; });
  ADD_FAILURE() << report(verdict, shrunk, seed);
}

inline void judge_cases(uint64_t seed, uint64_t first, uint64_t count, Draw what, Tally& tally) {
  for (uint64_t i = first; i < first + count; ++i) {
    const Verdict verdict = judge(seed, i, what, {});
    tally.add(verdict);
    expect_right(verdict, seed);
  }
}

}  // namespace woodcock::selftest
