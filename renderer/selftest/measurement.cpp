#include "renderer/selftest/measurement.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "renderer/accuracy/student.h"
#include "renderer/frame/estimator_settings.h"
#include "renderer/scene/read_scene.h"
#include "renderer/transport/render_plan.h"
#include "renderer/world/world.h"

namespace woodcock::selftest {
namespace {

/// Two-sided level of |x| > z of a normal distribution, solved for z.
double normal_deviate(double p) {
  if (p >= 1) return 0;
  double low = 0, high = 40;
  for (int i = 0; i < 80; ++i) {
    const double middle = 0.5 * (low + high);
    (std::erfc(middle / std::sqrt(2.0)) > p ? low : high) = middle;
  }
  return low;
}

Comparison compare(const std::vector<double>& pixels, double passes, double tolerance, double rare) {
  Comparison c;
  const double n = static_cast<double>(pixels.size());
  for (const double v : pixels) c.mean += v / n;
  double m2 = 0;
  for (const double v : pixels) m2 += (v - c.mean) * (v - c.mean);
  c.degrees = static_cast<int>(pixels.size()) - 1;
  c.error = std::sqrt(m2 / (n - 1) / n);
  const double beyond = std::abs(c.mean) - tolerance;
  if (!std::isfinite(c.mean)) {
    c.p = 0;
  } else if (beyond > 0) {
    c.p = c.error > 0 ? 2 * student_cdf(-beyond / c.error, c.degrees) : 0;
    if (rare > 0) c.p = std::max(c.p, std::exp(-n * passes * beyond / rare));
  }
  c.z = std::copysign(normal_deviate(c.p), c.mean);
  return c;
}

}  // namespace

std::string Rendering::options() const {
  std::string text;
  if (estimator != "auto") text += " --estimator " + estimator;
  if (!without.empty()) text += " --without " + without;
  if (!plan) text += " --plan off";
  if (full_kernel) text += " --kernel full";
  return text;
}

Samples render_samples(const std::string& text, const Rendering& rendering, uint64_t seed, int passes, double budget) {
  Samples samples;
  ReadOptions options;
  options.warn = [&](const std::string& warning) { samples.warnings.push_back(warning); };
  const SceneDescription description = read_scene_text(text, "selftest.pbrt", ".", options);
  FrameSettings settings;
  settings.estimator = rendering.estimator;
  settings.without = rendering.without;
  settings.plan = rendering.plan;
  settings.full_kernel = rendering.full_kernel;
  const EstimatorSettings estimator = resolve_estimator(settings);
  refuse_lights(*estimator.estimator, estimator.features, description);
  const auto world = build_world(description);
  refuse_media(*estimator.estimator, description, *world);
  for (const std::string& note : world->notes) samples.warnings.push_back(note);

  PathSettings path;
  path.frame_seed = frame_seed(seed, 0);
  path.max_depth = description.settings.max_depth;
  path.features = estimator.features;
  path.full_kernel = rendering.full_kernel;
  path.plan = rendering.plan;
  // As many directions as a pilot might find: any number must come out right.
  path.splits = 1u << seed % 4;
  const RenderPlan plan(*world, path);
  const bool low_discrepancy = estimator.estimator->tunable && estimator.features.has(Feature::kSobol);
  PathCounters& count = samples.counters;
  for (int pass = 0; pass < passes; ++pass) {
    if (pass >= 8 && static_cast<double>(count.rays + count.shadow_rays + count.vertices + count.medium_lookups) > budget) break;
    for (int y = 0; y < kEdge; ++y) {
      for (int x = 0; x < kEdge; ++x) {
        const PathKey key =
            path_key(path.frame_seed, static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint64_t>(pass), 0, low_discrepancy);
        const CameraSample camera = camera_sample(*world, key, x, y);
        const Rgb value = camera.weight * estimator.estimator->radiance(*world, plan, camera.ray, key, count).radiance;
        if (!is_finite(value)) ++count.nonfinite;
        samples.values.push_back(is_finite(value) ? value : Rgb(0));
      }
    }
  }
  return samples;
}

double rare_size(const std::vector<DVec3>& differences) {
  // Weights of up to three come from mixtures of the channels.
  double largest = 4;
  for (const DVec3 d : differences) largest = std::max({largest, std::abs(d.x), std::abs(d.y), std::abs(d.z)});
  return largest;
}

std::vector<Comparison> compare_with_zero(const std::vector<DVec3>& differences, double tolerance, double rare) {
  constexpr size_t kPixels = kEdge * kEdge;
  std::vector<DVec3> pixels(kPixels, DVec3(0));
  const double passes = static_cast<double>(differences.size() / kPixels);
  for (size_t i = 0; i < differences.size(); ++i) pixels[i % kPixels] += differences[i] / passes;
  std::vector<Comparison> comparisons;
  for (int region = 0; region < 5; ++region) {
    for (int channel = 0; channel < 3; ++channel) {
      std::vector<double> values;
      for (size_t i = 0; i < kPixels; ++i) {
        const int quarter = static_cast<int>(i % kEdge) / (kEdge / 2) + 2 * (static_cast<int>(i) / kEdge / (kEdge / 2));
        if (region == 4 || region == quarter) values.push_back(pixels[i][channel]);
      }
      Comparison c = compare(values, passes, tolerance, rare);
      c.what = fmt::format("{}, channel {}", region == 4 ? "whole picture" : fmt::format("quarter {}", region), channel);
      comparisons.push_back(c);
    }
  }
  return comparisons;
}

const Comparison& worst(const std::vector<Comparison>& comparisons) {
  return *std::min_element(comparisons.begin(), comparisons.end(), [](const Comparison& a, const Comparison& b) {
    return a.p < b.p || (a.p == b.p && std::abs(a.z) > std::abs(b.z));
  });
}

}  // namespace woodcock::selftest
