// Rectangles seen from a point: the map, its density, and which primitives are taken for one.
#include "renderer/lights/rectangle_sampling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "tests/lights/light_fixtures.h"

namespace woodcock::test {
namespace {

using Long = long double;

/// The solid angle of [x0, x1] × [y0, y1] at the height z above the origin.
Long solid_angle(Long x0, Long x1, Long y0, Long y1, Long z) {
  const auto corner = [&](Long x, Long y) { return std::atan(x * y / (z * std::sqrt(x * x + y * y + z * z))); };
  return corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0);
}

Rectangle lying(double width, double height) { return *make_rectangle({0, 0, 0}, {width, 0, 0}, {0, height, 0}, {width, height, 0}); }

TEST(RectangleSampling, TheMapDividesTheSolidAngleInTheRatioOfTheRandomNumbers) {
  Stream random(1);
  int compared = 0;
  for (const double above : {1e-4, 1e-2, 1.0, 3.0})
    for (const double beside : {0.0, 0.5, 3.0})
      for (int i = 0; i < 2000; ++i) {
        const auto uniform = [&](double a, double b) { return a + (b - a) * random.uniform_double(); };
        const double w = std::exp(uniform(-2, 2)), h = std::exp(uniform(-2, 2));
        const DVec3 ref(uniform(-beside, 1 + beside) * w, uniform(-beside, 1 + beside) * h, above * uniform(0.5, 1.5));
        const DVec2 u(random.uniform_double(), random.uniform_double());
        const auto s = sample_rectangle(lying(w, h), ref, u);
        ASSERT_TRUE(s);
        const Long x0 = -ref.x, y0 = -ref.y, z = ref.z, x = x0 + Long(s->uv.x) * w, y = y0 + Long(s->uv.y) * h;
        const Long all = solid_angle(x0, x0 + w, y0, y0 + h, z);
        if (std::abs(Long(s->pdf) * all - 1) > 1e-6L) continue;  // by area, as the next test says
        ++compared;
        EXPECT_NEAR(static_cast<double>(solid_angle(x0, x, y0, y0 + h, z) / all), u.x, 1e-4);
        const auto sine = [&](Long v) { return v / std::sqrt(x * x + v * v + z * z); };
        EXPECT_NEAR(static_cast<double>((sine(y) - sine(y0)) / (sine(y0 + h) - sine(y0))), u.y, 1e-6);
      }
  EXPECT_GT(compared, 15000);
}

TEST(RectangleSampling, DensitiesAreOfTheSolidAngleNearbyAndOfTheAreaFarAway) {
  const Rectangle r = lying(2, 1);
  const DVec3 p(0.5, 0.25, 0);
  // A point above a corner sees a fourth of the rectangle twice as long and wide.
  const double near = static_cast<double>(solid_angle(0, 2, 0, 1, 0.5L));
  EXPECT_NEAR(rectangle_pdf(r, {0, 0, 0.5}, p), 1 / near, 1e-12 / near);
  EXPECT_NEAR(rectangle_pdf(r, {0, 0, -0.5}, p), 1 / near, 1e-12 / near);
  const DVec3 far(3, -4, 12), to = p - far;
  const double d = glm::length(to);
  EXPECT_NEAR(rectangle_pdf(r, far, p), d * d * d / (12 * 2), 1e-9);
  // Next to the plane nearly all of a half space; in it nothing.
  EXPECT_NEAR(rectangle_pdf(r, {1, 0.5, 1e-7}, p), 1 / (2 * std::numbers::pi), 1e-6);
  EXPECT_EQ(rectangle_pdf(r, {1, 0.5, 0}, p), 0);
  EXPECT_FALSE(sample_rectangle(r, {1, 0.5, 0}, {0.3, 0.3}));
}

TEST(RectangleSampling, RectanglesAreKnownByTheirCorners) {
  EXPECT_TRUE(make_rectangle({0, 0, 0}, {3, 4, 0}, {0, 0, 1}, {3, 4, 1}));
  EXPECT_TRUE(make_rectangle({0, 0, 0}, {3, 4.000001, 0}, {0, 0, 1}, {3, 4, 1.0000003}));
  EXPECT_FALSE(make_rectangle({0, 0, 0}, {3, 4, 0}, {0, 0, 1}, {3, 4, 1.001}));
  EXPECT_FALSE(make_rectangle({0, 0, 0}, {3, 0, 0.01}, {0, 0, 1}, {3, 0, 1.01}));  // no right angle
  EXPECT_FALSE(make_rectangle({0, 0, 0}, {3, 0, 0}, {0, 1, 0}, {3, 1, 0.01}));     // not flat
  EXPECT_FALSE(make_rectangle({0, 0, 0}, {0, 0, 0}, {0, 0, 1}, {0, 0, 1}));
}

/// Whether samples of a light of two triangles come from one map: then the random number that chooses a primitive changes nothing.
bool is_one_piece(const Mesh& mesh) {
  AreaLightDescription light;
  light.two_sided = true;
  const Lights lights = lights_of(emitting(light), {triangle_shape(mesh)});
  const auto at = [&](double u_primitive) { return lights.sample(0, {0.2, 0.3, 0.5}, {0.3f, 0.6f}, u_primitive)->p; };
  return at(0.1) == at(0.9);
}

TEST(RectangleSampling, TwoTrianglesInARowAreOneRectangleWhateverTheirFirstCorners) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0}};
  std::array<uint32_t, 3> a{0, 1, 2};
  for (int i = 0; i < 3; ++i) {
    std::array<uint32_t, 3> b{0, 2, 3};
    for (int k = 0; k < 3; ++k) {
      mesh.triangles = {a, b};
      EXPECT_TRUE(is_one_piece(mesh)) << i << ' ' << k;
      std::rotate(b.begin(), b.begin() + 1, b.end());
    }
    std::rotate(a.begin(), a.begin() + 1, a.end());
  }
  mesh.triangles = {{0, 1, 2}, {0, 3, 2}};  // they face opposite ways
  EXPECT_FALSE(is_one_piece(mesh));
  mesh.positions[3] = {0.01, 1, 0};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  EXPECT_FALSE(is_one_piece(mesh));
}

