#include "renderer/geometry/geometry.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <set>

#include "renderer/core/frame.h"
#include "renderer/core/random.h"
#include "renderer/core/warp.h"
#include "renderer/geometry/patch.h"
#include "tests/geometry/shapes.h"

namespace woodcock {
namespace {

using testing::only;
using testing::plane;
using testing::sphere_at;

TEST(Geometry, ARayFromASphereNeverMeetsTheSideItLeft) {
  const Geometry g = only({sphere_at({3, -2, 5}, 0.7), false});
  Stream random(1);
  for (int i = 0; i < 20000; ++i) {
    const Vec3 target = Vec3(3, -2, 5) + 0.6f * square_to_sphere(random.uniform2());
    const Vec3 origin = Vec3(3, -2, 5) + 4.0f * square_to_sphere(random.uniform2());
    const Ray ray{origin, glm::normalize(target - origin)};
    const auto hit = g.intersect(ray, kInf);
    ASSERT_TRUE(hit);
    const SurfacePoint s = g.surface(*hit, ray);
    Vec3 out = square_to_sphere(random.uniform2());
    if (glm::dot(out, s.ng) < 0) out = -out;
    EXPECT_FALSE(g.intersect({offset_origin(s, out), out}, kInf)) << i;
    const auto through = g.intersect({offset_origin(s, -out), -out}, kInf);
    ASSERT_TRUE(through) << i;
    // A chord's length changes by the rounding of its start and offset of its start (about 2e-6) over the cosine.
    const double cosine = glm::dot(DVec3(out), DVec3(s.ng));
    EXPECT_NEAR(through->t, 1.4 * cosine, 3e-6 / std::max(cosine, 1e-3));
  }
}

TEST(Geometry, OccludedAgreesWithIntersect) {
  std::vector<Shape> shapes;
  shapes.push_back({plane(2, 5), false});
  shapes.push_back({sphere_at({0.5, 0, 1}, 0.5), false});
  PatchMesh patch;
  patch.positions = {{-1, -1, 0.5f}, {0, -1, 0.9f}, {-1, 0.5f, 0.2f}, {0, 0, 1.5f}};
  patch.patches = {{0, 1, 2, 3}};
  shapes.push_back({patch, false});
  const Geometry g(std::move(shapes), 3, {}, {});
  Stream random(3);
  int hits = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec3 a = (Vec3(random.uniform2(), random.uniform()) - 0.5f) * 5.0f, b = (Vec3(random.uniform2(), random.uniform()) - 0.5f) * 5.0f;
    const float distance = glm::length(b - a);
    const Ray ray{a, (b - a) / distance};
    const bool met = g.intersect(ray, distance).has_value();
    hits += met;
    EXPECT_EQ(met, g.occluded(ray, distance, {})) << i;
  }
  EXPECT_GT(hits, 2000);
}

TEST(Geometry, AShadowRaySeesItsTargetButNotWhatIsInFrontOfIt) {
  std::vector<Shape> shapes;
  shapes.push_back({plane(2, 1), false});
  const Geometry g(std::move(shapes), 1, {}, {});
  const Ray up{Vec3(0.1f, 0.2f, -1), Vec3(0, 0, 1)};
  const auto hit = g.intersect(up, kInf);
  ASSERT_TRUE(hit);
  EXPECT_TRUE(g.occluded(up, 1.0005, {}));
  EXPECT_FALSE(g.occluded(up, 1.0005, {0, hit->primitive}));
  EXPECT_FALSE(g.occluded(up, 2.0, {0, hit->primitive})) << "a ray meets a triangle once: what it meets is the target";
  EXPECT_TRUE(g.occluded(up, 2.0, {0, hit->primitive + 1}));
}

TEST(Geometry, InstancesAreWhereTheirTransformPutsThem) {
  std::vector<Shape> shapes;
  shapes.push_back({plane(1, 3), false});
  shapes.push_back({sphere_at({0, 0, 0}, 0.5), false});
  DMat4 m(1);
  m[0] = {0, 2, 0, 0};
  m[1] = {-3, 0, 0, 0};
  m[2] = {0, 0, 0.5, 0};
  m[3] = {10, 20, 30, 1};
  const Geometry g(std::move(shapes), 0, {{0, 2}}, {{0, m}});
  Stream random(4);
  int spheres = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vec3 origin = Vec3(10, 20, 30) + 9.0f * square_to_sphere(random.uniform2());
    const Vec3 target = Vec3(10, 20, 30) + (Vec3(random.uniform2(), 0) - 0.5f) * Vec3(4, 3, 0);
    const Ray ray{origin, glm::normalize(target - origin)};
    const auto hit = g.intersect(ray, kInf);
    if (!hit) continue;
    const SurfacePoint s = g.surface(*hit, ray);
    const DVec3 local = DVec3(glm::inverse(m) * glm::dvec4(DVec3(s.p), 1));
    if (hit->shape == 1) {
      ++spheres;
      EXPECT_NEAR(glm::length(local), 0.5, 1e-5);
    } else {
      EXPECT_NEAR(local.z, 0, 1e-5);
    }
    EXPECT_NEAR(length_squared(s.ng), 1, 1e-5f);
  }
  EXPECT_GT(spheres, 100);
}

