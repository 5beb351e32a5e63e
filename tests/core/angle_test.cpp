// Angles against the C library in long double.
#include "renderer/core/angle.h"

#include <gtest/gtest.h>

#include <numbers>

namespace woodcock {
namespace {

using Long = long double;
constexpr Long kLongPi = std::numbers::pi_v<Long>;

TEST(Angle, SineAndCosineHaveThirteenDigitsOverAWholeTurn) {
  for (int i = 0; i <= 100000; ++i) {
    const double a = static_cast<double>(2 * kLongPi * i / 100000);
    const DVec2 v = cos_sin(a);
    ASSERT_NEAR(v.x, static_cast<double>(std::cos(Long(a))), 1e-13) << a;
    ASSERT_NEAR(v.y, static_cast<double>(std::sin(Long(a))), 1e-13) << a;
  }
  EXPECT_EQ(cos_sin(0), DVec2(1, 0));
}

TEST(Angle, SmallAnglesKeepTheRelativePrecisionOfTheirSine) {
  for (double a = 0.7; a > 1e-300; a /= 3) EXPECT_NEAR(cos_sin(a).y / std::sin(a), 1, 1e-13) << a;
}

TEST(Angle, SineAndCosineOfAnOctantAreRoundedLikeAFloat) {
  for (int i = -10000; i <= 10000; ++i) {
    const float a = kPi / 4 * static_cast<float>(i) / 10000;
    const Vec2 v = cos_sin_of_octant(a);
    ASSERT_NEAR(static_cast<double>(v.x), std::cos(static_cast<double>(a)), 0x1p-23) << a;
    ASSERT_NEAR(static_cast<double>(v.y), std::sin(static_cast<double>(a)), 0x1p-23) << a;
  }
  EXPECT_EQ(cos_sin_of_octant(0), Vec2(1, 0));
}

TEST(Angle, TheAngleOfAPointIsThatOfTheLibraryInEveryQuadrantAndAtEveryScale) {
  for (const double scale : {1e-150, 1e-9, 1.0, 1e150})
    for (int i = 0; i < 100000; ++i) {
      const Long a = kLongPi * (2 * (Long(i) + 0.5L) / 100000 - 1);
      const DVec2 p(scale * static_cast<double>(std::cos(a)), scale * static_cast<double>(std::sin(a)));
      ASSERT_NEAR(angle_of(p) / static_cast<double>(std::atan2(Long(p.y), Long(p.x))), 1, 1e-14) << p.x << ' ' << p.y;
    }
  for (double y = 1e-300; y < 1; y *= 7) EXPECT_NEAR(angle_of({1, y}) / std::atan(y), 1, 1e-14) << y;
}

TEST(Angle, TheAxesAndTheOriginHaveTheirAngles) {
  EXPECT_EQ(angle_of({1, 0}), 0);
  EXPECT_EQ(angle_of({0, 1}), std::numbers::pi / 2);
  EXPECT_EQ(angle_of({-1, 0.0}), std::numbers::pi);
  EXPECT_EQ(angle_of({-1, -0.0}), -std::numbers::pi);
  EXPECT_EQ(angle_of({0, -1}), -std::numbers::pi / 2);
  EXPECT_EQ(angle_of({0, 0}), 0);
  EXPECT_NEAR(angle_of({1, 1}), std::numbers::pi / 4, 1e-15);
}

}  // namespace
}  // namespace woodcock