/// The irradiance of a receiver on the plane of a rectangle whose corners are given to a millionth, from 1e-7 of its size to 1 away from
/// the plane: by samples, against Lambert's formula for polygons. 6 comparisons at 5 standard errors (`agree`).
TEST(RectangleSampling, CornersOfFewDigitsLeaveTheIrradianceExact) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 4e-7}, {1, 1, -3e-7}, {0, 1, 2e-7}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  AreaLightDescription light;
  light.two_sided = true;
  const Lights lights = lights_of(emitting(light), {triangle_shape(mesh)});
  for (const double height : {1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0}) {
    const DVec3 ref(1.4, 0.5, height), n(-1, 0, 0);
    double exact = 0;
    for (const auto& t : mesh.triangles)
      for (size_t i = 0; i < 3; ++i) {
        const DVec3 a = glm::normalize(mesh.positions[t[i]] - ref), b = glm::normalize(mesh.positions[t[(i + 1) % 3]] - ref);
        const DVec3 cross = glm::cross(a, b);
        exact += 0.5 * std::atan2(glm::length(cross), glm::dot(a, b)) * glm::dot(glm::normalize(cross), n);
      }
    Estimate irradiance;
    Stream random(5);
    for (int i = 0; i < 200000; ++i) {
      const auto s = lights.sample(0, ref, random.uniform2(), random.uniform_double());
      irradiance.add(s ? static_cast<double>(-s->wi.x / s->pdf) : 0.0);
    }
    EXPECT_TRUE(agree(irradiance, std::abs(exact)))
        << height << ": " << irradiance.mean() << " ± " << irradiance.error() << ", exact " << std::abs(exact);
    EXPECT_LT(irradiance.error(), 0.01 * std::abs(exact)) << height;
  }
}

TEST(RectangleSampling, ANearRectangleIsLessNoisyAsAWholeThanAsTwoTriangles) {
  Mesh mesh;
  mesh.positions = {{-2, -2, 0}, {2, -2, 0}, {2, 2, 0}, {-2, 2, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  AreaLightDescription light;
  light.two_sided = true;
  const Lights lights = lights_of(emitting(light), {triangle_shape(mesh)});
  Estimate whole, halves;
  Stream random(9);
  const DVec3 ref(1.5, -1.5, 0.5);
  for (int i = 0; i < 20000; ++i) {
    const Vec2 u = random.uniform2();
    const double u_primitive = random.uniform_double();
    const auto add = [&](Estimate& to, Pieces pieces) {
      const auto s = lights.sample(0, ref, u, u_primitive, ChooseBy::kArrival, pieces);
      to.add(s ? static_cast<double>(1 / s->pdf) : 0.0);
    };
    add(whole, Pieces::kRectangles);
    add(halves, Pieces::kTriangles);
  }
  // Every sample of the whole is the solid angle.
  EXPECT_LT(whole.error(), 1e-6 * whole.mean());
  EXPECT_GT(halves.error(), 1e-3 * whole.mean());
  EXPECT_TRUE(agree(halves, whole.mean()));
}

}  // namespace
}  // namespace woodcock::test
