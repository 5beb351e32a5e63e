// Lights at the limits: without area, of no size, next to the point that they light, huge; environments of one pixel.
#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>
#include <numbers>

#include "renderer/core/warp.h"
#include "tests/lights/light_fixtures.h"

namespace woodcock::test {
namespace {

TEST(HardCases, N29_a_lamp_without_area_gives_no_samples_and_no_nan) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}};
  mesh.triangles = {{0, 1, 2}, {0, 0, 0}};
  const Lights lights = lights_of(emitting({}), {triangle_shape(mesh)});
  EXPECT_FALSE(lights.sample(0, {0, 1, 0}, {0.5f, 0.5f}, 0.5f));
  EXPECT_EQ(lights.pdf(0, {0, 1, 0}, {{1, 1, 1}, {0, 0, 1}, {0, 0}, 0}, {1, 0, 0}), 0);
  EXPECT_TRUE(is_black(lights.power(0)));
}

TEST(HardCases, N31_tiny_and_very_close_spheres_keep_their_solid_angle) {
  const Quadric unit = quadric(Quadric::Kind::kSphere);
  AreaLightDescription light;
  // Half a millionth of a degree wide: the solid angle is π (r/d)².
  const double angle = 1e-6 * std::numbers::pi / 180 / 2;
  const Shape far = quadric_shape(unit, glm::scale(glm::translate(DMat4(1), DVec3(0, 0, 1000)), DVec3(1000 * angle)));
  const auto s = lights_of(emitting(light), {far}).sample(0, Vec3(0), {0.3f, 0.7f}, 0);
  ASSERT_TRUE(s);
  EXPECT_NEAR(1 / static_cast<double>(s->pdf), std::numbers::pi * angle * angle, 1e-6 * std::numbers::pi * angle * angle);
  EXPECT_NEAR(static_cast<double>(s->wi.z), 1, 1e-7);
  // 1e-6 above a sphere of radius 1 it fills nearly a hemisphere: 1 − cos = 1 − √(1 − 1/d²).
  const Shape near = quadric_shape(unit, DMat4(1));
  const float z = 1 + 1e-6f;
  const double d = static_cast<double>(z), solid_angle = 2 * std::numbers::pi * (1 - std::sqrt((d - 1) * (d + 1)) / d);
  Stream random(5);
  int samples = 0;
  for (int i = 0; i < 1000; ++i) {
    const auto t = lights_of(emitting(light), {near}).sample(0, Vec3(0, 0, z), random.uniform2(), 0);
    if (!t) continue;
    EXPECT_NEAR(1 / static_cast<double>(t->pdf), solid_angle, 1e-5 * solid_angle);
    EXPECT_NEAR(glm::length(t->p), 1, 1e-6);
    ++samples;
  }
  EXPECT_GT(samples, 0);
}

TEST(HardCases, N49_an_environment_of_one_pixel_equals_a_constant) {
  InfiniteLightDescription constant;
  constant.radiance = Rgb(0.5f, 1, 2);
  const Lights a = one_light(constant), b = image_light(picture("one.pfm", 1, {{{0, 0}, {0.5f, 1, 2}}}));
  Stream random(2);
  for (int i = 0; i < 10000; ++i) {
    const Vec3 w = square_to_sphere(random.uniform2());
    EXPECT_EQ(a.environment(w), b.environment(w));
    EXPECT_EQ(a.environment_pdf(w, DVec3(0)), 0);
    EXPECT_EQ(b.environment_pdf(w, DVec3(0)), 0);
  }
  EXPECT_NEAR(a.power(0).g, b.power(0).g, 1e-5f * a.power(0).g);
}

TEST(HardCases, N69_a_sample_of_two_skies_has_the_density_that_finds_it) {
  SceneDescription scene;
  LightDescription light;
  InfiniteLightDescription sky;
  sky.image_file = picture("first.pfm", 2, {{{0, 0}, Rgb(3)}, {{1, 0}, Rgb(2)}});
  light.kind = sky;
  scene.lights.push_back(light);
  sky.image_file = picture("second.pfm", 2, {{{1, 0}, Rgb(7)}});
  light.kind = sky;
  scene.lights.push_back(light);
  const Lights lights = lights_of(scene);
  Stream random(3);
  for (int i = 0; i < 2000; ++i) {
    const auto choice = lights.choose(random.uniform_double(), DVec3(0));
    ASSERT_TRUE(choice);
    const auto s = lights.sample(choice->light, DVec3(0), random.uniform2(), 0);
    if (!s) continue;
    EXPECT_EQ(s->radiance, lights.environment(s->wi));
    EXPECT_FLOAT_EQ(choice->pmf * s->pdf, lights.environment_pdf(s->wi, DVec3(0)));
  }
}

