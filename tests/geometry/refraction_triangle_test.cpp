#include "renderer/geometry/refraction_triangle.h"

#include <gtest/gtest.h>

#include <cmath>

#include "renderer/core/random.h"

namespace woodcock {
namespace {

DVec3 direction(Stream& random) {
  const double z = 2 * random.uniform_double() - 1, phi = 2 * 3.14159265358979323846 * random.uniform_double(),
               r = std::sqrt((1 - z) * (1 + z));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

DVec3 any_tangent(DVec3 n) { return glm::normalize(glm::cross(n, std::abs(n.x) < 0.5 ? DVec3(1, 0, 0) : DVec3(0, 1, 0))); }

std::optional<DVec3> refract(double eta, DVec3 n, DVec3 w) {
  const DVec3 along = eta * (w - glm::dot(w, n) * n);
  const double s2 = glm::dot(along, along);
  if (s2 >= 1) return std::nullopt;
  return along + std::sqrt(1 - s2) * n;
}

struct Plane {
  DVec3 p0, n, x, y;
  double eta, size;
};

/// Distances from 10⁻⁵ to 10⁵ of each other, indices from 1/2.5 to 2.5, every ninth with y over x.
Plane random_plane(uint64_t i) {
  Stream random(mix64(i + 1));
  const auto distance = [&] { return std::pow(10.0, 5 * random.uniform_double() - 2.5); };
  Plane c;
  c.n = direction(random);
  c.p0 = 3.0 * direction(random);
  const DVec3 s = any_tangent(c.n), t = glm::cross(c.n, s);
  const double h = distance(), h_out = distance(), d = i % 9 == 0 ? 0 : distance(), phi = 7 * random.uniform_double();
  const DVec3 foot = c.p0 + distance() * s;
  c.x = foot - h * c.n;
  c.y = foot + h_out * c.n + d * (std::cos(phi) * s + std::sin(phi) * t);
  c.eta = std::pow(2.5, 2 * random.uniform_double() - 1);
  c.size = std::max({h, h_out, d});
  return c;
}

TEST(RefractionThroughAPlane, ThereIsOneWayAndItObeysSnellsLaw) {
  for (uint64_t i = 0; i < 40000; ++i) {
    const Plane c = random_plane(i);
    const auto way = way_through_plane(c.p0, c.n, c.eta, c.x, c.y);
    ASSERT_TRUE(way) << i;
    EXPECT_LT(std::abs(glm::dot(way->v - c.p0, c.n)), 1e-12 * (glm::length(way->v) + 10)) << i;
    const DVec3 in = way->v - c.x, out = c.y - way->v;
    const double nearest = std::min(glm::length(in), glm::length(out)),
                 rounding = 1e-13 * (10 + glm::length(c.x) + glm::length(c.y)) / nearest;
    EXPECT_LT(glm::distance(in / glm::length(in), way->wi), 1e-10 + rounding) << i;
    EXPECT_LT(glm::distance(out / glm::length(out), way->wo), 1e-10 + rounding) << i;
    EXPECT_LT(glm::length(c.eta * glm::cross(way->wi, c.n) - glm::cross(way->wo, c.n)), 1e-11) << i;
    EXPECT_NEAR(way->cos_i, glm::dot(way->wi, c.n), 1e-11) << i;
    EXPECT_NEAR(way->cos_t, glm::dot(way->wo, c.n), 1e-11) << i;
  }
}

TEST(RefractionThroughAPlane, SolidAngleOverAreaIsThatOfABundleOfRays) {
  int64_t compared = 0;
  for (uint64_t i = 0; i < 20000; ++i) {
    const Plane c = random_plane(i);
    const auto way = way_through_plane(c.p0, c.n, c.eta, c.x, c.y);
    ASSERT_TRUE(way);
    if (way->cos_t < 0.1 || way->cos_i < 0.1) continue;
    const DVec3 s = any_tangent(way->wi), t = glm::cross(way->wi, s), p = any_tangent(way->wo), q = glm::cross(way->wo, p);
    const double h = 1e-5;
    const auto arrive = [&](double ds, double dt) {
      const DVec3 w = glm::normalize(way->wi + ds * s + dt * t), out = *refract(c.eta, c.n, w);
      const DVec3 v = c.x + glm::dot(c.p0 - c.x, c.n) / glm::dot(w, c.n) * w;
      const DVec3 at = v + glm::dot(c.y - v, way->wo) / glm::dot(out, way->wo) * out - c.y;
      return DVec2(glm::dot(at, p), glm::dot(at, q));
    };
    const DVec2 by_s = (arrive(h, 0) - arrive(-h, 0)) / (2 * h), by_t = (arrive(0, h) - arrive(0, -h)) / (2 * h);
    const double area = std::abs(by_s.x * by_t.y - by_s.y * by_t.x);
    ++compared;
    // Lengths that differ by a factor of 10⁵ cost digits.
    EXPECT_NEAR(way->solid_angle_per_area * area, 1, 1e-4) << "case " << i;
  }
  EXPECT_GT(compared, 10000);
}

TEST(RefractionThroughAPlane, OnOneSideThereIsNoWay) {
  const DVec3 o(0), n(0, 0, 1);
  EXPECT_FALSE(way_through_plane(o, n, 1.5, {0, 0, -1}, {0, 0, -2}));
  EXPECT_FALSE(way_through_plane(o, n, 1.5, {0, 0, 1}, {0, 0, 2}));
  EXPECT_FALSE(way_through_plane(o, n, 1.5, {0, 0, 1}, {0, 0, -2}));
  EXPECT_FALSE(way_through_plane(o, n, 1.5, {0, 0, 0}, {0, 0, 2}));
}

/// A triangle of unit size with normals up to half a radian off its own.
ShadedTriangle random_triangle(Stream& random) {
  ShadedTriangle t;
  t.p0 = direction(random);
  t.e1 = direction(random);
  t.e2 = glm::normalize(glm::cross(t.e1, direction(random)));
  t.e2 = t.e2 + 0.5 * (random.uniform_double() - 0.5) * t.e1;
  t.ng = glm::normalize(glm::cross(t.e1, t.e2));
  for (DVec3& n : t.normals) n = t.ng + 0.5 * random.uniform_double() * direction(random);
  return t;
}

TEST(RefractionThroughATriangle, ErrorStepAndSolidAngleAreThoseOfDifferences) {
  int64_t compared = 0;
  for (uint64_t i = 0; i < 20000; ++i) {
    Stream random(mix64(i + 7));
    const ShadedTriangle t = random_triangle(random);
    const double eta = std::pow(1.8, 2 * random.uniform_double() - 1);
    const DVec2 b(0.5 * random.uniform_double(), 0.5 * random.uniform_double());
    const DVec3 v = t.at(b), n = t.normal_at(b);
    // A way made by refraction.
    DVec3 w = glm::normalize(t.ng + 0.8 * direction(random));
    const auto out = refract(eta, n, w);
    if (!out || glm::dot(w, n) < 0.1 || glm::dot(w, t.ng) < 0.1 || glm::dot(*out, n) < 0.1 || glm::dot(*out, t.ng) < 0.1) continue;
    const DVec3 x = v - (0.2 + random.uniform_double()) * w, y = v + (0.2 + 3 * random.uniform_double()) * *out;
    const RefractionStep exact = refraction_step(t, b, eta, x, y);
    EXPECT_TRUE(exact.crosses) << i;
    EXPECT_LT(exact.error, 1e-13) << i;
    EXPECT_NEAR(exact.way.cos_i, glm::dot(w, n), 1e-12);
    // The bundle of rays around it.
    const DVec3 s = any_tangent(w), s2 = glm::cross(w, s), p = any_tangent(*out), q = glm::cross(*out, p);
    const double h = 1e-5;
    const auto arrive = [&](double ds, double dt) {
      const DVec3 d = glm::normalize(w + ds * s + dt * s2);
      const DVec3 at = x + glm::dot(t.p0 - x, t.ng) / glm::dot(d, t.ng) * d, r = at - t.p0;
      const double g11 = glm::dot(t.e1, t.e1), g12 = glm::dot(t.e1, t.e2), g22 = glm::dot(t.e2, t.e2), det = g11 * g22 - g12 * g12;
      const double r1 = glm::dot(r, t.e1), r2 = glm::dot(r, t.e2);
      const DVec3 o = *refract(eta, t.normal_at({(g22 * r1 - g12 * r2) / det, (g11 * r2 - g12 * r1) / det}), d);
      const DVec3 there = at + glm::dot(y - at, *out) / glm::dot(o, *out) * o - y;
      return DVec2(glm::dot(there, p), glm::dot(there, q));
    };
    const DVec2 by_s = (arrive(h, 0) - arrive(-h, 0)) / (2 * h), by_t = (arrive(0, h) - arrive(0, -h)) / (2 * h);
    const double area = std::abs(by_s.x * by_t.y - by_s.y * by_t.x), size = glm::dot(by_s, by_s) + glm::dot(by_t, by_t);
    if (area < 1e-2 * size) continue;  // a caustic
    ++compared;
    EXPECT_NEAR(exact.way.solid_angle_per_area * area, 1, 2e-5) << "case " << i;
    // From beside it one step of Newton's leads back up to the square of the distance.
    const DVec2 off = 1e-5 * DVec2(random.uniform_double() - 0.5, random.uniform_double() - 0.5);
    const RefractionStep beside = refraction_step(t, b + off, eta, x, y);
    EXPECT_LT(glm::length(beside.step + off), 1e-2 * glm::length(off)) << i;
  }
  EXPECT_GT(compared, 5000);
}

}  // namespace
}  // namespace woodcock
