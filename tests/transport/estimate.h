// Renders a scene text in memory, one path a sample, and says how well the mean of each channel is known.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>

#include "renderer/transport/estimator.h"
#include "renderer/transport/render_plan.h"

namespace woodcock::testing {

/// A scene text compiled; `settings` as the file gives them.
struct CompiledScene {
  std::unique_ptr<const World> world;
  PathSettings settings;
  int width = 0, height = 0;
  RadianceFunction radiance = trace_path;
};
CompiledScene compile(const std::string& text, const TransferTerms& terms = {});

/// An estimator with what it takes; `step` in world units.
struct EstimatorChoice {
  std::string name;
  double step = 0;
  int directions = 1, branching = 1;
};
/// The same scene by another estimator.
CompiledScene with_estimator(CompiledScene scene, const EstimatorChoice& choice);

/// Mean over samples of every pixel. Samples are independent, so the standard error comes from their spread.
struct Estimate {
  std::array<double, 3> mean{}, error{};
  double count = 0;
  PathCounters counters;
};
/// `samples` in all, dealt round the pixels; sample i is sample i / pixels of pixel i mod pixels.
Estimate estimate(const CompiledScene& scene, int samples, uint64_t seed);
inline Estimate estimate(const std::string& text, int samples, uint64_t seed) { return estimate(compile(text), samples, seed); }

/// The radiance of the first `samples` paths, for comparisons to the bit.
std::vector<Rgb> radiances(const CompiledScene& scene, int samples, uint64_t seed);

/// Two-sided level of one comparison: 4.9 standard errors are exceeded once in a million. With fewer than a thousand
/// comparisons in a program a right renderer fails it less than once in a thousand seeds (Bonferroni). Seeds are
/// fixed, so a failure is a change of the program.
constexpr double kStandardErrors = 4.9;
/// What float32 itself may be off by, relative.
constexpr double kRounding = 2e-5;

/// Each channel of `a` equals the known value within noise; and the noise is at most `resolution` of it, so that
/// the comparison says something.
void expect_value(const Estimate& a, std::array<double, 3> expected, double resolution, const std::string& what);
inline void expect_value(const Estimate& a, double expected, double resolution, const std::string& what) {
  expect_value(a, {expected, expected, expected}, resolution, what);
}
/// Two estimates of the same quantity agree within their common noise, channel by channel.
void expect_equal(const Estimate& a, const Estimate& b, double resolution, const std::string& what);

/// Scene pieces. The camera has a box filter and 8 × 8 pixels. `fov` in degrees.
std::string perspective(DVec3 eye, DVec3 target, double fov, int max_depth);
std::string sphere(double radius, DVec3 at = DVec3(0));
std::string environment(Rgb radiance);
inline std::string environment(float radiance) { return environment(Rgb(radiance)); }
/// MakeNamedMedium of the kind "homogeneous".
std::string homogeneous(const std::string& name, Rgb sigma_a, Rgb sigma_s, double g = 0, Rgb emission = Rgb(0));
/// The same coefficients as grids that are constant over the cube of half edge `half` around the origin: a uniformgrid
/// and an rgbgrid. They reach one voxel farther, so that the interpolant is constant inside.
std::string constant_grid(const std::string& name, Rgb sigma_a, Rgb sigma_s, double half, double g = 0, Rgb emission = Rgb(0));
std::string constant_rgb_grid(const std::string& name, Rgb sigma_a, Rgb sigma_s, double half, double g = 0, Rgb emission = Rgb(0));
/// Of media named as in a pbrt file: `"a" "b"`.
inline std::string sum(const std::string& name, const std::string& parts) {
  return "MakeNamedMedium \"" + name + "\" \"string type\" \"sum\" \"string media\" [ " + parts + " ]\n";
}
/// AttributeBegin … AttributeEnd around an index-matched boundary.
std::string boundary(const std::string& inside, const std::string& outside, const std::string& shape);

}  // namespace woodcock::testing