TEST(HardCases, N49_one_lit_pixel_carries_its_share_of_the_sphere) {
  constexpr int kSize = 8;
  // A middle pixel, the fold at the equator, an edge, a corner (the south pole) and one beside the north pole.
  for (const IVec2 at : {IVec2(2, 3), IVec2(1, 1), IVec2(0, 4), IVec2(7, 7), IVec2(4, 4)}) {
    const Lights lights = image_light(picture("lit.pfm", kSize, {{at, Rgb(3)}}));
    const double solid_angle = 4 * std::numbers::pi / (kSize * kSize);
    Stream random(4);
    Estimate by_ray, density;
    for (int i = 0; i < 200000; ++i) {
      const Vec3 w = square_to_sphere(random.uniform2());
      by_ray.add(static_cast<double>(lights.environment(w).g) * 4 * std::numbers::pi);
      density.add(static_cast<double>(lights.environment_pdf(w, DVec3(0))) * 4 * std::numbers::pi);
    }
    EXPECT_TRUE(agree(by_ray, 3 * solid_angle));
    EXPECT_TRUE(agree(density, 1));
    int lost = 0;
    for (int i = 0; i < 10000; ++i) {
      const auto s = lights.sample(0, Vec3(0), random.uniform2(), 0);
      // Only directions on the border may be rounded into a dark neighbour.
      if (!s) {
        ++lost;
        continue;
      }
      EXPECT_NEAR(static_cast<double>(s->radiance.g / s->pdf), 3 * solid_angle, 1e-5);
    }
    EXPECT_LE(lost, 2);
  }
}

