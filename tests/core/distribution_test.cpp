// Discrete and piecewise-constant distributions.
#include "renderer/core/distribution.h"

#include <gtest/gtest.h>

#include "renderer/core/random.h"

namespace woodcock {
namespace {

TEST(DiscreteDistribution, NeverGivesAnIndexOfWeightZero) {
  const DiscreteDistribution d({0, 0, 2, 0, 1e-30, 3, 0, 0});
  for (int i = 0; i < 1 << 16; ++i) {
    const auto s = d.sample(static_cast<double>(i) / (1 << 16));
    EXPECT_TRUE(s.index == 2 || s.index == 5) << s.index;
    EXPECT_GE(s.remainder, 0);
    EXPECT_LT(s.remainder, 1);
  }
  EXPECT_EQ(d.sample(0).index, 2U);
  EXPECT_EQ(d.sample(0x1.fffffffffffffp-1).index, 5U);
  EXPECT_DOUBLE_EQ(d.probability(2), 0.4);
  EXPECT_EQ(d.probability(3), 0);
  EXPECT_EQ(DiscreteDistribution({0, 0}).total(), 0);
  EXPECT_EQ(DiscreteDistribution().total(), 0);
}

TEST(DiscreteDistribution, RemainderIsUniform) {
  const DiscreteDistribution d({1, 3, 4});
  double sum = 0;
  constexpr int kDraws = 1 << 16;
  for (int i = 0; i < kDraws; ++i) sum += d.sample((i + 0.5) / kDraws).remainder;
  EXPECT_NEAR(sum / kDraws, 0.5, 1e-4);
}

TEST(PiecewiseConstant2D, SamplesHaveTheDensityThatPdfTells) {
  constexpr int kWidth = 3, kHeight = 2;
  const PiecewiseConstant2D d(kWidth, kHeight, {1, 0, 3, 0, 0.5f, 1.5f});
  std::vector<double> count(kWidth * kHeight);
  Stream random(3);
  constexpr int kDraws = 200000;
  for (int i = 0; i < kDraws; ++i) {
    const DVec2 p = d.sample({random.uniform_double(), random.uniform_double()});
    const IVec2 cell = d.cell_of(p);
    count[static_cast<size_t>(cell.y * kWidth + cell.x)] += 1;
    EXPECT_GT(d.pdf(p), 0);
  }
  double integral = 0;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const double p = d.pdf({(x + 0.5) / kWidth, (y + 0.5) / kHeight}) / (kWidth * kHeight);
      integral += p;
      // Five standard deviations of a binomial count: a false alarm in 1.7 million cells.
      EXPECT_NEAR(count[static_cast<size_t>(y * kWidth + x)], kDraws * p, 5 * std::sqrt(kDraws * p * (1 - p)));
    }
  EXPECT_DOUBLE_EQ(integral, 1);
}

}  // namespace
}  // namespace woodcock
