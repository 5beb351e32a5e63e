// Cameras: rays through known film positions against values computed by hand.
#include "renderer/world/camera.h"

#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>
#include <numbers>

#include "renderer/core/random.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {
namespace {

FilmDescription film(int width, int height) {
  FilmDescription film;
  film.x_resolution = width;
  film.y_resolution = height;
  return film;
}

Camera camera(const CameraDescription& description, const FilmDescription& f, const DMat4& render_from_world = DMat4(1), double scale = 1) {
  return Camera(description, f, render_from_world, scale);
}

void expect_near(Vec3 a, DVec3 b, double tolerance) {
  EXPECT_LE(glm::distance(DVec3(a), b), tolerance) << a.x << " " << a.y << " " << a.z << " against " << b.x << " " << b.y << " " << b.z;
}

TEST(Camera, PerspectiveCornersSpanTheFieldOfViewOfTheShorterAxis) {
  CameraDescription c;
  c.fov = 90;
  for (const auto& [width, height] : {std::pair{200, 100}, std::pair{100, 200}, std::pair{64, 64}}) {
    const Camera cam = camera(c, film(width, height));
    const double x = width > height ? static_cast<double>(width) / height : 1, y = height > width ? static_cast<double>(height) / width : 1;
    expect_near(cam.ray({0, 0}, {0, 0}, 0).d, glm::normalize(DVec3(-x, y, 1)), 1e-7);
    expect_near(cam.ray({width, height}, {0, 0}, 0).d, glm::normalize(DVec3(x, -y, 1)), 1e-7);
    expect_near(cam.ray({width / 2.0, height / 2.0}, {0, 0}, 0).d, DVec3(0, 0, 1), 0);
    expect_near(cam.ray({0, 0}, {0.5f, 0.2f}, 0).o, DVec3(0), 0);
  }
  c.fov = 2 * std::atan(0.25) * 180 / std::numbers::pi;
  expect_near(camera(c, film(10, 10)).ray({10, 5}, {0, 0}, 0).d, glm::normalize(DVec3(0.25, 0, 1)), 1e-7);
}

TEST(Camera, ScreenWindowAndAspectRatioOverrideTheFilmShape) {
  CameraDescription c;
  c.frame_aspect_ratio = 3;
  expect_near(camera(c, film(50, 50)).ray({50, 0}, {0, 0}, 0).d, glm::normalize(DVec3(3, 1, 1)), 1e-7);
  c.frame_aspect_ratio = 0.5;
  expect_near(camera(c, film(50, 50)).ray({50, 0}, {0, 0}, 0).d, glm::normalize(DVec3(1, 2, 1)), 1e-7);
  c.screen_window = {0.1, 0.3, -0.2, 0.6};
  expect_near(camera(c, film(50, 50)).ray({0, 0}, {0, 0}, 0).d, glm::normalize(DVec3(0.1, 0.6, 1)), 1e-7);
  expect_near(camera(c, film(50, 50)).ray({50, 50}, {0, 0}, 0).d, glm::normalize(DVec3(0.3, -0.2, 1)), 1e-7);
}

TEST(Camera, MirroringMatrixMirrorsThePicture) {
  CameraDescription c;
  const Ray plain = camera(c, film(20, 10)).ray({3, 2}, {0, 0}, 0);
  // `Scale -1 1 1` before everything: the camera matrix is the inverse of what the file builds.
  c.world_from_camera = glm::inverse(glm::scale(DMat4(1), DVec3(-1, 1, 1)));
  const Ray mirrored = camera(c, film(20, 10)).ray({3, 2}, {0, 0}, 0);
  EXPECT_EQ(mirrored.d, plain.d * DVec3(-1, 1, 1));
  expect_near(mirrored.d, DVec3(camera({}, film(20, 10)).ray({17, 2}, {0, 0}, 0).d), 1e-7);
}

TEST(Camera, RenderSpaceMovesAndScalesOriginsOnly) {
  CameraDescription c;
  c.world_from_camera = glm::translate(DMat4(1), DVec3(1e5, 2e5, -3e5));
  const DMat4 render_from_world = glm::translate(glm::scale(DMat4(1), DVec3(0.125)), DVec3(-1e5, -2e5, 3e5 - 8));
  const Camera cam = camera(c, film(10, 10), render_from_world, 0.125);
  expect_near(cam.ray({0, 0}, {0, 0}, 0).o, DVec3(0, 0, -1), 0);
  expect_near(cam.position(), DVec3(0, 0, -1), 0);
  expect_near(cam.ray({0, 0}, {0, 0}, 0).d, glm::normalize(DVec3(-1, 1, 1)), 1e-7);
}

TEST(Camera, ThinLensRaysMeetOnThePlaneOfFocus) {
  CameraDescription c;
  c.lens_radius = 0.5;
  c.focal_distance = 7;
  const Camera cam = camera(c, film(100, 100));
  EXPECT_TRUE(cam.has_lens());
  const DVec2 at(80, 10);
  const DVec3 focus = 7.0 * DVec3(0.6, 0.8, 1);
  Stream random(1);
  double largest = 0, mean_square = 0;
  constexpr int kRays = 20000;
  for (int i = 0; i < kRays; ++i) {
    const Ray ray = cam.ray(at, random.uniform2(), 0);
    expect_near(ray.d, glm::normalize(focus - DVec3(ray.o)), 2e-7);
    EXPECT_EQ(ray.o.z, 0);
    const double r = glm::length(DVec3(ray.o));
    largest = std::max(largest, r);
    mean_square += r * r / kRays;
  }
  EXPECT_LE(largest, 0.5 + 1e-6);
  // Uniform on the disk: E r² = R²/2, with a standard deviation of R²/√12 a ray. Five of them: a false alarm in 1.7 million.
  EXPECT_NEAR(mean_square, 0.125, 5 * 0.25 / std::sqrt(12.0 * kRays));
}

TEST(Camera, OrthographicRaysAreParallelAndSpanTheScreen) {
  CameraDescription c;
  c.kind = CameraDescription::Kind::kOrthographic;
  c.screen_window = {-3, 5, -2, 2};
  c.world_from_camera = glm::rotate(glm::translate(DMat4(1), DVec3(10, 0, 0)), std::numbers::pi / 2, DVec3(0, 1, 0));
  const Camera cam = camera(c, film(80, 40));
  const Ray corner = cam.ray({0, 0}, {0, 0}, 0), other = cam.ray({80, 40}, {0, 0}, 0);
  expect_near(corner.d, DVec3(1, 0, 0), 1e-7);
  EXPECT_EQ(corner.d, other.d);
  expect_near(corner.o, DVec3(10, 2, 3), 1e-6);
  expect_near(other.o, DVec3(10, -2, -5), 1e-6);
  c.lens_radius = 0.1;
  c.focal_distance = 4;
  const Ray a = camera(c, film(80, 40)).ray({0, 0}, {0.1f, 0.2f}, 0);
  const float t = (14 - a.o.x) / a.d.x;
  expect_near(a.at(t), DVec3(14, 2, 3), 1e-5);
}

TEST(Camera, TinyScreenWindowStillTellsPixelsApart) {
  CameraDescription c;
  c.kind = CameraDescription::Kind::kOrthographic;
  // A window of 1e-6 around the origin of render space, the camera 1e6 away from it across the view.
  c.screen_window = {1e6, 1e6 + 1e-6, -5e-7, 5e-7};
  const DMat4 render_from_world = glm::translate(DMat4(1), DVec3(-1e6, 0, 0));
  const Camera cam = camera(c, film(100, 100), render_from_world);
  for (int x = 0; x < 100; ++x) {
    const float step = cam.ray({x + 1.0, 0}, {0, 0}, 0).o.x - cam.ray({static_cast<double>(x), 0}, {0, 0}, 0).o.x;
    EXPECT_NEAR(step, 1e-8, 2e-10);  // 1e6 has a rounding of 1e-10 in double
  }
}

TEST(Camera, TimeRunsOverTheShutterInterval) {
  CameraDescription c;
  c.shutter_open = 2;
  c.shutter_close = 4;
  EXPECT_EQ(camera(c, film(2, 2)).ray({1, 1}, {0, 0}, 0.25f).time, 2.5f);
}

TEST(Camera, RefusesMatricesAndWindowsWithoutInverse) {
  CameraDescription c;
  c.world_from_camera = glm::scale(DMat4(1), DVec3(1, 0, 1));
  EXPECT_THROW(camera(c, film(2, 2)), SceneError);
  c = {};
  c.screen_window = {1, 1, 0, 1};
  EXPECT_THROW(camera(c, film(2, 2)), SceneError);
}

}  // namespace
}  // namespace woodcock
