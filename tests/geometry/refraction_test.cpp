#include "renderer/geometry/refraction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "renderer/core/random.h"

namespace woodcock {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

DVec3 direction(Stream& random) {
  const double z = 2 * random.uniform_double() - 1, phi = kTurn * random.uniform_double(), r = std::sqrt((1 - z) * (1 + z));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

struct Case {
  Sphere sphere;
  double eta;
  DVec3 x, y;
};

/// Every fourth with x near the surface, every fourth with y near it; radii from 10⁻⁶ to 10⁶, indices from 1/2.5 to 2.5.
Case random_case(uint64_t i) {
  Stream random(mix64(i + 1));
  Case c;
  c.sphere.radius = std::pow(10.0, 12 * random.uniform_double() - 6);
  c.sphere.center = c.sphere.radius * 3.0 * direction(random);
  c.eta = std::pow(2.5, 2 * random.uniform_double() - 1);
  const double inside = i % 4 == 1 ? 1 - std::pow(10.0, -1 - 5 * random.uniform_double()) : std::cbrt(random.uniform_double());
  const double outside = i % 4 == 2 ? 1 + std::pow(10.0, -1 - 4 * random.uniform_double()) : 1 / (1e-3 + random.uniform_double() * 0.99);
  c.x = c.sphere.center + c.sphere.radius * inside * direction(random);
  c.y = c.sphere.center + c.sphere.radius * std::max(outside, 1.001 * (i % 4 == 2 ? 0 : 1)) * direction(random);
  return c;
}

/// The unit vector that leaves the sphere at v where w comes from inside.
std::optional<DVec3> refract(const Case& c, DVec3 v, DVec3 w) {
  const DVec3 n = (v - c.sphere.center) / c.sphere.radius;
  const double cosine = glm::dot(w, n);
  const DVec3 along = c.eta * (w - cosine * n);
  const double s2 = glm::dot(along, along);
  if (s2 >= 1) return std::nullopt;
  return along + std::sqrt(1 - s2) * n;
}

/// Where a ray from x inside leaves.
DVec3 leave(const Case& c, DVec3 w) {
  const DVec3 o = c.x - c.sphere.center;
  const double b = glm::dot(o, w);
  return c.x + (-b + std::sqrt(b * b + (c.sphere.radius * c.sphere.radius - glm::dot(o, o)))) * w;
}

/// What is wrong with Snell's law at v, as sines.
double snell_error(const Case& c, const RefractedWay& way) {
  const DVec3 n = (way.v - c.sphere.center) / c.sphere.radius;
  return glm::length(c.eta * glm::cross(way.wi, n) - glm::cross(way.wo, n));
}

TEST(Refraction, EveryWayObeysSnellsLawOnTheSphere) {
  int64_t found = 0, several = 0;
  for (uint64_t i = 0; i < 40000; ++i) {
    const Case c = random_case(i);
    const RefractedWays ways = refracted_ways(c.sphere, c.eta, c.x, c.y);
    several += ways.count > 1;
    for (const RefractedWay& way : ways.all()) {
      ++found;
      const double r = c.sphere.radius;
      EXPECT_NEAR(glm::distance(way.v, c.sphere.center) / r, 1, 1e-14) << i;
      // Directions between points are known to the rounding of the points over their distance.
      const double nearest = std::min(glm::distance(way.v, c.x), glm::distance(way.v, c.y)) / r;
      EXPECT_LT(snell_error(c, way), 1e-10 + 1e-14 / nearest) << "case " << i;
      const DVec3 n = (way.v - c.sphere.center) / r;
      EXPECT_NEAR(way.cos_i, glm::dot(way.wi, n), 1e-7 + 1e-14 / nearest) << i;
      EXPECT_NEAR(way.cos_t, glm::dot(way.wo, n), 1e-7 + 1e-14 / nearest) << i;
      EXPECT_GT(glm::dot(way.wo, n), 0) << i;
    }
  }
  EXPECT_GT(found, 30000);
  EXPECT_GT(several, 300);
}

/// Crossings of the directions from x in the plane of both points with the direction to y, by many small steps.
std::vector<DVec3> ways_by_search(const Case& c, int steps) {
  const DVec3 from = c.x - c.sphere.center, to = c.y - c.sphere.center;
  const DVec3 axis = glm::normalize(from), across = glm::normalize(glm::cross(glm::cross(from, to), from));
  const auto at = [&](double angle) { return c.sphere.center + c.sphere.radius * (std::cos(angle) * axis + std::sin(angle) * across); };
  // The sine between the refracted direction and the one to y, with a sign; nothing where the ray does not leave or not on y's side.
  const auto miss = [&](double angle) -> std::optional<double> {
    const DVec3 v = at(angle), n = (v - c.sphere.center) / c.sphere.radius;
    const auto out = refract(c, v, glm::normalize(v - c.x));
    const DVec3 w = glm::normalize(c.y - v);
    if (!out || glm::dot(w, n) <= 0 || glm::dot(w, *out) <= 0) return std::nullopt;
    return glm::dot(glm::cross(w, *out), glm::normalize(glm::cross(axis, across)));
  };
  std::vector<DVec3> found;
  for (int i = 0; i < steps; ++i) {
    const double lo = kTurn * i / steps, hi = kTurn * (i + 1) / steps;
    const auto a = miss(lo), b = miss(hi);
    if (a && b && (*a < 0) != (*b < 0)) found.push_back(at(0.5 * (lo + hi)));
  }
  return found;
}

TEST(Refraction, AllWaysAreFoundAndNoOthers) {
  constexpr int kSteps = 1 << 14;
  int64_t confirmed = 0;
  int counts[RefractedWays::kCapacity + 1] = {};
  for (uint64_t i = 0; i < 1200; ++i) {
    // Not so near to the surface that steps are too coarse.
    Case c = random_case(4 * i);
    const RefractedWays ways = refracted_ways(c.sphere, c.eta, c.x, c.y);
    ++counts[ways.count];
    const std::vector<DVec3> search = ways_by_search(c, kSteps);
    const double reach = 2 * kTurn / kSteps * c.sphere.radius;
    for (const DVec3 v : search)
      EXPECT_TRUE(std::any_of(ways.all().begin(), ways.all().end(), [&](const auto& w) { return glm::distance(w.v, v) < reach; }))
          << "a way is missing in case " << i << ", eta " << c.eta << ", " << ways.count << " of " << search.size();
    for (const RefractedWay& way : ways.all()) {
      // What changes within a step the search may miss: two ways next to each other, one that leaves near the limit, one next to x.
      const bool alone = std::none_of(ways.all().begin(), ways.all().end(),
                                      [&](const auto& w) { return &w != &way && glm::distance(w.v, way.v) < 2 * reach; });
      if (!alone || way.cos_t < 0.1 || glm::distance(way.v, c.x) < 40 * reach) continue;
      ++confirmed;
      EXPECT_TRUE(std::any_of(search.begin(), search.end(), [&](DVec3 v) { return glm::distance(v, way.v) < reach; })) << i;
    }
  }
  EXPECT_GT(confirmed, 500);
  EXPECT_GT(counts[0], 10);
  EXPECT_GT(counts[1], 100);
  EXPECT_GT(counts[2] + counts[3], 10);
}

TEST(Refraction, SolidAngleOverAreaIsThatOfABundleOfRays) {
  int64_t compared = 0;
  for (uint64_t i = 0; i < 20000; ++i) {
    const Case c = random_case(4 * i);
    const RefractedWays ways = refracted_ways(c.sphere, c.eta, c.x, c.y);
    for (const RefractedWay& way : ways.all()) {
      // Differences over an angle h, where they are no larger than the bundle itself.
      if (way.cos_t < 0.1) continue;
      const double h = 1e-5;
      const auto frame = [](DVec3 w) {
        const DVec3 s = glm::normalize(glm::cross(w, std::abs(w.x) < 0.5 ? DVec3(1, 0, 0) : DVec3(0, 1, 0)));
        return std::pair(s, glm::cross(w, s));
      };
      const auto [s, t] = frame(way.wi);
      const auto [p, q] = frame(way.wo);
      const auto arrive = [&](double ds, double dt) {
        const DVec3 w = glm::normalize(way.wi + ds * s + dt * t), v = leave(c, w), out = *refract(c, v, w);
        const DVec3 at = v + glm::dot(c.y - v, way.wo) / glm::dot(out, way.wo) * out - c.y;
        return DVec2(glm::dot(at, p), glm::dot(at, q));
      };
      const DVec2 by_s = (arrive(h, 0) - arrive(-h, 0)) / (2 * h), by_t = (arrive(0, h) - arrive(0, -h)) / (2 * h);
      const double area = std::abs(by_s.x * by_t.y - by_s.y * by_t.x);
      // On a caustic the bundle has no area.
      const double size = glm::dot(by_s, by_s) + glm::dot(by_t, by_t);
      if (area < 1e-2 * size) continue;
      ++compared;
      EXPECT_NEAR(way.solid_angle_per_area * area, 1, 1e-5) << "case " << i;
    }
  }
  EXPECT_GT(compared, 10000);
}

TEST(Refraction, StraightThroughTheCentreHasTheSolidAngleOfAThinLens) {
  // From the centre every ray goes straight on; the solid angle is that of the distance.
  const RefractedWays center = refracted_ways({DVec3(0), 1}, 1.5, DVec3(0), DVec3(0, 0, 3));
  ASSERT_EQ(center.count, 1u);
  EXPECT_NEAR(center.ways[0].solid_angle_per_area, 1.0 / 9, 1e-14);
  // On the axis: n2/s' = n1/s + (n2 − n1)/R with the radius towards x; a bundle of dω from x at s before the surface spreads by
  // s (1 + d/s') at d behind it, (n1/n2)² of it in area.
  const double eta = 1.5, a = 0.5, s = 1 - a, d = 2, image = 1 / (eta / s + (1 - eta));
  for (const double off : {0.0, 1e-9, 1e-7, 1e-5}) {
    const RefractedWays ways = refracted_ways({DVec3(0), 1}, eta, DVec3(0, 0, a), DVec3(off, 0, 1 + d));
    ASSERT_EQ(ways.count, 1u);
    const double width = s * (1 + d / image);
    EXPECT_NEAR(ways.ways[0].solid_angle_per_area * width * width, 1, 1e-8) << off;
  }
}

TEST(Refraction, WhereIsNoInsideOrOutsideThereIsNoWay) {
  const Sphere unit;
  EXPECT_EQ(refracted_ways(unit, 1.5, DVec3(2, 0, 0), DVec3(3, 0, 0)).count, 0u);
  EXPECT_EQ(refracted_ways(unit, 1.5, DVec3(0.2, 0, 0), DVec3(0.3, 0, 0)).count, 0u);
  EXPECT_EQ(refracted_ways(unit, 1.5, DVec3(1, 0, 0), DVec3(2, 0, 0)).count, 0u);
}

}  // namespace
}  // namespace woodcock
