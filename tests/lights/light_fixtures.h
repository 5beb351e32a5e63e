// Scenes of lights for tests, and statistics of two estimates of one number.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "renderer/core/frame.h"
#include "renderer/core/random.h"
#include "renderer/geometry/geometry.h"
#include "renderer/lights/light.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::test {

/// Mean and its standard error, from independent values.
class Estimate {
 public:
  void add(double x) {
    ++n_;
    const double delta = x - mean_;
    mean_ += delta / static_cast<double>(n_);
    squares_ += delta * (x - mean_);
  }
  double mean() const { return mean_; }
  double error() const { return std::sqrt(squares_ / static_cast<double>(n_) / static_cast<double>(n_ - 1)); }

 private:
  int64_t n_ = 0;
  double mean_ = 0, squares_ = 0;
};

/// Five standard errors: a false alarm in 1.7 million comparisons, plus what float results may be off.
inline bool agree(const Estimate& a, const Estimate& b) {
  const double sigma = std::hypot(a.error(), b.error());
  return std::abs(a.mean() - b.mean()) <= 5 * sigma + 1e-5 * std::abs(a.mean());
}
inline bool agree(const Estimate& a, double exact) { return std::abs(a.mean() - exact) <= 5 * a.error() + 1e-5 * std::abs(exact); }

/// Writes a float PFM picture into a folder of this process, since tests run side by side; the top row first. Returns its path.
inline std::string write_pfm(const std::string& name, int width, int height, const std::vector<Rgb>& pixels) {
  static const testing::TemporaryFolder folder;
  const std::string path = (folder / name).string();
  std::ofstream file(path, std::ios::binary);
  file << "PF\n" << width << " " << height << "\n-1.0\n";
  for (int y = height - 1; y >= 0; --y)  // PFM goes from the bottom up
    for (int x = 0; x < width; ++x) {
      const Rgb& pixel = pixels[static_cast<size_t>(y * width + x)];
      file.write(reinterpret_cast<const char*>(&pixel), sizeof pixel);
    }
  return path;
}

inline Shape quadric_shape(Quadric q, const DMat4& render_from_object, bool flip = false) {
  q.render_from_object = render_from_object;
  q.object_from_render = glm::inverse(render_from_object);
  Shape shape;
  shape.geometry = q;
  shape.flip = flip;
  return shape;
}

inline SceneDescription emitting(const AreaLightDescription& light, FloatParameter alpha = {1, kNone}) {
  SceneDescription scene;
  ShapeDescription shape;
  shape.area_light = light;
  shape.alpha = alpha;
  scene.shapes.push_back(shape);
  return scene;
}

inline Lights lights_of(const SceneDescription& scene, const std::vector<Shape>& shapes = {}, double scale = 1) {
  Box3 bounds;
  for (const Shape& shape : shapes) {
    const Box3 b = bounds_of(shape);
    bounds.add(b.lower);
    bounds.add(b.upper);
  }
  return Lights(scene, shapes, DMat4(scale), scale, bounds);
}

inline Lights one_light(const LightKind& kind, const DMat4& world_from_light = DMat4(1), double scale = 1) {
  SceneDescription scene;
  LightDescription light;
  light.world_from_light = world_from_light;
  light.kind = kind;
  scene.lights.push_back(light);
  DMat4 render_from_world(scale);
  render_from_world[3][3] = 1;
  return Lights(scene, {}, render_from_world, scale, Box3{Vec3(-1), Vec3(1)});
}

inline Quadric quadric(Quadric::Kind kind) {
  Quadric q;
  q.kind = kind;
  if (kind == Quadric::Kind::kDisk) q.z_min = 0;  // its height
  return q;
}

inline Shape triangle_shape(const Mesh& mesh, bool flip = false) {
  Shape shape;
  shape.geometry = mesh;
  shape.flip = flip;
  return shape;
}
/// A square picture of zeros in which `lit` (from the top left) has the given colours.
inline std::string picture(const std::string& name, int n, const std::vector<std::pair<IVec2, Rgb>>& lit) {
  std::vector<Rgb> pixels(static_cast<size_t>(n * n), Rgb(0));
  for (const auto& [at, value] : lit) pixels[static_cast<size_t>(at.y * n + at.x)] = value;
  return write_pfm(name, n, n, pixels);
}

inline Lights image_light(const std::string& file, const DMat4& world_from_light = DMat4(1), float illuminance = 0) {
  InfiniteLightDescription light;
  light.image_file = file;
  light.illuminance = illuminance;
  return one_light(light, world_from_light);
}

}  // namespace woodcock::test
