// The nets themselves: scenes are the same for the same seed, a wrong one is caught and shrinks, a right one passes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "renderer/selftest/campaign.h"

namespace woodcock::selftest {
namespace {

TEST(Nets, ACaseIsItsSeedAndItsNumber) {
  std::set<std::string> texts;
  for (uint64_t i = 0; i < 40; ++i) {
    const std::string text = scene_text(random_case(3, i, Draw::kBoth).scene);
    EXPECT_EQ(text, scene_text(random_case(3, i, Draw::kBoth).scene));
    EXPECT_TRUE(texts.insert(text).second) << "case " << i << " is one that was there before";
    EXPECT_TRUE(texts.insert(scene_text(random_case(4, i, Draw::kBoth).scene)).second);
  }
}

/// A furnace whose sky lacks a tenth.
Case dim_sky(uint64_t index) {
  Case c = random_case(11, index, Relation::kFurnace);
  for (LightPart& light : c.scene.lights) light.colour *= 0.9;
  return c;
}

TEST(Nets, AFurnaceThatIsTooDarkIsCaughtAndShrinks) {
  int caught = 0, dim = 0;
  Case failing;
  for (uint64_t i = 0; i < 30; ++i) {
    const Case c = dim_sky(i);
    // Under a roof the sky does not count; in a medium around everything it is not seen.
    if (c.scene.lights.empty() || c.scene.medium) continue;
    ++dim;
    if (!judge(c, 5, {}).failed) continue;
    ++caught;
    if (c.scene.bodies.size() > failing.scene.bodies.size()) failing = c;
  }
  EXPECT_GE(dim, 5);
  EXPECT_GE(caught * 2, dim);
  ASSERT_GE(failing.scene.bodies.size(), 2u);
  const Case shrunk = shrink(failing, 5, {}, [] { return true; });
  EXPECT_LT(shrunk.scene.bodies.size(), failing.scene.bodies.size());
  EXPECT_TRUE(judge(shrunk, 5, {}).failed);
  const std::string told = report(judge(shrunk, 5, {}), shrunk, 11);
  EXPECT_THAT(told, ::testing::HasSubstr("woodcock selftest --seed 11"));
  EXPECT_THAT(told, ::testing::HasSubstr("WorldBegin"));
}

TEST(Nets, ARelationThatDoesNotHoldIsCaught) {
  int caught = 0;
  for (uint64_t i = 0; i < 10; ++i) {
    Case c = random_case(12, i, Relation::kPermuted);
    c.relation = Relation::kFurnace;
    c.scene.furnace = false;
    c.scene.lights.push_back({LightForm::kInfinite, DVec3(0.7)});
    caught += judge(c, 5, {}).failed ? 1 : 0;
  }
  EXPECT_GE(caught, 8) << "open scenes are no furnaces";
}

TEST(Nets, ADeviationIsMeasuredAgainstTheScatterOfPixels) {
  std::vector<DVec3> differences(64 * 4);
  Stream random(9);
  for (DVec3& d : differences) d = DVec3(random.uniform() - 0.5);
  EXPECT_GT(worst(compare_with_zero(differences, 0, 0)).p, 1e-3);
  for (DVec3& d : differences) d.y += 0.2;
  const Comparison found = worst(compare_with_zero(differences, 0, 0));
  EXPECT_LT(found.p, 1e-9);
  EXPECT_EQ(found.what, "whole picture, channel 1");
  EXPECT_EQ(worst(compare_with_zero(differences, 0.5, 0)).p, 1);
}

TEST(Nets, WhatRareEventsMayMakeUpForIsNoFailure) {
  const std::vector<DVec3> differences(64 * 64, DVec3(-1e-3));
  EXPECT_EQ(worst(compare_with_zero(differences, 0, 0)).p, 0);
  // One sample in 4000 that brings 4 is missed by 4096 with e⁻¹.
  EXPECT_NEAR(worst(compare_with_zero(differences, 0, 4)).p, std::exp(-1.024), 1e-12);
  EXPECT_LT(worst(compare_with_zero(std::vector<DVec3>(64 * 64, DVec3(-0.05)), 0, 4)).p, 1e-20);
}

TEST(Nets, CoverageCountsFeaturesAndPairs) {
  Coverage coverage;
  coverage.add({"a", "b"});
  coverage.add({"a", "c"});
  EXPECT_EQ(coverage.features().at("a"), 2);
  EXPECT_EQ(coverage.pair("a", "c"), 1);
  EXPECT_EQ(coverage.pair("c", "b"), 0);
  EXPECT_EQ(coverage.pairs_covered(), 2);
  EXPECT_EQ(coverage.pairs_possible(), 3);
}

}  // namespace
}  // namespace woodcock::selftest