TEST(HardCases, N64_a_huge_triangle_near_the_horizon_has_its_exact_irradiance) {
  // A rectangle from x = 1 to 1e5, 2e5 wide, 1e-3 above the plane of the receiver; the exact irradiance of a receiver
  // that faces along +x comes from Lambert's formula for polygons.
  Mesh mesh;
  const float h = 1e-3f;
  mesh.positions = {{1, h, -1e5f}, {1e5f, h, -1e5f}, {1e5f, h, 1e5f}, {1, h, 1e5f}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  const Shape shape = triangle_shape(mesh);
  AreaLightDescription light;
  light.two_sided = true;
  const Lights lights = lights_of(emitting(light), {shape});
  const DVec3 n(1, 0, 0);
  double exact = 0;
  for (int i = 0; i < 4; ++i) {
    const DVec3 a = glm::normalize(DVec3(mesh.positions[static_cast<size_t>(i)]));
    const DVec3 b = glm::normalize(DVec3(mesh.positions[static_cast<size_t>((i + 1) % 4)]));
    const DVec3 cross = glm::cross(a, b);
    exact += 0.5 * std::atan2(glm::length(cross), glm::dot(a, b)) * glm::dot(glm::normalize(cross), n);
  }
  // As one rectangle, and as two triangles.
  for (const Pieces pieces : {Pieces::kRectangles, Pieces::kTriangles}) {
    Estimate irradiance;
    Stream random(3);
    for (int i = 0; i < 6000000; ++i) {
      const auto s = lights.sample(0, Vec3(0), random.uniform2(), random.uniform(), ChooseBy::kArrival, pieces);
      irradiance.add(s ? static_cast<double>(s->wi.x / s->pdf) : 0.0);
    }
    EXPECT_TRUE(agree(irradiance, std::abs(exact))) << irradiance.mean() << " ± " << irradiance.error() << ", exact " << exact;
    EXPECT_LT(irradiance.error(), 5e-4 * std::abs(exact));
  }
}

// The solid angle of a long strip is the small difference of large ones.
TEST(HardCases, N64_a_thin_strip_has_its_exact_solid_angle) {
  for (const double width : {1e-1, 1e-2, 1.37e-4}) {
    const double x0 = -1.3, x1 = 1.1, y0 = 0.9, y1 = y0 + width, z = 0.7;
    Mesh mesh;
    mesh.positions = {{x0, y0, z}, {x1, y0, z}, {x1, y1, z}, {x0, y1, z}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    const Shape shape = triangle_shape(mesh);
    AreaLightDescription light;
    light.two_sided = true;
    const Lights lights = lights_of(emitting(light), {shape});
    const auto arc = [](long double x, long double y) { return std::atan(x * y / (0.7L * std::sqrt(x * x + y * y + 0.49L))); };
    const auto solid_angle = static_cast<double>(arc(x1, y1) - arc(x0, y1) - arc(x1, y0) + arc(x0, y0));
    const auto sampled = lights.sample(0, DVec3(0), Vec2(0.3f, 0.6f), 0.5, ChooseBy::kArrival, Pieces::kRectangles);
    ASSERT_TRUE(sampled);
    EXPECT_NEAR(1 / static_cast<double>(sampled->pdf), solid_angle, 1e-6 * solid_angle) << width;
  }
}

// Inside of a sphere of light every direction is as bright as any other, and none is a NaN; on it, too.
TEST(HardCases, N31_a_point_in_or_on_a_sphere_of_light_is_lit_from_all_around) {
  const Shape ball = quadric_shape(quadric(Quadric::Kind::kSphere), DMat4(1), true);
  const Lights lights = lights_of(emitting({}), {ball});
  Stream random(6);
  for (const Vec3 ref : {Vec3(0), Vec3(0.5f, 0.2f, -0.3f), Vec3(0, 0, 0.9999f), Vec3(0, 0, 1), Vec3(0.6f, 0.8f, 0)}) {
    const bool inside = glm::length(ref) < 0.99999f;
    int samples = 0;
    for (int i = 0; i < 2000; ++i) {
      const auto s = lights.sample(0, ref, random.uniform2(), random.uniform());
      if (!s) continue;
      ++samples;
      ASSERT_TRUE(is_finite(s->wi) && std::isfinite(s->pdf) && is_finite(s->radiance));
      if (inside) {
        EXPECT_FLOAT_EQ(s->pdf, 0.25f * kInvPi);
        EXPECT_NEAR(glm::length(s->p), 1, 1e-5);
      }
    }
    if (inside) {
      EXPECT_EQ(samples, 2000);
    }
  }
}

// Facing the centre of a sphere at the distance d, a patch receives π (r/d)², however close the sphere is: by light samples to
// 0.05 %, and by directions drawn without it.
TEST(HardCases, N64_a_sphere_very_close_by_has_its_exact_irradiance) {
  const Shape ball = quadric_shape(quadric(Quadric::Kind::kSphere), DMat4(1));
  const Lights lights = lights_of(emitting({}), {ball});
  const Geometry geometry({ball}, 1, {}, {});
  for (const double gap : {1e-1, 1e-3, 1e-5}) {
    const auto z = static_cast<float>(1 + gap);
    const double exact = std::numbers::pi / (static_cast<double>(z) * static_cast<double>(z));
    Estimate by_light, by_direction;
    Stream random(7);
    for (int i = 0; i < 1000000; ++i) {
      const auto s = lights.sample(0, {0, 0, z}, random.uniform2(), random.uniform());
      by_light.add(s ? static_cast<double>(-s->wi.z / s->pdf) : 0.0);
      if (i % 4 != 0) continue;
      const Vec3 w = square_to_cosine_hemisphere(random.uniform2());
      by_direction.add(geometry.intersect({{0, 0, z}, -w}, static_cast<double>(kInf)) ? std::numbers::pi : 0);
    }
    EXPECT_TRUE(agree(by_light, exact)) << gap << ": " << by_light.mean() << " ± " << by_light.error() << ", exact " << exact;
    EXPECT_LT(by_light.error(), 1e-3 * exact);
    EXPECT_TRUE(agree(by_direction, exact)) << gap << ": " << by_direction.mean() << " ± " << by_direction.error() << ", exact " << exact;
  }
}

}  // namespace
}  // namespace woodcock::test
