// Area lights: what light samples say must be what rays meet. Rays are cast by renderer/geometry, which shares no
// code with the samplers, so that normals, texture coordinates and primitives are compared as well.
#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>
#include <numbers>

#include "renderer/core/warp.h"
#include "renderer/lights/patch_geometry.h"
#include "tests/lights/light_fixtures.h"
#include "tests/support/chi_square.h"

namespace woodcock::test {
namespace {

struct Case {
  std::string name;
  Shape shape;
  std::vector<Vec3> refs;

  /// The probability with which a triangle of a mesh is chosen; 1 for shapes of one primitive, and for those that are one rectangle.
  double share(uint32_t primitive) const {
    const Mesh* mesh = std::get_if<Mesh>(&shape.geometry);
    if (mesh == nullptr || name.starts_with("rectangle")) return 1;
    const auto area = [&](const std::array<uint32_t, 3>& t) {
      const DVec3 p(mesh->positions[t[0]]);
      return glm::length(glm::cross(DVec3(mesh->positions[t[1]]) - p, DVec3(mesh->positions[t[2]]) - p));
    };
    double total = 0;
    for (const auto& t : mesh->triangles) total += area(t);
    return area(mesh->triangles[primitive]) / total;
  }
  /// The parameters of a point of a patch; 0 on other shapes.
  DVec2 parameters(uint32_t primitive, DVec3 p) const {
    const auto* mesh = std::get_if<PatchMesh>(&shape.geometry);
    if (mesh == nullptr) return DVec2(0);
    const auto& v = mesh->patches[primitive];
    return invert_patch({mesh->positions[v[0]], mesh->positions[v[1]], mesh->positions[v[2]], mesh->positions[v[3]]}, p);
  }
};

DMat4 placed(DVec3 where, DVec3 scale = DVec3(1)) {
  return glm::scale(glm::rotate(glm::translate(DMat4(1), where), 0.7, DVec3(1, 2, 3)), scale);
}

Shape patch_shape(const PatchMesh& mesh, bool flip = false) {
  Shape shape;
  shape.geometry = mesh;
  shape.flip = flip;
  return shape;
}

void add(std::vector<Case>& cases, const std::string& name, const Shape& shape, const std::vector<Vec3>& refs) {
  Case& added = cases.emplace_back();
  added.name = name;
  added.shape = shape;
  added.refs = refs;
}

std::vector<Case> cases() {
  std::vector<Case> cases;
  Mesh triangles;
  triangles.positions = {{-1, 0, 0}, {1, 0.2f, 0}, {0, 1, 0.3f}, {0.5f, -2, 1}, {3, 3, 3}};
  triangles.uv = {{0, 0}, {1, 0}, {0.5f, 1}, {0, 1}, {0, 0}};
  triangles.triangles = {{0, 1, 2}, {0, 3, 1}, {4, 4, 4}};  // the last has no area
  add(cases, "triangles", triangle_shape(triangles), {{0, 0, 2}, {0.3f, 0.2f, 0.4f}, {5, 1, 3}, {20, 20, 20}});
  add(cases, "flipped triangles", triangle_shape(triangles, true), {{0, 0.2f, -1}, {0, -3, -0.1f}});
  Mesh smooth = triangles;
  smooth.normals = {{0, 0, -1}, {0, 0, -1}, {0, 0, -1}, {0, 0, -1}, {0, 0, -1}};
  add(cases, "triangles with vertex normals", triangle_shape(smooth), {{0, 0.2f, -1}, {1, 1, 1}});
  Mesh huge;
  huge.positions = {{-1e4f, 0, -1e4f}, {1e4f, 0, -1e4f}, {0, 0, 1e4f}};
  huge.triangles = {{0, 2, 1}};
  add(cases, "huge triangle", triangle_shape(huge), {{0, 1, 0}, {3, 0.01f, 5}, {2e3f, 900, 3e3f}});

  // Two triangles in any order of corners, and a patch.
  Mesh rectangle;
  rectangle.positions = {{-1, 0, 0}, {1, 0, 0}, {1, 0, 3}, {-1, 0, 3}};
  rectangle.uv = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  rectangle.triangles = {{1, 2, 0}, {3, 0, 2}};
  add(cases, "rectangle of triangles", triangle_shape(rectangle), {{0, -1, 1}, {0.3f, 0.02f, 0.4f}, {2, -0.1f, 1}, {3, 9, 5}});
  PatchMesh whole;
  whole.positions = {{0, 0, 0}, {0.6f, 0.8f, 0}, {0, 0, -2}, {0.6f, 0.8f, -2}};
  whole.patches = {{0, 1, 2, 3}};
  add(cases, "rectangle of a patch", patch_shape(whole), {{-1, 0.5f, -1}, {0, 0.5f, -1}, {9, 1, 3}});
  // A wall of two rectangles and a triangle beside them.
  Mesh wall;
  wall.positions = {{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0}, {2, 0, 1}, {2, 1, 1}, {0, 2, 0.5f}};
  wall.triangles = {{3, 2, 6}, {0, 1, 2}, {0, 2, 3}, {1, 4, 5}, {1, 5, 2}};
  add(cases, "wall", triangle_shape(wall), {{1, 0.5f, 1}, {1.8f, 0.2f, 0.1f}, {-4, 3, 8}});

  PatchMesh flat;
  flat.positions = {{-1, -1, 0}, {1, -1, 0}, {-1.5f, 1, 0}, {1, 2, 0}};
  flat.patches = {{0, 1, 2, 3}};
  add(cases, "flat patch", patch_shape(flat), {{0, 0, 1}, {0.4f, 0.3f, 0.1f}, {3, 0, 2}, {10, 10, 10}});
  PatchMesh bent;
  bent.positions = {{-1, -1, 0.5f}, {1, -1, -0.5f}, {-1, 1, -0.5f}, {1, 1.5f, 1}};
  bent.uv = {{0, 0}, {0.5f, 0}, {0, 1}, {1, 1}};
  bent.patches = {{0, 1, 2, 3}};
  add(cases, "bent patch", patch_shape(bent), {{0, 0, 2}, {2, 1, 1.5f}});
  add(cases, "flipped bent patch", patch_shape(bent, true), {{0, 0, -2}});

  add(cases, "sphere", quadric_shape(quadric(Quadric::Kind::kSphere), placed({1, 2, 3})), {{0, 0, 0}, {1, 2, 4.01f}, {9, 9, 9}});
  cases.push_back(
      {"sphere from inside", quadric_shape(quadric(Quadric::Kind::kSphere), placed({0, 0, 0}), true), {{0, 0, 0}, {0.9f, 0, 0}}});
  cases.push_back(
      {"stretched sphere", quadric_shape(quadric(Quadric::Kind::kSphere), placed({0, 0, 0}, {1, 0.3, 2.5})), {{2, 2, 2}, {0, -1, 3}}});
  add(cases, "stretched sphere from inside", quadric_shape(quadric(Quadric::Kind::kSphere), placed({0, 0, 0}, {1, 0.3, 2.5}), true),
      {{0, 0, 0}, {0.1f, 0.1f, 0.2f}});
  add(cases, "mirrored sphere", quadric_shape(quadric(Quadric::Kind::kSphere), placed({0, 0, 0}, {1, 1, -1})), {{2, 2, 2}});
  Quadric part = quadric(Quadric::Kind::kSphere);
  part.z_min = -0.3;
  part.z_max = 0.8;
  part.phi_max = 4;
  add(cases, "part of a sphere", quadric_shape(part, placed({0, 0, 0}, {1, 0.7, 1.2})), {{2, 2, 2}, {0, 3, -1}});
  Quadric ring = quadric(Quadric::Kind::kDisk);
  ring.inner_radius = 0.4;
  ring.phi_max = 5;
  add(cases, "part of a ring", quadric_shape(ring, placed({0, 0, 0}, {2, 1, 1})), {{1, 2, 3}, {0.2f, 0.1f, 1}});
  Quadric tube = quadric(Quadric::Kind::kCylinder);
  tube.phi_max = 4.5;
  add(cases, "part of a cylinder", quadric_shape(tube, placed({0, 0, 0}, {1, 0.5, 1.5})), {{2, 2, 2}, {3, -1, 0}});
  return cases;
}

/// Directions uniform in a cone around the light, with their pdf.
class Cone {
 public:
  Cone(Box3 bounds, Vec3 ref) {
    const DVec3 axis = DVec3(bounds.center()) - DVec3(ref);
    const double d = glm::length(axis), r = 0.5 * glm::length(DVec3(bounds.extent()));
    height_ = d > r ? 1 - std::sqrt(1 - (r / d) * (r / d)) : 2;
    height_ = std::min(2.0, height_ * 1.0001);
    frame_ = Frame::from_normal(d > 0 ? Vec3(axis / d) : Vec3(0, 0, 1));
  }
  Vec3 sample(Stream& random) const {
    const double h = height_ * random.uniform_double(), phi = 2 * std::numbers::pi * random.uniform_double();
    const double sine = std::sqrt(h * (2 - h));
    return glm::normalize(
        frame_.to_world({static_cast<float>(sine * std::cos(phi)), static_cast<float>(sine * std::sin(phi)), static_cast<float>(1 - h)}));
  }
  double solid_angle() const { return 2 * std::numbers::pi * height_; }
  /// Which of rows × columns cells of equal solid angle holds a direction; rows · columns for one outside of the cone.
  size_t cell(Vec3 w, int rows, int columns) const {
    const Vec3 local = frame_.to_local(w);
    // 1 − cos without cancellation.
    const double h =
        0.5 * (static_cast<double>(local.x * local.x + local.y * local.y) + static_cast<double>((1 - local.z) * (1 - local.z)));
    const double phi = (std::atan2(static_cast<double>(local.y), static_cast<double>(local.x)) + std::numbers::pi) / (2 * std::numbers::pi);
    if (h > height_) return static_cast<size_t>(rows * columns);
    return std::min(static_cast<size_t>(rows) - 1, static_cast<size_t>(h / height_ * rows)) * static_cast<size_t>(columns) +
           std::min(static_cast<size_t>(columns) - 1, static_cast<size_t>(phi * columns));
  }