TEST(Geometry, APatchIsMetWhereItsParametersSay) {
  const std::array<DVec3, 4> p{DVec3{0, 0, 0}, DVec3{1, 0, 0.3}, DVec3{0, 1, -0.2}, DVec3{1.2, 1.1, 0.8}};
  Stream random(5);
  for (int i = 0; i < 5000; ++i) {
    const double u = random.uniform_double(), v = random.uniform_double();
    const DVec3 at = (1 - v) * ((1 - u) * p[0] + u * p[1]) + v * ((1 - u) * p[2] + u * p[3]);
    const DVec3 d = glm::normalize(DVec3(random.uniform_double() - 0.5, random.uniform_double() - 0.5, -1));
    const auto hit = intersect_patch(p, at - 3.0 * d, d, 0, 10);
    ASSERT_TRUE(hit) << i;
    const DVec3 found = at - 3.0 * d + hit->t * d;
    const DVec3 expected =
        (1 - hit->uv.y) * ((1 - hit->uv.x) * p[0] + hit->uv.x * p[1]) + hit->uv.y * ((1 - hit->uv.x) * p[2] + hit->uv.x * p[3]);
    EXPECT_LT(glm::length(found - expected), 1e-9);
  }
}

/// A tilted square of half edge `e` around c, and its unit normal.
std::pair<Mesh, Vec3> tilted_square(Stream& random, Vec3 c, float e) {
  const Frame f = Frame::from_normal(square_to_sphere(random.uniform2()));
  Mesh mesh;
  mesh.positions = {c - e * f.s - e * f.t, c + e * f.s - e * f.t, c + e * f.s + e * f.t, c - e * f.s + e * f.t};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return {mesh, f.n};
}

TEST(Geometry, RaysThatMayStartAnywhereMeetWhatIsAUnitInTheLastPlaceAhead) {
  // N12: of the rays that start this close Embree alone overlooks one in fifty.
  Stream random(7);
  int ahead = 0, missed = 0, missed_on_surfaces = 0;
  for (int scene = 0; scene < 40; ++scene) {
    const Vec3 c = 0.3f * square_to_sphere(random.uniform2());
    const float e = scene % 2 == 0 ? 0.5f : 0.01f;
    const auto [mesh, n] = tilted_square(random, c, e);
    const auto build = [&](Geometry::Starts starts) {
      std::vector<Shape> shapes;
      shapes.push_back({mesh, false});
      return Geometry(std::move(shapes), 1, {}, {}, starts);
    };
    const Geometry careful = build(Geometry::Starts::kAnywhere), plain = build(Geometry::Starts::kOnSurfaces);
    for (int i = 0; i < 5000; ++i) {
      const DVec3 corner0 = mesh.positions[0], edge1 = mesh.positions[1] - corner0, edge2 = mesh.positions[3] - corner0;
      const double u = static_cast<double>(random.uniform()), v = static_cast<double>(random.uniform());
      const DVec3 p = corner0 + u * edge1 + v * edge2;
      const Ray ray{p - DVec3(3e-7f * random.uniform() * n), square_to_sphere(random.uniform2())};
      double t = std::numeric_limits<double>::quiet_NaN();  // near an edge
      for (const auto& triangle : mesh.triangles) {
        const auto hit = intersect_triangle_plane(mesh.positions[triangle[0]], mesh.positions[triangle[1]], mesh.positions[triangle[2]],
                                                  DVec3(ray.o), DVec3(ray.d));
        if (hit && hit->uv.x > 1e-3 && hit->uv.y > 1e-3 && hit->uv.x + hit->uv.y < 1 - 1e-3) t = hit->t;
      }
      const auto found = careful.intersect(ray, kInf);
      if (t > 0 && t < 1e-4) {
        ++ahead;
        missed += !found;
        missed_on_surfaces += !plain.intersect(ray, kInf);
        if (found) {
          EXPECT_EQ(found->t, t);
        }
      } else if (t < -1e-9 && found) {
        ADD_FAILURE() << "met behind the origin: " << t;
      }
    }
  }
  EXPECT_GT(ahead, 50000);
  EXPECT_EQ(missed, 0);
  EXPECT_GT(missed_on_surfaces, 0) << "Embree has become exact: the lead of its rays can go";
}

