// Cameras: from a position on the film to a ray in render space.
#pragma once

#include "renderer/core/vec.h"
#include "renderer/scene/description.h"

namespace woodcock {

/// A perspective or orthographic camera with an optional thin lens. Immutable.
///
/// Camera space is pbrt-v4's: left-handed, x right, y up, looking along +z. Whatever matrix the file builds is
/// followed as it is, so a transform of negative determinant mirrors the picture.
class Camera {
 public:
  /// `render_from_world` maps world to render space, where lengths are `scale` times world lengths.
  /// Throws SceneError where the camera's transform or screen window has no inverse.
  Camera(const CameraDescription& camera, const FilmDescription& film, const DMat4& render_from_world, double scale);

  /// The ray through `film`, in render space and with a unit direction.
  /// film: continuous raster position in pixels, pixel (x, y) covers [x, x+1) × [y, y+1), y down.
  /// lens in [0,1)²: a point of the lens, unused by a pinhole. time in [0,1): a moment of the shutter interval.
  /// Everything is in double, so that a tiny screen window still tells pixels apart.
  Ray ray(DVec2 film, Vec2 lens, float time) const;

  /// The centre of projection (perspective) or of the screen window's plane (orthographic), in render space.
  DVec3 position() const { return position_; }
  /// True where points of the lens lead to different rays.
  bool has_lens() const { return lens_radius_ > 0; }

 private:
  CameraDescription::Kind kind_;
  DMat4 render_from_camera_;
  DVec2 screen_origin_;     // camera-space x, y (on the plane z = 1 for perspective) of raster (0, 0)
  DVec2 screen_per_pixel_;  // the same, for one raster step to the right and down
  double lens_radius_;      // camera-space units, that is before the camera's own scale
  double focal_distance_;
  double shutter_open_, shutter_close_;
  DVec3 position_;
};

}  // namespace woodcock
