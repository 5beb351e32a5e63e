#include "tests/transport/estimate.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "renderer/scene/read_scene.h"

namespace woodcock::testing {
namespace {

std::string rgb(const char* name, Rgb value) {
  return fmt::format(" \"rgb {}\" [ {:.9g} {:.9g} {:.9g} ]", name, value.x, value.y, value.z);
}

/// Runs the paths and hands each radiance to `take`.
template <typename Take>
PathCounters run(const CompiledScene& scene, int samples, uint64_t seed, Take&& take) {
  PathCounters counters;
  PathSettings settings = scene.settings;
  settings.frame_seed = frame_seed(seed, 0);
  const RenderPlan plan(*scene.world, settings);
  const int pixels = scene.width * scene.height;
  for (int i = 0; i < samples; ++i) {
    const int pixel = i % pixels, x = pixel % scene.width, y = pixel / scene.width;
    const PathKey key =
        path_key(settings.frame_seed, static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint64_t>(i / pixels));
    const CameraSample camera = camera_sample(*scene.world, key, x, y);
    take(camera.weight * scene.radiance(*scene.world, plan, camera.ray, key, counters).radiance);
  }
  return counters;
}

}  // namespace

CompiledScene compile(const std::string& text, const TransferTerms& terms) {
  SceneDescription description = read_scene_text(text, "test.pbrt", ".", {});
  description.settings.terms = terms;
  CompiledScene scene;
  scene.settings.terms = terms;
  scene.world = build_world(description);
  scene.settings.max_depth = description.settings.max_depth;
  scene.width = description.film.x_resolution;
  scene.height = description.film.y_resolution;
  return scene;
}

CompiledScene with_estimator(CompiledScene scene, const EstimatorChoice& choice) {
  const EstimatorInfo* estimator = find_estimator(choice.name);
  EXPECT_NE(estimator, nullptr) << choice.name;
  scene.radiance = estimator->radiance;
  scene.settings.paper = {static_cast<float>(choice.step * scene.world->space.scale), choice.directions, choice.branching};
  return scene;
}

Estimate estimate(const CompiledScene& scene, int samples, uint64_t seed) {
  Estimate result;
  std::array<double, 3> m2{};
  result.counters = run(scene, samples, seed, [&](Rgb radiance) {
    result.count += 1;
    for (size_t c = 0; c < 3; ++c) {
      const double value = static_cast<double>(radiance[static_cast<int>(c)]), delta = value - result.mean[c];
      result.mean[c] += delta / result.count;
      m2[c] += delta * (value - result.mean[c]);
    }
  });
  for (size_t c = 0; c < 3; ++c) result.error[c] = std::sqrt(m2[c] / (result.count - 1) / result.count);
  return result;
}

std::vector<Rgb> radiances(const CompiledScene& scene, int samples, uint64_t seed) {
  std::vector<Rgb> result;
  run(scene, samples, seed, [&](Rgb radiance) { result.push_back(radiance); });
  return result;
}

void expect_value(const Estimate& a, std::array<double, 3> expected, double resolution, const std::string& what) {
  for (size_t c = 0; c < 3; ++c) {
    const std::string report = fmt::format("{}: channel {} is {:.7g} ± {:.2g}, expected {:.7g}, off by {:+.2f} standard errors", what, c,
                                           a.mean[c], a.error[c], expected[c], (a.mean[c] - expected[c]) / std::max(a.error[c], 1e-12));
    EXPECT_TRUE(std::isfinite(a.mean[c])) << report;
    EXPECT_LE(a.error[c], resolution * std::abs(expected[c])) << report;
    EXPECT_LE(std::abs(a.mean[c] - expected[c]), kStandardErrors * a.error[c] + kRounding * std::abs(expected[c])) << report;
  }
  EXPECT_EQ(a.counters.truncated, 0u) << what;
  EXPECT_EQ(a.counters.majorant_violations, 0u) << what;
}

void expect_equal(const Estimate& a, const Estimate& b, double resolution, const std::string& what) {
  for (size_t c = 0; c < 3; ++c) {
    const double error = std::hypot(a.error[c], b.error[c]);
    const std::string report = fmt::format("{}: channel {} is {:.7g} ± {:.2g} and {:.7g} ± {:.2g}, {:+.2f} standard errors apart", what, c,
                                           a.mean[c], a.error[c], b.mean[c], b.error[c], (a.mean[c] - b.mean[c]) / std::max(error, 1e-12));
    EXPECT_TRUE(std::isfinite(a.mean[c]) && std::isfinite(b.mean[c])) << report;
    EXPECT_LE(error, resolution * std::max(std::abs(a.mean[c]), std::abs(b.mean[c]))) << report;
    EXPECT_LE(std::abs(a.mean[c] - b.mean[c]), kStandardErrors * error + kRounding * std::abs(b.mean[c])) << report;
  }
  for (const Estimate* e : {&a, &b}) {
    EXPECT_EQ(e->counters.truncated, 0u) << what;
    EXPECT_EQ(e->counters.majorant_violations, 0u) << what;
  }
}

std::string perspective(DVec3 eye, DVec3 target, double fov, int max_depth) {
  // Any direction that is not nearly parallel to the view serves as up.
  const DVec3 d = target - eye;
  const char* up = std::abs(d.y) > 0.9 * glm::length(d) ? "0 0 1" : "0 1 0";
  return fmt::format(
      "LookAt {:.17g} {:.17g} {:.17g}  {:.17g} {:.17g} {:.17g}  {}\n"
      "Camera \"perspective\" \"float fov\" {:.9g}\n"
      "PixelFilter \"box\" \"float xradius\" 0.5 \"float yradius\" 0.5\n"
      "Film \"rgb\" \"string filename\" \"test.exr\" \"integer xresolution\" 8 \"integer yresolution\" 8\n"
      "Sampler \"independent\" \"integer pixelsamples\" 16\n"
      "Integrator \"volpath\" \"integer maxdepth\" {}\n",
      eye.x, eye.y, eye.z, target.x, target.y, target.z, up, fov, max_depth);
}

std::string sphere(double radius, DVec3 at) {
  return fmt::format("AttributeBegin\nTranslate {:.17g} {:.17g} {:.17g}\nShape \"sphere\" \"float radius\" {:.9g}\nAttributeEnd\n", at.x,
                     at.y, at.z, radius);
}

std::string environment(Rgb radiance) { return "LightSource \"infinite\"" + rgb("L", radiance) + "\n"; }

std::string homogeneous(const std::string& name, Rgb sigma_a, Rgb sigma_s, double g, Rgb emission) {
  return "MakeNamedMedium \"" + name + "\" \"string type\" \"homogeneous\"" + rgb("sigma_a", sigma_a) + rgb("sigma_s", sigma_s) +
         fmt::format(" \"float g\" {:.9g}", g) + (is_black(emission) ? "" : rgb("Le", emission)) + "\n";
}

std::string constant_grid(const std::string& name, Rgb sigma_a, Rgb sigma_s, double half, double g, Rgb emission) {
  std::string density;
  for (int i = 0; i < 27; ++i) density += " 1";
  return fmt::format(
      "MakeNamedMedium \"{}\" \"string type\" \"uniformgrid\" \"integer nx\" 3 \"integer ny\" 3 \"integer nz\" 3\n"
      "  \"point3 p0\" [ {:.9g} {:.9g} {:.9g} ] \"point3 p1\" [ {:.9g} {:.9g} {:.9g} ]{}{} \"float g\" {:.9g}{} \"float density\" [{} ]\n",
      name, -3 * half, -3 * half, -3 * half, 3 * half, 3 * half, 3 * half, rgb("sigma_a", sigma_a), rgb("sigma_s", sigma_s), g,
      is_black(emission) ? "" : rgb("Le", emission), density);
}

std::string constant_rgb_grid(const std::string& name, Rgb sigma_a, Rgb sigma_s, double half, double g, Rgb emission) {
  const auto values = [](const char* parameter, Rgb value) {
    std::string text = fmt::format(" \"rgb {}\" [", parameter);
    for (int i = 0; i < 27; ++i) text += fmt::format(" {:.9g} {:.9g} {:.9g}", value.x, value.y, value.z);
    return text + " ]\n ";
  };
  return fmt::format(
             "MakeNamedMedium \"{}\" \"string type\" \"rgbgrid\" \"integer nx\" 3 \"integer ny\" 3 \"integer nz\" 3\n"
             "  \"point3 p0\" [ {:.9g} {:.9g} {:.9g} ] \"point3 p1\" [ {:.9g} {:.9g} {:.9g} ] \"float g\" {:.9g}\n ",
             name, -3 * half, -3 * half, -3 * half, 3 * half, 3 * half, 3 * half, g) +
         values("sigma_a", sigma_a) + values("sigma_s", sigma_s) + (is_black(emission) ? "" : values("Le", emission)) + "\n";
}

std::string boundary(const std::string& inside, const std::string& outside, const std::string& shape) {
  return "AttributeBegin\nMaterial \"interface\"\nMediumInterface \"" + inside + "\" \"" + outside + "\"\n" + shape + "AttributeEnd\n";
}

}  // namespace woodcock::testing