TEST(Geometry, CoincidentHitsAreAllGivenAndOthersAreNot) {
  Stream random(8);
  for (int scene = 0; scene < 200; ++scene) {
    const Vec3 c = 0.3f * square_to_sphere(random.uniform2());
    auto [mesh, n] = tilted_square(random, c, 0.3f);
    const auto moved = [&](float by) {
      Mesh copy = mesh;
      for (DVec3& p : copy.positions) p += DVec3(by * n);
      copy.triangles = {{1, 2, 3}, {1, 3, 0}};
      return copy;
    };
    PatchMesh patch;
    patch.positions = {mesh.positions[0], mesh.positions[1], mesh.positions[3], mesh.positions[2]};
    patch.patches = {{0, 1, 2, 3}};
    Quadric disk;
    disk.kind = Quadric::Kind::kDisk;
    disk.z_min = disk.z_max = 0;
    disk.radius = 0.5;
    const Frame f = Frame::from_normal(n);
    disk.render_from_object =
        DMat4(glm::dvec4(DVec3(f.s), 0), glm::dvec4(DVec3(f.t), 0), glm::dvec4(DVec3(f.n), 0), glm::dvec4(DVec3(c), 1));
    disk.object_from_render = glm::inverse(disk.render_from_object);
    std::vector<Shape> shapes;
    shapes.push_back({mesh, false});
    shapes.push_back({moved(0), false});
    shapes.push_back({patch, false});
    shapes.push_back({disk, false});
    shapes.push_back({moved(4e-5f), false});
    shapes.push_back({moved(-4e-5f), false});
    shapes.push_back({mesh, false});  // in an object
    const Geometry g(std::move(shapes), 6, {{6, 1}}, {{0, DMat4(1)}});
    for (int i = 0; i < 50; ++i) {
      const Vec3 target = c + (random.uniform() - 0.5f) * 0.3f * f.s + (random.uniform() - 0.5f) * 0.3f * f.t;
      const Vec3 from = target + 0.8f * f.to_world(glm::normalize(Vec3(random.uniform() - 0.5f, random.uniform() - 0.5f, 0.7f)));
      const Ray ray{from, glm::normalize(target - from)};
      const auto first = g.intersect(ray, kInf);
      ASSERT_TRUE(first);
      ASSERT_EQ(first->shape, 4);
      const SurfacePoint s = g.surface(*first, ray);
      const auto second = g.intersect({offset_origin(s, ray.d), ray.d}, kInf);
      ASSERT_TRUE(second);
      std::array<CoincidentHit, 16> found;
      const Ray again{offset_origin(s, ray.d), ray.d};
      const size_t count = g.coincident(again, *second, found);
      std::set<int> met;
      for (size_t k = 0; k < count; ++k) met.insert(found[k].hit.shape);
      EXPECT_EQ(met, (std::set<int>{0, 1, 2, 3, 6})) << scene << " " << i;
    }
  }
}

TEST(Geometry, AnEmptySceneIsMissed) {
  const Geometry g({}, 0, {}, {});
  EXPECT_FALSE(g.intersect({Vec3(0), Vec3(0, 0, 1)}, kInf));
  EXPECT_FALSE(g.occluded({Vec3(0), Vec3(0, 0, 1)}, kInf, {}));
  EXPECT_TRUE(g.bounds().empty());
}

/// Hits of rays aimed at vertices and edges of a mesh of a million triangles.
std::vector<std::pair<uint32_t, double>> tie_hits(int threads) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(threads));
  Mesh mesh = plane(1, 720);
  for (DVec3& p : mesh.positions) p.z = 0.05 * std::sin(9 * p.x) * std::cos(7 * p.y);
  EXPECT_GE(mesh.triangles.size(), 1000000u);
  const std::vector<DVec3> vertices = mesh.positions;
  const Geometry g = only({std::move(mesh), false});
  std::vector<std::pair<uint32_t, double>> hits;
  Stream random(6);
  for (int i = 0; i < 200000; ++i) {
    const DVec3 a = vertices[random.next_u32() % vertices.size()], b = vertices[random.next_u32() % vertices.size()];
    const DVec3 target = (i & 1) != 0 ? a : (i & 2) != 0 ? a + DVec3(1.0 / 720, 0, 0) : 0.5 * (a + b);
    const DVec3 origin(Vec3(random.uniform2() * 4.0f - 2.0f, 1 + random.uniform()));
    const auto hit = g.intersect({origin, glm::normalize(target - origin)}, kInf);
    hits.emplace_back(hit ? hit->primitive : 0xffffffffu, hit ? hit->t : -1.0);
  }
  return hits;
}

TEST(Geometry, ABvhOfAMillionTrianglesGivesTheSameHitsBuiltWithOneAndTwoThreads) { EXPECT_EQ(tie_hits(1), tie_hits(2)); }

}  // namespace
}  // namespace woodcock
