// Bilinear patches: rays that leave one.
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace woodcock
