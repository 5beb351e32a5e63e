#include "renderer/world/camera.h"

#include <numbers>

#include "renderer/core/warp.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {
namespace {

/// x0, x1, y0, y1 of the film in screen space, y up: the shorter axis spans [-1, 1] unless the file says otherwise.
std::array<double, 4> screen_window(const CameraDescription& camera, const FilmDescription& film) {
  if (camera.screen_window) return *camera.screen_window;
  const double aspect = camera.frame_aspect_ratio.value_or(static_cast<double>(film.x_resolution) / film.y_resolution);
  if (aspect > 1) return {-aspect, aspect, -1, 1};
  return {-1, 1, -1 / aspect, 1 / aspect};
}

}  // namespace

Camera::Camera(const CameraDescription& camera, const FilmDescription& film, const DMat4& render_from_world, double /*scale*/)
    : kind_(camera.kind),
      render_from_camera_(render_from_world * camera.world_from_camera),
      lens_radius_(camera.lens_radius),
      focal_distance_(camera.focal_distance),
      shutter_open_(camera.shutter_open),
      shutter_close_(camera.shutter_close) {
  const double determinant = glm::determinant(glm::dmat3(render_from_camera_));
  if (!(std::abs(determinant) > 0) || !std::isfinite(determinant))
    throw SceneError(camera.where, "found a camera transform that has no inverse, expected one that keeps three dimensions");
  const auto [x0, x1, y0, y1] = screen_window(camera, film);
  if (!(std::abs(x1 - x0) > 0) || !(std::abs(y1 - y0) > 0))
    throw SceneError(camera.where, "found an empty screen window, expected x0 < x1 and y0 < y1");
  const double unit = kind_ == CameraDescription::Kind::kPerspective ? std::tan(camera.fov * std::numbers::pi / 360) : 1.0;
  screen_origin_ = DVec2(x0, y1) * unit;
  screen_per_pixel_ = DVec2((x1 - x0) / film.x_resolution, (y0 - y1) / film.y_resolution) * unit;
  position_ = DVec3(render_from_camera_ * glm::dvec4(0, 0, 0, 1));
}

Ray Camera::ray(DVec2 film, Vec2 lens, float time) const {
  const DVec2 screen = screen_origin_ + film * screen_per_pixel_;
  const bool perspective = kind_ == CameraDescription::Kind::kPerspective;
  DVec3 o = perspective ? DVec3(0) : DVec3(screen, 0);
  DVec3 d = perspective ? DVec3(screen, 1) : DVec3(0, 0, 1);
  if (lens_radius_ > 0) {
    // All rays of one film position meet where the ray through the lens centre crosses the plane of focus.
    const DVec3 focus = o + focal_distance_ * d;
    o += DVec3(DVec2(square_to_disk(lens)) * lens_radius_, 0);
    d = focus - o;
  }
  Ray ray;
  ray.o = DVec3(render_from_camera_ * glm::dvec4(o, 1));
  ray.d = glm::normalize(DVec3(render_from_camera_ * glm::dvec4(d, 0)));
  ray.time = static_cast<float>(shutter_open_ + (shutter_close_ - shutter_open_) * static_cast<double>(time));
  return ray;
}

}  // namespace woodcock