 private:
  Frame frame_;
  double height_;
};

/// Every point of the light along a ray, nearest first.
std::vector<EmitterHit> all_hits(const Geometry& geometry, DVec3 ref, DVec3 direction) {
  std::vector<EmitterHit> hits;
  Ray ray{ref, direction};
  while (const auto hit = geometry.intersect(ray, static_cast<double>(kInf))) {
    const SurfacePoint at = geometry.surface(*hit, ray);
    hits.push_back({at.p, at.ng, at.uv, hit->primitive, hit->uv});
    ray.o = offset_origin(at, direction);
  }
  return hits;
}

/// Test functions over directions whose integrals against the light are compared: 1 and four half spaces.
constexpr int kFunctions = 5;
double test_function(int k, Vec3 w) {
  if (k == 0) return 1;
  constexpr Vec3 kAxis[4] = {{0.6f, 0.8f, 0}, {0, -0.6f, 0.8f}, {0.8f, 0, -0.6f}, {-0.5f, 0.5f, 0.7f}};
  return 1 + static_cast<double>(glm::dot(w, kAxis[k - 1]) > 0);
}

TEST(AreaLight, SamplesAndRaysFindTheSameLight) {
  constexpr int kSamples = 30000;
  for (const bool two_sided : {false, true})
    for (const Case& c : cases()) {
      AreaLightDescription light;
      light.two_sided = two_sided;
      const Lights lights = lights_of(emitting(light), {c.shape});
      const Geometry geometry({c.shape}, 1, {}, {});
      for (size_t r = 0; r < c.refs.size(); ++r) {
        SCOPED_TRACE(c.name + (two_sided ? ", two-sided" : "") + ", point " + std::to_string(r));
        const Vec3 ref = c.refs[r];
        const Cone cone(bounds_of(c.shape), ref);
        Stream random(0x11 + r);
        Estimate by_light[kFunctions], by_ray[kFunctions], density;
        for (int i = 0; i < kSamples; ++i) {
          const auto s = lights.sample(0, ref, random.uniform2(), random.uniform());
          bool visible = false;
          if (s) {
            // What lies behind the nearest point of the light is in its own shadow.
            const DVec3 to = s->p - DVec3(ref);
            visible = !geometry.occluded({ref, glm::normalize(to)}, glm::length(to), s->target);
          }
          for (int k = 0; k < kFunctions; ++k)
            by_light[k].add(s && visible ? static_cast<double>(s->radiance.g / s->pdf) * test_function(k, s->wi) : 0.0);

          const Vec3 w = cone.sample(random);
          const auto hits = all_hits(geometry, ref, w);
          double pdf = 0;
          for (const EmitterHit& hit : hits) pdf += static_cast<double>(lights.pdf(0, ref, hit, w));
          density.add(pdf * cone.solid_angle());
          const double emitted = hits.empty() ? 0 : static_cast<double>(lights.emitted(0, hits[0], -w).g) * cone.solid_angle();
          for (int k = 0; k < kFunctions; ++k) by_ray[k].add(emitted * test_function(k, w));
        }
        EXPECT_TRUE(agree(density, 1)) << "∫ pdf = " << density.mean() << " ± " << density.error();
        for (int k = 0; k < kFunctions; ++k)
          EXPECT_TRUE(agree(by_light[k], by_ray[k]))
              << "function " << k << ": by light " << by_light[k].mean() << " ± " << by_light[k].error() << ", by ray " << by_ray[k].mean()
              << " ± " << by_ray[k].error();
      }
    }
}

/// χ² of directions over cells of a cone: drawn by the light against the integral of its density over the cell, itself estimated
/// with directions uniform in the cone, so that both variances count.
TEST(AreaLight, DirectionsFollowTheDensity) {
  constexpr int kRows = 8, kColumns = 8, kSamples = 40000;
  for (const Case& c : cases())
    for (size_t r = 0; r < c.refs.size(); ++r) {
      AreaLightDescription light;
      light.two_sided = true;  // the density covers both sides
      const Lights lights = lights_of(emitting(light), {c.shape});
      const Geometry geometry({c.shape}, 1, {}, {});
      const Vec3 ref = c.refs[r];
      const Cone cone(bounds_of(c.shape), ref);
      Stream random(0x21 + r);
      std::array<Estimate, kRows * kColumns> drawn, density;
      const auto add = [&](std::array<Estimate, kRows * kColumns>& cells, size_t cell, double value) {
        for (size_t i = 0; i < cells.size(); ++i) cells[i].add(i == cell ? value : 0.0);
      };
      for (int i = 0; i < kSamples; ++i) {
        const auto s = lights.sample(0, ref, random.uniform2(), random.uniform());
        add(drawn, s ? cone.cell(s->wi, kRows, kColumns) : static_cast<size_t>(kRows * kColumns), 1);
        const Vec3 w = cone.sample(random);
        double pdf = 0;
        for (const EmitterHit& hit : all_hits(geometry, ref, w)) pdf += static_cast<double>(lights.pdf(0, ref, hit, w));
        add(density, cone.cell(w, kRows, kColumns), pdf * cone.solid_angle());
      }
      double statistic = 0;
      int degrees = 0;
      for (size_t i = 0; i < drawn.size(); ++i) {
        // Cells that fewer than twenty directions meet are far from normal.
        if (drawn[i].mean() * kSamples < 20 || density[i].mean() * kSamples < 20) continue;
        const double d = drawn[i].mean() - density[i].mean(),
                     variance = drawn[i].error() * drawn[i].error() + density[i].error() * density[i].error();
        statistic += d * d / variance;
        ++degrees;
      }
      // About 45 comparisons at 1e-6.
      EXPECT_GT(testing::chi_square_p_value(statistic, degrees), 1e-6)
          << c.name << ", point " << r << ": " << statistic << " for " << degrees;
      EXPECT_GE(degrees, 1) << c.name;
    }
}

/// The density is the reciprocal of the Jacobian of the map from random numbers to directions, by central differences.
TEST(AreaLight, DensityIsTheReciprocalOfTheJacobian) {
  int compared = 0;
  for (const Case& c : cases()) {
    if (c.name == "flat patch" || c.name == "wall") continue;  // several pieces
    AreaLightDescription light;
    light.two_sided = true;
    const Lights lights = lights_of(emitting(light), {c.shape});
    for (const Vec3 ref : c.refs) {
      Stream random(8);
      for (int i = 0; i < 100; ++i) {
        constexpr float kStep = 2e-3f;
        const Vec2 u = Vec2(0.02f) + 0.96f * random.uniform2();
        if (std::abs(u.x - u.y) < 0.02f) continue;  // a seam of the map to triangles
        // The middle of the random number's range of one primitive: its choice has the probability of that range.
        const float u_primitive = 0.3f;
        const auto at = [&](Vec2 v) { return lights.sample(0, ref, v, u_primitive); };
        const auto s = at(u), a = at(u + Vec2(kStep, 0)), b = at(u - Vec2(kStep, 0)), e = at(u + Vec2(0, kStep)),
                   f = at(u - Vec2(0, kStep));
        if (!s || !a || !b || !e || !f) continue;
        const DVec3 du = DVec3(a->wi) - DVec3(b->wi), dv = DVec3(e->wi) - DVec3(f->wi);
        const double area = glm::length(glm::cross(du, dv)),
                     jacobian = area / (4 * static_cast<double>(kStep) * static_cast<double>(kStep));
        // Where directions hardly move their rounding counts; grazing views of curved shapes bend the map within a step.
        if (area < 1e-8 || std::abs(glm::dot(s->wi, s->n)) < 0.15f) continue;
        ++compared;
        EXPECT_NEAR(jacobian * static_cast<double>(s->pdf) / c.share(s->target.primitive), 1, 0.03) << c.name << " u " << u.x << ' ' << u.y;
      }
    }
  }
  EXPECT_GT(compared, 1500);
}

TEST(AreaLight, PdfOfASampledPointIsThePdfOfTheSample) {
  for (const Case& c : cases()) {
    AreaLightDescription light;
    light.two_sided = true;
    const Lights lights = lights_of(emitting(light), {c.shape});
    for (const Vec3 ref : c.refs) {
      Stream random(7);
      int samples = 0;
      for (int i = 0; i < 500; ++i) {
        const auto s = lights.sample(0, ref, random.uniform2(), random.uniform());
        if (!s) continue;
        ++samples;
        // Grazing views of curved shapes turn float rounding of the point into changes of its cosine.
        const double cosine = std::abs(static_cast<double>(glm::dot(s->wi, s->n)));
        const DVec2 parameters = c.parameters(s->target.primitive, s->p);
        const float pdf = lights.pdf(0, ref, {s->p, s->n, Vec2(0), s->target.primitive, parameters}, s->wi);
        EXPECT_NEAR(pdf / s->pdf, 1, 1e-4 + 1e-5 / cosine) << c.name;
        EXPECT_NEAR(glm::length(glm::cross(s->p - DVec3(ref), DVec3(s->wi))), 0, 1e-6 * (glm::length(s->p) + glm::length(DVec3(ref))))
            << c.name;
      }
      EXPECT_GT(samples, 0) << c.name;
    }
  }
}

TEST(AreaLight, PowerIsWorldPowerWhateverTheScaleOfRenderSpace) {
  AreaLightDescription light;
  light.power = 12;
  for (const double scale : {1.0, 0.25, 8.0}) {
    // A world sphere of radius 2: radiance = power / (π · 16π).
    const Shape shape = quadric_shape(quadric(Quadric::Kind::kSphere), glm::scale(DMat4(1), DVec3(2 * scale)));
    const Lights lights = lights_of(emitting(light), {shape}, scale);
    const float expected = 12 / (kPi * 16 * kPi);
    EXPECT_NEAR(lights.emitted(0, {{0, 0, 1}, {0, 0, 1}, {0, 0}, 0}, {0, 0, 1}).g, expected, 1e-5f * expected);
    EXPECT_NEAR(lights.power(0).g, 12 * scale * scale, 1e-4 * scale * scale);
  }
}

TEST(AreaLight, EmitsOnTheSideOfItsNormalOnly) {
  const Shape disk = quadric_shape(quadric(Quadric::Kind::kDisk), DMat4(1));
  AreaLightDescription light;
  const Lights one = lights_of(emitting(light), {disk});
  light.two_sided = true;
  const Lights two = lights_of(emitting(light), {disk});
  const EmitterHit hit{{0, 0, 0}, {0, 0, 1}, {0, 0}, 0};
  EXPECT_EQ(one.emitted(0, hit, {0, 0, 1}).g, 1);
  EXPECT_EQ(one.emitted(0, hit, {0, 0, -1}).g, 0);
  EXPECT_EQ(two.emitted(0, hit, {0, 0, -1}).g, 1);
  EXPECT_TRUE(one.sample(0, {0, 0, 1}, {0.2f, 0.2f}, 0));
  EXPECT_FALSE(one.sample(0, {0, 0, -1}, {0.2f, 0.2f}, 0));
  EXPECT_TRUE(two.sample(0, {0, 0, -1}, {0.2f, 0.2f}, 0));
}

TEST(AreaLight, OpacityWeightsSamplesAndInvisibleLightsAreDelta) {
  const Shape disk = quadric_shape(quadric(Quadric::Kind::kDisk), DMat4(1));
  const Lights half = lights_of(emitting({}, {0.5f, kNone}), {disk});
  const Lights invisible = lights_of(emitting({}, {0, kNone}), {disk});
  const Lights textured = lights_of(emitting({}, {1, 0}), {disk});
  const EmitterHit hit{{0, 0, 0}, {0, 0, 1}, {0, 0}, 0};
  EXPECT_EQ(half.sample(0, {0, 0, 1}, {0.2f, 0.2f}, 0)->radiance.g, 0.5f);
  EXPECT_EQ(half.emitted(0, hit, {0, 0, 1}).g, 1);
  EXPECT_EQ(invisible.sample(0, {0, 0, 1}, {0.2f, 0.2f}, 0)->radiance.g, 1);
  EXPECT_TRUE(invisible.sample(0, {0, 0, 1}, {0.2f, 0.2f}, 0)->delta);
  EXPECT_FALSE(textured.sample(0, {0, 0, 1}, {0.2f, 0.2f}, 0));
  EXPECT_EQ(textured.pdf(0, {0, 0, 1}, hit, {0, 0, -1}), 0);
}

TEST(AreaLight, ImageIsSampledAsRaysSeeIt) {
  AreaLightDescription light;
  light.image_file = write_pfm("area_light.pfm", 2, 2, {Rgb(4), Rgb(8), Rgb(1), Rgb(2)});
  for (const Case& c : cases()) {
    if (c.name != "triangles" && !c.name.starts_with("rectangle") && c.name != "bent patch" && c.name != "flat patch" &&
        c.name != "sphere" && c.name != "part of a sphere" && c.name != "part of a ring" && c.name != "part of a cylinder")
      continue;
    SCOPED_TRACE(c.name);
    const Lights lights = lights_of(emitting(light), {c.shape});
    const Geometry geometry({c.shape}, 1, {}, {});
    Stream random(1);
    int compared = 0;
    for (int i = 0; i < 200; ++i) {
      const auto s = lights.sample(0, c.refs[0], random.uniform2(), random.uniform());
      if (!s) continue;
      const auto hits = all_hits(geometry, c.refs[0], s->wi);
      for (const EmitterHit& hit : hits) {
        if (hit.primitive != s->target.primitive || glm::distance(hit.p, s->p) > 1e-4) continue;
        ++compared;
        EXPECT_NEAR(lights.emitted(0, hit, -s->wi).g, s->radiance.g, 1e-3f);
      }
    }
    EXPECT_GT(compared, 50);
  }
  // The first row of the picture lies at v = 1.
  const Lights disk = lights_of(emitting(light), {quadric_shape(quadric(Quadric::Kind::kDisk), DMat4(1))});
  EXPECT_EQ(disk.emitted(0, {{0, 0, 0}, {0, 0, 1}, {0, 0}, 0}, {0, 0, 1}).g, 1);
  EXPECT_EQ(disk.emitted(0, {{0, 0, 0}, {0, 0, 1}, {1, 1}, 0}, {0, 0, 1}).g, 8);
}

}  // namespace
}  // namespace woodcock::test
