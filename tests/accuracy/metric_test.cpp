// SSIM and FLIP against values of other programs (tests/accuracy/metric_values.py): SSIM by scikit-image 0.19.3's
// `structural_similarity`, FLIP by NumPy and SciPy with two-dimensional filters, after the formulas and constants of the authors'
// Python program.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "renderer/accuracy/flip.h"
#include "renderer/accuracy/ssim.h"
#include "tests/accuracy/metric_pictures.h"

namespace woodcock {
namespace {

using testing::metric_base;
using testing::metric_picture;
using testing::MetricNoise;

/// The linear picture whose sRGB codes are `code(x, y, channel)`, clamped to [0, 1].
template <typename Code>
Picture encoded_picture(const Code& code) {
  return metric_picture([&](int x, int y, int c) { return srgb_decode(std::clamp(code(x, y, c), 0.0, 1.0)); });
}

Picture noisy_codes() {
  MetricNoise noise(7);
  return encoded_picture([&](int x, int y, int c) { return metric_base(x, y, c) + 0.3 * (noise() - 0.5); });
}
Picture shifted_codes() {
  return encoded_picture([](int x, int y, int c) { return metric_base((x + testing::kMetricWidth - 2) % testing::kMetricWidth, y, c); });
}
Picture tinted_codes() {
  return encoded_picture([](int x, int y, int c) { return metric_base(x, y, c) * (1 - 0.2 * c); });
}

double bright(int x, int y, int c) { return 20 * std::pow(metric_base(x, y, c), 4); }

struct LdrCase {
  const char* name;
  Picture (*test)();
  double ssim, mean, largest, one;
};

TEST(Metrics, SsimAndLdrFlipAreThoseOfOtherPrograms) {
  const Picture reference = encoded_picture(metric_base);
  for (const LdrCase& c : {LdrCase{"noise", noisy_codes, 0.723448940, 0.166731187, 0.408826801, 0.122594471},
                           LdrCase{"shift", shifted_codes, 0.711436726, 0.424081702, 0.732168100, 0.484429558},
                           LdrCase{"tint", tinted_codes, 0.967321592, 0.523270690, 0.678455599, 0.645194304}}) {
    const Picture test = c.test();
    EXPECT_NEAR(*ssim(reference, test), c.ssim, 2e-6) << c.name;
    const Plane map = flip_ldr(reference, test);
    EXPECT_NEAR(mean_of(map), c.mean, 2e-5) << c.name;
    EXPECT_NEAR(*std::max_element(map.values.begin(), map.values.end()), c.largest, 5e-5) << c.name;
    EXPECT_NEAR(map.at(10, 20), c.one, 5e-5) << c.name;
  }
}

TEST(Metrics, HdrFlipIsThatOfAnotherProgram) {
  MetricNoise noise(11);
  const Picture reference = metric_picture(bright);
  const auto expect = [](const HdrFlip& flip, double start, double stop, double mean, double largest, double one) {
    EXPECT_NEAR(flip.start, start, 1e-5);
    EXPECT_NEAR(flip.stop, stop, 1e-5);
    EXPECT_EQ(flip.count, 3);
    EXPECT_NEAR(mean_of(flip.map), mean, 2e-5);
    EXPECT_NEAR(*std::max_element(flip.map.values.begin(), flip.map.values.end()), largest, 5e-5);
    EXPECT_NEAR(flip.map.at(10, 20), one, 5e-5);
  };
  expect(flip_hdr(reference, metric_picture([&](int x, int y, int c) { return bright(x, y, c) * (0.4 + 1.2 * noise()); })), -2.055508,
         0.279873, 0.185841035, 0.576952155, 0.199147987);
  expect(flip_hdr(reference, metric_picture([](int x, int y, int c) {
                    return bright(x, (y + testing::kMetricHeight - 1) % testing::kMetricHeight, c);
                  })),
         -2.055508, 0.279873, 0.393855899, 0.984573820, 0.323579311);
  expect(flip_hdr(metric_picture([](int x, int y, int c) { return 0.01 * bright(x, y, c); }),
                  metric_picture([](int x, int y, int c) { return 0.009 * bright(x, y, c); })),
         4.588348, 6.923729, 0.144340744, 0.201087852, 0.122184122);
}

TEST(Metrics, EqualPicturesDifferByNothing) {
  const Picture a = metric_picture(bright), black = metric_picture([](int, int, int) { return 0.0; });
  EXPECT_DOUBLE_EQ(*ssim(a, a), 1);
  for (const Picture& p : {a, black}) {
    EXPECT_EQ(mean_of(flip_hdr(p, p).map), 0);
    EXPECT_EQ(mean_of(flip_ldr(displayed(p), displayed(p))), 0);
  }
  EXPECT_GT(mean_of(flip_hdr(black, a).map), 0.5);
}

TEST(Metrics, SsimNeedsAWholeWindow) {
  EXPECT_FALSE(ssim(Plane(10, 40), Plane(10, 40)).has_value());
  EXPECT_TRUE(ssim(Plane(11, 11), Plane(11, 11)).has_value());
}

TEST(Metrics, ErrorColoursGrowEvenlyInLightness) {
  // L* of the colour, from its luminance: 97·e, but for what does not fit into sRGB.
  double last = -1;
  for (int i = 0; i <= 100; ++i) {
    const double e = i / 100.0, y = static_cast<double>(luminance(error_colour(e)));
    const double lightness = y > 216.0 / 24389 ? 116 * std::cbrt(y) - 16 : y * 24389 / 27;
    EXPECT_NEAR(lightness, 97 * e, 2.5) << e;
    EXPECT_GT(lightness, last) << e;
    last = lightness;
  }
}

}  // namespace
}  // namespace woodcock
