// Bilinear patches: rays that leave one.
#include <gtest/gtest.h>

#include <array>

#include "renderer/core/random.h"
#include "renderer/core/warp.h"
#include "renderer/geometry/geometry.h"

namespace woodcock {
namespace {

TEST(Patch, RaysThatLeaveAFlatPatchDoNotMeetItAgain) {
  // A trapezoid in a coordinate plane: the rounding of its points is zero there, so that the offset of a ray's origin
  // is zero as well, and the patch must tell by itself that the ray starts on it.
  for (const float height : {0.0f, 0.3f}) {
    PatchMesh mesh;
    mesh.positions = {{-1, -1, height}, {1, -1, height}, {-1.5f, 1, height}, {1, 2, height}};
    mesh.patches = {{0, 1, 2, 3}};
    Shape shape;
    shape.geometry = mesh;
    const Geometry geometry({shape}, 1, {}, {});
    Stream random(1);
    int hits = 0, again = 0;
    for (int i = 0; i < 20000; ++i) {
      const Vec3 o(random.uniform(), random.uniform(), 2), to(random.uniform() - 0.5f, random.uniform() - 0.5f, height);
      const Ray ray{o, glm::normalize(to - o)};
      const auto hit = geometry.intersect(ray, 100);
      if (!hit) continue;
      ++hits;
      const SurfacePoint at = geometry.surface(*hit, ray);
      const Vec3 d = square_to_sphere(random.uniform2());
      again += geometry.intersect({offset_origin(at, d), d}, 100).has_value();
    }
    EXPECT_EQ(hits, 20000);
    EXPECT_EQ(again, 0);
  }
}

/// dp/du and dp/dv at a point, by differences of the texture coordinates that neighbouring rays meet.
TEST(Patch, TangentsFollowTheTextureCoordinates) {
  PatchMesh mesh;
  mesh.positions = {{-1, -1, 0}, {1, -1.2f, 0}, {-1, 1, 0.5f}, {1.3f, 1, -0.2f}};
  mesh.patches = {{0, 1, 2, 3}};
  const auto uvs = {std::array{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1), Vec2(1, 1)},   // the patch's own
                    std::array{Vec2(0, 0), Vec2(0, 1), Vec2(1, 0), Vec2(1, 1)},   // swapped
                    std::array{Vec2(0, 1), Vec2(2, 0), Vec2(1, 3), Vec2(4, 2)}};  // sheared and turned
  for (const auto& uv : uvs) {
    mesh.uv = {uv.begin(), uv.end()};
    Shape shape;
    shape.geometry = mesh;
    const Geometry geometry({shape}, 1, {}, {});
    const auto meet = [&](Vec2 at) {
      const Ray ray{{at.x, at.y, 3}, {0, 0, -1}};
      return geometry.surface(*geometry.intersect(ray, 100), ray);
    };
    constexpr float kStep = 1e-3f;
    const SurfacePoint s = meet({0.2f, 0.1f});
    for (const Vec2 step : {Vec2(kStep, 0), Vec2(0, kStep)}) {
      const SurfacePoint a = meet(Vec2(0.2f, 0.1f) - step), b = meet(Vec2(0.2f, 0.1f) + step);
      const Vec2 duv = b.uv - a.uv;
      EXPECT_NEAR(glm::length((b.p - a.p) - DVec3(duv.x * s.dpdu + duv.y * s.dpdv)), 0, 1e-3 * kStep);
    }
  }
}

}  // namespace
}  // namespace woodcock
