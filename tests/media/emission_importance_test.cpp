// The average extinction of media, and the density that follows their emission.
#include "renderer/media/emission_importance.h"

#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>

#include "tests/media/grids.h"
#include "tests/support/chi_square.h"

namespace woodcock {
namespace {

Vec3 random_in(Stream& random) { return {random.uniform(), random.uniform(), random.uniform()}; }

/// Fire: a few hot voxels in a box with uneven sides, rotated and scaled, its temperature on a grid of another size.
GridMediumDescription fire() {
  GridMediumDescription d = grid_medium(random_dense({23, 17, 30}, 11, 0.3f), Rgb(0.7f, 0.2f, 0.1f), Rgb(0.5f));
  d.emission = Rgb(3, 1, 0.5f);
  d.emission_grid = std::make_shared<const FloatVolume>(
      make_dense({7, 5, 6}, DVec3(0), DVec3(23, 17, 30), [](IVec3 v) { return v.x > 3 ? static_cast<float>(v.z) : 0.f; }));
  return d;
}
const DMat4 kWorld = glm::scale(glm::rotate(glm::translate(DMat4(1), DVec3(3, -2, 5)), 0.7, DVec3(1, 2, 3)), DVec3(0.1, 0.2, 0.05));

TEST(MeanExtinction, of_grids_is_the_average_over_the_box) {
  // Against a sum over many points; the interpolant is smooth in between, so the midpoint rule is good to a part in a thousand.
  const auto average_over = [](const Medium& m, IVec3 size, const DMat4& world) {
    double sum = 0;
    const int n = 64;
    for (int i = 0; i < n * n * n; ++i) {
      const DVec3 q = (DVec3(i % n, i / n % n, i / n / n) + 0.5) / double(n) * DVec3(size);
      sum += static_cast<double>(average(m.sigma_t(Vec3(DVec3(world * glm::dvec4(q, 1))))));
    }
    return sum / (n * n * n);
  };
  for (const IVec3 size : {IVec3(1, 2, 3), IVec3(8, 4, 5)}) {
    const Medium grid = make_medium(grid_medium(random_dense(size, 1, 0.8f), Rgb(1, 2, 3), Rgb(0, 1, 0)), kWorld);
    EXPECT_NEAR(grid.mean_sigma_t(), average_over(grid, size, kWorld), 2e-3 * grid.mean_sigma_t());
    RgbGridMediumDescription rgb;
    Stream random(2);
    rgb.sigma_a = rgb_volume(size, [&](IVec3) { return Rgb(random_in(random)); });
    rgb.scale = 2;
    const Medium rgb_medium = make_medium(rgb, kWorld);
    EXPECT_NEAR(rgb_medium.mean_sigma_t(), average_over(rgb_medium, size, kWorld), 2e-3 * rgb_medium.mean_sigma_t());
  }
  CloudMediumDescription cloud;
  cloud.sigma_a = Rgb(1);
  cloud.sigma_s = Rgb(2);
  const Medium m = make_medium(cloud);
  EXPECT_NEAR(m.mean_sigma_t(), average_over(m, IVec3(1), DMat4(1)), 0.02 * m.mean_sigma_t());
}

TEST(MeanExtinction, counts_the_terms_that_are_there) {
  const MediumKind kind = HomogeneousDescription{Rgb(1, 2, 3), Rgb(5), Rgb(0), {}};
  EXPECT_NEAR(make_medium(kind).mean_sigma_t(), 7, 1e-6);
  EXPECT_NEAR(make_medium(kind, DMat4(1), DMat4(1), 1, {false, true, true, true}).mean_sigma_t(), 5, 1e-6);
  EXPECT_NEAR(make_medium(kind, DMat4(1), glm::scale(DMat4(1), DVec3(4)), 4).mean_sigma_t(), 7.0 / 4, 1e-6);
}

TEST(EmissionImportance, exist_where_a_grid_emits) {
  EXPECT_NE(make_medium(fire()).emission_importance(), nullptr);
  EXPECT_EQ(make_medium(fire(), DMat4(1), DMat4(1), 1, {true, false, true, true}).emission_importance(), nullptr);
  EXPECT_EQ(make_medium(grid_medium(random_dense(IVec3(4), 1))).emission_importance(), nullptr);
  EXPECT_EQ(make_medium(HomogeneousDescription{Rgb(1), Rgb(1), Rgb(1), {}}).emission_importance(), nullptr);
}

TEST(EmissionImportance, density_is_positive_where_anything_glows_and_zero_outside_of_the_box) {
  const Medium m = make_medium(fire(), kWorld);
  Stream random(12);
  int glowing = 0;
  for (int i = 0; i < 50000; ++i) {
    const DVec3 q = DVec3(23, 17, 30) * (DVec3(random_in(random)) * 1.4 - 0.2);
    const Vec3 p{DVec3(kWorld * glm::dvec4(q, 1))};
    const float pdf = m.emission_importance()->pdf(p);
    ASSERT_GE(pdf, 0);
    if (!is_black(m.at(p).emission)) {
      ASSERT_GT(pdf, 0);
      ++glowing;
    }
    bool outside = false;
    for (int k = 0; k < 3; ++k) outside = outside || q[k] < -1e-4 || q[k] > DVec3(23, 17, 30)[k] + 1e-4;
    if (outside) {
      ASSERT_EQ(pdf, 0);
    }
  }
  EXPECT_GT(glowing, 1000);
  EXPECT_EQ(m.emission_importance()->pdf(Vec3(std::numeric_limits<float>::quiet_NaN())), 0);
}

/// A sum of two fires that overlap in part, and a single one.
std::vector<Medium> emitters() {
  GridMediumDescription other = fire();
  other.emission = Rgb(0, 0, 9);
  const auto part = [](const GridMediumDescription& d, const DMat4& world) {
    return std::make_shared<const Medium>(make_medium(d, world));
  };
  const auto glow = std::make_shared<const Medium>(make_medium(HomogeneousDescription{Rgb(0.1f), Rgb(0), Rgb(1), {}}));
  return {make_medium(fire(), kWorld),
          Medium({part(fire(), kWorld), glow, part(other, glm::translate(DMat4(1), DVec3(0.8, 0.5, 0.2)) * kWorld)})};
}

TEST(EmissionImportance, points_follow_the_density) {
  // χ² over the cells of a lattice around the box, two tests at level 1e-4 with fixed seeds. What the density gives a cell is
  // itself estimated, with 16 times the samples, and its share of the variance is allowed for.
  for (const Medium& m : emitters()) {
    const EmissionImportance& bricks = *m.emission_importance();
    constexpr int kSide = 10, kSamples = 200000, kPoints = 4000000;
    DVec3 low(kInf), high(-kInf);
    std::vector<EmissionImportance::Sample> samples;
    Stream random(21);
    for (int i = 0; i < kSamples; ++i) {
      const Vec3 u = random_in(random);
      samples.push_back(bricks.sample(u, random.uniform_double()));
      low = glm::min(low, samples.back().p);
      high = glm::max(high, samples.back().p);
    }
    const auto cell_of = [&](DVec3 p) {
      const IVec3 c = glm::clamp(IVec3((p - low) / (high - low) * static_cast<double>(kSide)), IVec3(0), IVec3(kSide - 1));
      return static_cast<size_t>((c.z * kSide + c.y) * kSide + c.x);
    };
    std::vector<double> observed(kSide * kSide * kSide, 0), expected(observed), squares(observed);
    int other_brick = 0;
    for (const auto& s : samples) {
      observed[cell_of(s.p)] += 1;
      other_brick += std::abs(bricks.pdf(s.p) - s.pdf) > 1e-6f * s.pdf;
    }
    EXPECT_LT(other_brick, 20);  // rounding to the neighbour
    const DVec3 extent = high - low;
    const double volume = extent.x * extent.y * extent.z;
    double total = 0;
    for (int i = 0; i < kPoints; ++i) {
      const DVec3 p = low + extent * DVec3(random_in(random));
      const double mass = static_cast<double>(bricks.pdf(p)) * volume / kPoints;
      expected[cell_of(p)] += mass * kSamples;
      squares[cell_of(p)] += mass * mass * kSamples * kSamples;
      total += mass;
    }
    EXPECT_NEAR(total, 1, 5e-3);
    double statistic = 0;
    int cells = 0;
    for (size_t c = 0; c < observed.size(); ++c) {
      if (expected[c] < 10) continue;
      statistic += (observed[c] - expected[c]) * (observed[c] - expected[c]) / (expected[c] + squares[c]);
      ++cells;
    }
    EXPECT_GT(cells, 50);
    EXPECT_GT(testing::chi_square_p_value(statistic, cells), 1e-4) << statistic << " over " << cells << " cells";
  }
}

TEST(EmissionImportance, sampled_points_estimate_the_emission_of_the_volume_better_than_uniform_ones) {
  for (const Medium& m : emitters()) {
    const EmissionImportance& bricks = *m.emission_importance();
    Stream random(31);
    const auto emission = [&](Vec3 p) {
      // Without the homogeneous part, whose emission lies outside as well.
      double sum = 0;
      if (m.parts().empty()) return static_cast<double>(average(m.at(p).emission));
      for (const auto& part : m.parts())
        if (!part->is_homogeneous()) sum += static_cast<double>(average(part->at(p).emission));
      return sum;
    };
    double sum = 0, squares = 0, volume_sum = 0, volume_squares = 0;
    const int n = 200000;
    DVec3 low(kInf), high(-kInf);
    for (int i = 0; i < n; ++i) {
      const Vec3 u = random_in(random);
      const auto s = bricks.sample(u, random.uniform_double());
      low = glm::min(low, s.p);
      high = glm::max(high, s.p);
      const double value = emission(s.p) / static_cast<double>(s.pdf);
      sum += value / n;
      squares += value * value / n;
    }
    const DVec3 extent = high - low;
    const double volume = extent.x * extent.y * extent.z;
    for (int i = 0; i < n; ++i) {
      const double value = emission(low + extent * DVec3(random_in(random))) * volume;
      volume_sum += value / n;
      volume_squares += value * value / n;
    }
    const double variance = squares - sum * sum, volume_variance = volume_squares - volume_sum * volume_sum;
    // Two-sided at 4.9 standard errors: once in a million.
    EXPECT_NEAR(sum, volume_sum, 4.9 * std::sqrt((variance + volume_variance) / n));
    EXPECT_LT(variance, 0.25 * volume_variance);
    EXPECT_NEAR(bricks.power(), 4 * 3.14159265 * sum, 0.05 * bricks.power());
  }
}

TEST(EmissionImportance, a_spark_between_two_voxel_centres_is_not_missed) {
  // One voxel glows; at all centres of its neighbours emission is zero, and next to them it is not.
  GridMediumDescription d =
      grid_medium(make_dense(IVec3(16), DVec3(0), DVec3(16), [](IVec3 v) { return v == IVec3(7, 8, 8) ? 1.f : 0.f; }), Rgb(1), Rgb(0));
  d.emission = Rgb(1);
  const Medium m = make_medium(d);
  Stream random(41);
  for (int i = 0; i < 1000; ++i) {
    const Vec3 p = Vec3(6.5f, 7.5f, 7.5f) + 2.0f * random_in(random);
    if (!is_black(m.at(p).emission)) {
      EXPECT_GT(m.emission_importance()->pdf(p), 0);
    }
  }
}

}  // namespace
}  // namespace woodcock
