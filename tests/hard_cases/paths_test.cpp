// Paths through surfaces and media: boundaries, glass, lights of no size, tracking at the limits of its numbers.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "renderer/scene/read_scene.h"
#include "tests/hard_cases/scene_pieces.h"

namespace woodcock::testing {
namespace {

// The extent of an absorbing ball along each axis, in an instance that scales the axes differently and in a medium whose own
// transform does: what is measured along a ray is a length of the world.
TEST(HardCases, N06_lengths_in_scaled_instances_are_lengths_of_the_world) {
  const DVec3 scale(-0.5, 2, 0.7);
  for (const bool grid : {false, true}) {
    const std::string medium = grid ? constant_grid("m", Rgb(1.25f), Rgb(0), 2.5) : homogeneous("m", Rgb(1.25f), Rgb(0));
    const CompiledScene scene = compile(perspective({0, 0, 9}, {0, 0, 0}, 10, 5) + "WorldBegin\n" + environment(1) + medium +
                                        "ObjectBegin \"o\"\nMaterial \"interface\"\nMediumInterface \"m\" \"\"\n" + sphere(1) +
                                        fmt::format("ObjectEnd\nScale {} {} {}\nObjectInstance \"o\"\n", scale.x, scale.y, scale.z));
    PathCounters counters;
    for (const DVec3 d : {DVec3(1, 0, 0), DVec3(0, 1, 0), DVec3(0, 0, -1), DVec3(1, 1, 1), DVec3(-2, 1, 0.3)}) {
      // Through the centre: |t d / scale| = 1 at both ends.
      const DVec3 unit = glm::normalize(d);
      const double chord = 2 / glm::length(unit / scale), expected = std::exp(-1.25 * chord);
      double sum = 0;
      constexpr int kSamples = 4000;
      for (int i = 0; i < kSamples; ++i)
        sum += static_cast<double>(radiance_along(scene, -5.0 * unit, unit, counters, static_cast<uint64_t>(i)).g);
      // A ratio-tracking estimate lies in [0, 1]: five standard errors at the most.
      EXPECT_NEAR(sum / kSamples, expected, grid ? 2.5 / std::sqrt(kSamples) : 1e-5) << d.x << ' ' << d.y << ' ' << d.z;
    }
  }
}

// The grid's bound is its density but for an allowance of 2⁻²⁰, so that of ten million collisions some ten are fictitious,
// chosen with a probability that has few digits. Nothing absorbs and the glass hides the lights, so every sample is 1.
TEST(HardCases, N07_null_collision_probability_never_divides_by_zero) {
  const CompiledScene furnace = compile(perspective({0, 0, 4}, {0, 0, 0}, 25, 1000000) + "WorldBegin\n" + environment(1) +
                                        constant_grid("m", Rgb(0), Rgb(1000), 1.5) +
                                        "Material \"dielectric\" \"float eta\" 1\nMediumInterface \"m\" \"\"\n" + sphere(1));
  PathCounters counters;
  for (uint64_t i = 0; i < 6000; ++i) {
    const Rgb sample = radiance_along(furnace, {0.3, 0.2, 4}, {0, 0, -1}, counters, i);
    // A fictitious collision is weighted by σn/(σ̄ (1 − q)), 1 but for the rounding of 1 − q to multiples of 2⁻²⁴.
    ASSERT_NEAR(sample.g, 1, 0.1) << i;
  }
  EXPECT_GT(counters.medium_lookups, 5000000u);
}

// A spike of one voxel, seen along rays through it and beside it: its tent reaches into the neighbouring bricks.
TEST(HardCases, N08_a_spike_of_one_voxel_attenuates_as_its_interpolant) {
  for (const int spike : {3, 4, 7}) {
    std::string density;
    for (int z = 0; z < 12; ++z)
      for (int y = 0; y < 12; ++y)
        for (int x = 0; x < 12; ++x) density += x == spike && y == spike && z == spike ? " 40" : " 0";
    const CompiledScene scene = compile(
        perspective({0, 0, 40}, {0, 0, 0}, 10, 5) + "WorldBegin\n" + environment(1) +
        "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 12 \"integer ny\" 12 \"integer nz\" 12 \"point3 p0\" [ 0 0 0 "
        "] \"point3 p1\" [ 12 12 12 ] \"rgb sigma_a\" [ .05 .05 .05 ] \"rgb sigma_s\" [ 0 0 0 ] \"float density\" [" +
        density + " ]\n" + boundary("m", "", sphere(30)));
    PathCounters counters;
    // Along z at the offset (a, b) from the sample the depth is 2 (1 − |a|) (1 − |b|), the integral of the tent being 1.
    for (const DVec2 offset : {DVec2(0), DVec2(0.45, 0), DVec2(-0.45, 0.3), DVec2(0.9, -0.8), DVec2(-0.95, -0.95)}) {
      const double depth = 2 * (1 - std::abs(offset.x)) * (1 - std::abs(offset.y));
      Estimate e;
      double m2 = 0;
      for (; e.count < 20000;) {
        const auto value = static_cast<double>(radiance_along(scene, {spike + 0.5 + offset.x, spike + 0.5 + offset.y, 40}, {0, 0, -1},
                                                              counters, static_cast<uint64_t>(e.count))
                                                   .g);
        e.count += 1;
        const double delta = value - e.mean[0];
        e.mean[0] += delta / e.count;
        m2 += delta * (value - e.mean[0]);
      }
      EXPECT_NEAR(e.mean[0], std::exp(-depth), kStandardErrors * std::sqrt(m2) / e.count + 1e-5)
          << spike << ": " << offset.x << ' ' << offset.y;
    }
    EXPECT_EQ(counters.majorant_violations, 0u);
  }
}

// An enclosing sphere that glows and an environment are one and the same.
TEST(HardCases, N22_an_enclosing_lamp_equals_an_environment) {
  const std::string medium = homogeneous("m", Rgb(0.3f), Rgb(1), 0.3);
  const std::string bodies = perspective({0, 0, 4}, {0, 0, 0}, 50, 6) + "WorldBegin\n" + medium +
                             boundary("m", "", sphere(1, {-1.1, 0, 0})) +
                             "AttributeBegin\nMaterial \"dielectric\"\nMediumInterface \"m\" \"\"\n" + sphere(0.9, {1.1, 0, 0}) +
                             "AttributeEnd\nMaterial \"diffuse\"\n" + sphere(0.5, {0, 1.2, 0}) +
                             "Material \"dielectric\" \"float roughness\" 0.3\n" + sphere(0.5, {0, -1.2, 0});
  expect_equal(
      estimate(bodies + "ReverseOrientation\n" + lamp(sphere(50), "Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\n"), 60000, 1),
      estimate(bodies + environment(3), 60000, 2), 0.01, "six bounces");
}

/// The mean transmittance along z of a column of absorbing voxels, twelve units in all, with its standard error and its exact value.
struct ColumnEstimate {
  double mean, error, exact;
};
ColumnEstimate through_column(const std::vector<float>& voxels, int samples) {
  std::string density;
  double depth = 0;
  const size_t last = voxels.size() - 1;
  for (size_t k = 0; k <= last; ++k) {
    density += fmt::format(" {:.9g}", voxels[k]);
    // The outer half voxels fade: see reference_depth in tests/media/grids.h.
    depth += static_cast<double>(voxels[k]) * 12 / static_cast<double>(voxels.size()) * (k == 0 || k == last ? 0.5 + 0.375 : 1);
  }
  const CompiledScene scene = compile(
      perspective({0, 0, 20}, {0, 0, 0}, 10, 5) + "WorldBegin\n" + environment(1) +
      fmt::format(
          "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 1 \"integer ny\" 1 \"integer nz\" {} \"point3 p0\" [ "
          "-9 -9 -6 ] \"point3 p1\" [ 9 9 6 ] \"rgb sigma_a\" [ 1 1 1 ] \"rgb sigma_s\" [ 0 0 0 ] \"float density\" [",
          voxels.size()) +
      density + " ]\n" + boundary("m", "", sphere(8)));
  PathCounters counters;
  double sum = 0, squares = 0;
  for (int i = 0; i < samples; ++i) {
    const auto t = static_cast<double>(radiance_along(scene, {0, 0, 9}, {0, 0, -1}, counters, static_cast<uint64_t>(i)).g);
    sum += t;
    squares += t * t;
  }
  const double mean = sum / samples;
  return {mean, std::sqrt((squares / samples - mean * mean) / samples), std::exp(-depth)};
}

// Marching, even where its points are jittered, overestimates: E[exp(−τ̂)] ≥ exp(−τ). Here a profile that falls by e⁵ over the segment,
// along which one look-up would be off by a factor of two, and one with gaps between its voxels.
TEST(HardCases, N23_the_mean_transmittance_of_an_uneven_medium_is_exact) {
  constexpr int kVoxels = 64;
  std::vector<float> smooth, rough;
  for (int k = 0; k < kVoxels; ++k) {
    smooth.push_back(std::exp(-5 * (static_cast<float>(k) + 0.5f) / kVoxels));
    rough.push_back(k % 7 == 3 ? 1.5f : 0);
  }
  for (const auto& voxels : {smooth, rough}) {
    const ColumnEstimate t = through_column(voxels, 200000);
    EXPECT_LT(t.exact, 0.13);
    EXPECT_LT(t.error, 0.01 * t.exact);
    EXPECT_NEAR(t.mean, t.exact, kStandardErrors * t.error + kRounding * t.exact);
  }
}

// Cut into one, ten or a hundred slices by boundaries that change nothing, a medium is what it was, but for the rounding of a
// ray's origin at each (an ulp of the coordinates, 1e-6 here).
TEST(HardCases, N24_opacity_does_not_depend_on_how_a_medium_is_cut) {
  for (const bool grid : {false, true})
    for (const int slices : {1, 10, 100}) {
      std::string cuts = grid ? constant_grid("m", Rgb(0.6f), Rgb(0), 3) : homogeneous("m", Rgb(0.6f), Rgb(0));
      for (int i = 1; i < slices; ++i)
        cuts += boundary("m", "m", fmt::format("Translate 0 0 {}\nShape \"disk\" \"float radius\" 3\n", 4.0 * i / slices - 2));
      const Estimate e = estimate(
          perspective({0, 0, 9}, {0, 0, 0}, 0.01, 5) + "WorldBegin\n" + environment(1) + cuts + boundary("m", "", sphere(2)), 20000, 1);
      const double expected = std::exp(-0.6 * 4);
      EXPECT_NEAR(e.mean[0], expected, kStandardErrors * e.error[0] + 1e-4 * expected) << slices << " slices" << (grid ? " of a grid" : "");
      EXPECT_LE(e.error[0], 0.03 * expected);
    }
}

// σt t reaches 10⁶ in one channel and 10³ in another, or is 0·∞: each transmittance is 0 in float32 or no number, their quotients
// are not.
TEST(HardCases, N25_quotients_of_transmittances_that_underflow_are_finite) {
  const std::string ball = perspective({0, 0, 4}, {0, 0, 0}, 20, 1000) + "WorldBegin\n" + environment(1) +
                           homogeneous("m", {10, 1000, 1e6f}, {500, 500, 500}, 0.2) + boundary("m", "", sphere(1));
  const Estimate e = estimate(ball, 20000, 1);
  EXPECT_EQ(e.counters.nonfinite, 0u);
  for (size_t c = 0; c < 3; ++c) EXPECT_TRUE(std::isfinite(e.mean[c]) && e.mean[c] > 0 && e.mean[c] < 1) << c << ": " << e.mean[c];
  // Without an end: red passes through for certain, the others never; what they scatter reaches no light.
  const Estimate unbounded = estimate(homogeneous("m", {0, 0.2f, 1}, {0, 0.3f, 1}) + "MediumInterface \"\" \"m\"\n" +
                                          perspective({0, 0, 0}, {0, 0, 1}, 60, 5) + "WorldBegin\n" + environment(1),
                                      20000, 1);
  EXPECT_EQ(unbounded.counters.nonfinite, 0u);
  EXPECT_NEAR(unbounded.mean[0], 1, kStandardErrors * unbounded.error[0]);
  EXPECT_LT(unbounded.error[0], 0.02);
  EXPECT_EQ(unbounded.mean[1], 0);
  EXPECT_EQ(unbounded.mean[2], 0);
  // A sheet that only absorbs: each channel alone.
  const Estimate sheet = estimate(perspective({0, 0, 4}, {0, 0, 0}, 0.01, 1000) + "WorldBegin\n" + environment(1) +
                                      homogeneous("m", {1e-3f, 100, 1e5f}, Rgb(0)) + boundary("m", "", sphere(1)),
                                  100, 1);
  EXPECT_NEAR(sheet.mean[0], std::exp(-2e-3), 1e-5);
  EXPECT_EQ(sheet.mean[1], 0);
  EXPECT_EQ(sheet.mean[2], 0);
}

// A point light of intensity I and a small sphere of the same: I = L π r².
TEST(HardCases, N33_a_point_light_equals_a_tiny_sphere) {
  const std::string medium = homogeneous("m", Rgb(0.2f), Rgb(0.5f), 0.5);
  for (const std::string& fog : {std::string(), boundary("m", "", sphere(3))}) {
    const std::string scene = floor_below(0.8, 3) + medium + fog;
    const double r = 1e-3, intensity = 2;
    const std::string point = fmt::format("LightSource \"point\" \"point3 from\" [ 0.3 1 0.2 ] \"rgb I\" [ {0} {0} {0} ]\n", intensity);
    const std::string ball = fmt::format("AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [ {0} {0} {0} ]\n{1}AttributeEnd\n",
                                         intensity / (kPiD * r * r), sphere(r, {0.3, 1, 0.2}));
    expect_equal(estimate(scene + ball, 60000, 1), estimate(scene + point, 60000, 2), 0.03, fog.empty() ? "in vacuum" : "in fog");
  }
}

TEST(HardCases, N33_what_only_one_way_finds_has_weight_one) {
  // A lamp behind a pane without reflection is met by chance alone, behind a specular pass.
  const CompiledScene pane =
      compile(perspective({0, 0, 4}, {0, 0, 0}, 5, 10) + "WorldBegin\n" + lamp("Shape \"disk\" \"float radius\" 5\n") +
              "Material \"dielectric\" \"float eta\" 1\nTranslate 0 0 1\nShape \"disk\" \"float radius\" 5\n");
  for (const Rgb r : radiances(pane, 500, 1)) ASSERT_EQ(r, Rgb(3));
  // Lights of no size share the choice: n of them with 1/n of the intensity each are one, and none is counted twice.
  for (const int n : {1, 2, 7}) {
    std::string lights;
    for (int i = 0; i < n; ++i)
      lights += fmt::format("LightSource \"point\" \"point3 from\" [ 0 2 0 ] \"rgb I\" [ {0:.9g} {0:.9g} {0:.9g} ]\n", 4.0 / n);
    expect_value(estimate(floor_below(0.8, 1) + lights, 200, 1), 0.8 / kPiD * 4 / 4, 1e-3, fmt::format("{} lights", n));
  }
}

// Triangles without area, and those that lose it by the rounding to render space, are left out with a warning and change
// nothing: neither the light of a lamp nor what shades it.
TEST(HardCases, N29_triangles_without_area_change_nothing) {
  const auto room = [](const char* slivers) {
    return perspective({0, 0.3, 3}, {0, 0, 0}, 50, 6) + "WorldBegin\nAttributeBegin\nAreaLightSource \"diffuse\" \"float power\" 8\n" +
           "Shape \"trianglemesh\" \"point3 P\" [ -1 2 -1  1 2 -1  1 2 1  -1 2 1  .5 2 .5  .5 2 .500000000001 .500000000001 2 .5 ] "
           "\"integer "
           "indices\" [ 0 1 2  0 2 3 " +
           slivers + " ]\nAttributeEnd\n" + sphere(1) + sphere(10, {0, -11, 0});
  };
  const std::vector<Rgb> whole = radiances(compile(room("")), 3000, 1);
  EXPECT_EQ(radiances(compile(room("0 0 0  1 1 2  0 2 2")), 3000, 1), whole);
  const CompiledScene rounded = compile(room("4 5 6  0 0 0"));
  EXPECT_EQ(radiances(rounded, 3000, 1), whole);
  ASSERT_EQ(rounded.world->notes.size(), 1u);
  EXPECT_EQ(rounded.world->notes[0], "1 triangles or patches without area were left out");
  std::vector<std::string> warnings;
  ReadOptions options;
  options.warn = [&](const std::string& warning) { warnings.push_back(warning); };
  read_scene_text(room("0 0 0  1 1 2  0 2 2"), "room.pbrt", ".", options);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("room.pbrt:10:1"), std::string::npos) << warnings[0];
  EXPECT_NE(warnings[0].find("3 triangles without area"), std::string::npos) << warnings[0];
}

// In glass that absorbs nothing no path is dimmed but by n², which roulette must not take for a loss: every sample is the
// radiance itself, however often it is refracted.
TEST(HardCases, N44_roulette_does_not_take_refraction_for_a_loss) {
  std::string shells;
  for (int i = 0; i < 12; ++i)
    shells += fmt::format("Material \"dielectric\" \"float eta\" {}\n", i % 2 ? 1 / 2.5 : 2.5) + sphere(2 - 0.15 * i);
  const CompiledScene scene = compile(perspective({0, 0, 6}, {0, 0, 0}, 40, 1000000) + "WorldBegin\n" + environment(1) + shells);
  for (const Rgb r : radiances(scene, 3000, 1)) ASSERT_NEAR(r.g, 1, 1e-3);
}

// Albedo 0.9999, so that a path scatters ten thousand times: emission in equilibrium with absorption shows Le, whatever the
// number of scatterings it is divided over.
TEST(HardCases, N44_ten_thousand_scatterings_lose_nothing_and_stay_finite) {
  const std::string medium = homogeneous("m", {1e-4f, 2e-4f, 1e-4f}, {0.9999f, 0.9998f, 0.9999f}, 0.3, Rgb(2));
  const Estimate e =
      estimate(medium + "MediumInterface \"\" \"m\"\n" + perspective({0, 0, 0}, {0, 0, 1}, 60, 1000000) + "WorldBegin\n", 300, 1);
  expect_value(e, 2, 0.1, "unbounded medium");
  EXPECT_EQ(e.counters.nonfinite, 0u);
  EXPECT_GT(e.counters.vertices, 300u * 2000);
}

/// Statistics of the pixels of a picture in which all of them see the same: a parallel camera in an unbounded glowing medium.
struct Pixels {
  static constexpr int kSize = 32, kSamples = 64;
  std::vector<double> mean, variance;  ///< of the pixels; the variance is that of one sample
  double total_mean = 0, total_variance = 0;
};
const Pixels& pixels() {
  static const Pixels result = [] {
    std::string text =
        homogeneous("m", Rgb(1.5f), Rgb(0.5f), 0.5, Rgb(1)) + "MediumInterface \"\" \"m\"\n" + perspective({0, 0, 4}, {0, 0, 0}, 10, 3);
    const std::string perspective_camera = "Camera \"perspective\" \"float fov\" 10";
    text.replace(text.find(perspective_camera), perspective_camera.size(), "Camera \"orthographic\"");
    const CompiledScene scene = compile(text + "WorldBegin\n");
    Pixels p;
    PathCounters counters;
    double n = 0, m2 = 0;
    for (int pixel = 0; pixel < Pixels::kSize * Pixels::kSize; ++pixel) {
      const int x = pixel % Pixels::kSize, y = pixel / Pixels::kSize;
      double sum = 0, squares = 0;
      for (int i = 0; i < Pixels::kSamples; ++i) {
        const PathKey key = path_key(frame_seed(9, 0), static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint64_t>(i));
        const CameraSample camera = camera_sample(*scene.world, key, x % scene.width, y % scene.height);
        const double value =
            static_cast<double>(trace_path(*scene.world, {*scene.world, scene.settings}, camera.ray, key, counters).radiance.g);
        sum += value;
        squares += value * value;
        n += 1;
        const double delta = value - p.total_mean;
        p.total_mean += delta / n;
        m2 += delta * (value - p.total_mean);
      }
      p.mean.push_back(sum / Pixels::kSamples);
      p.variance.push_back((squares - sum * sum / Pixels::kSamples) / (Pixels::kSamples - 1));
    }
    p.total_variance = m2 / (n - 1);
    return p;
  }();
  return result;
}

/// z of a χ² of k degrees of freedom (Wilson & Hilferty 1931): beyond 4.9 once in a million seeds.
double z_of_chi_square(double chi2, double k) { return (std::cbrt(chi2 / k) - (1 - 2 / (9 * k))) / std::sqrt(2 / (9 * k)); }

// Seeds that pixels, rows or tiles share make blocks of pixels scatter more than independent samples do.
TEST(HardCases, N45_means_of_blocks_of_pixels_scatter_as_independent_samples) {
  const Pixels& p = pixels();
  for (const int block : {1, 2, 4, 8, 16}) {
    double chi2 = 0, blocks = 0;
    for (int by = 0; by < Pixels::kSize; by += block)
      for (int bx = 0; bx < Pixels::kSize; bx += block) {
        double sum = 0;
        for (int y = by; y < by + block; ++y)
          for (int x = bx; x < bx + block; ++x) sum += p.mean[static_cast<size_t>(y * Pixels::kSize + x)];
        const double area = block * block, d = sum / area - p.total_mean;
        chi2 += d * d * area * Pixels::kSamples / p.total_variance;
        blocks += 1;
      }
    EXPECT_LT(std::abs(z_of_chi_square(chi2, blocks - 1)), kStandardErrors)
        << "blocks of " << block << ": chi2 " << chi2 << " for " << blocks - 1;
  }
  // Rows and columns.
  for (const bool rows : {true, false}) {
    double chi2 = 0;
    for (int a = 0; a < Pixels::kSize; ++a) {
      double sum = 0;
      for (int b = 0; b < Pixels::kSize; ++b) sum += p.mean[static_cast<size_t>(rows ? a * Pixels::kSize + b : b * Pixels::kSize + a)];
      const double d = sum / Pixels::kSize - p.total_mean;
      chi2 += d * d * Pixels::kSize * Pixels::kSamples / p.total_variance;
    }
    EXPECT_LT(std::abs(z_of_chi_square(chi2, Pixels::kSize - 1)), kStandardErrors) << (rows ? "rows: " : "columns: ") << chi2;
  }
}

// A parallel camera gives all pixels of a row the same direction and all of a flat medium the same distances: numbers made of
// the ray would show as a pattern. What is left beside the mean has none: neighbours do not correlate, and a pixel's own
// variance is that of the others.
TEST(HardCases, N58_nothing_is_left_in_the_residual_of_a_parallel_view) {
  const Pixels& p = pixels();
  const double variance_of_mean = p.total_variance / Pixels::kSamples;
  constexpr int kSize = Pixels::kSize;
  for (const IVec2 step : {IVec2(1, 0), IVec2(0, 1), IVec2(1, 1), IVec2(8, 0), IVec2(0, 8), IVec2(16, 16)}) {
    double sum = 0;
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x)
        sum += (p.mean[static_cast<size_t>(y * kSize + x)] - p.total_mean) *
               (p.mean[static_cast<size_t>((y + step.y) % kSize * kSize + (x + step.x) % kSize)] - p.total_mean);
    // The sum of n products of independent residuals has the variance n σ⁴.
    EXPECT_LT(std::abs(sum) / (variance_of_mean * kSize), kStandardErrors) << step.x << ' ' << step.y;
  }
  // The mean of the pixels' own variances is the variance of all samples: what one pixel repeats another would show as less.
  double mean_variance = 0;
  for (const double v : p.variance) mean_variance += v / (kSize * kSize);
  EXPECT_NEAR(mean_variance / p.total_variance, 1, 0.02);
}

// A boundary close before a lamp, behind it or on it neither hides nor leaks its light, be the gap one that survives the rounding
// to render space or not; the floor shows a L sin²θ.
TEST(HardCases, N61_a_boundary_next_to_a_lamp_changes_nothing_at_any_gap) {
  const double expected = 0.8 * 3 / 2;
  const std::string disk = lamp("Translate 0 1 0\nRotate 90 1 0 0\nShape \"disk\" \"float radius\" 1\n");
  for (const double gap : {0.0, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 0.1, -1e-9, -1e-6, -1e-3})
    for (const bool lamp_first : {true, false}) {
      const std::string plane = fmt::format(
          "AttributeBegin\nMaterial \"interface\"\nMediumInterface \"\" \"\"\nShape \"trianglemesh\" \"point3 P\" [ -30 {0:.12g} -30  30 "
          "{0:.12g} "
          "-30  30 {0:.12g} 30  -30 {0:.12g} 30 ] \"integer indices\" [ 0 1 2  0 2 3 ]\nAttributeEnd\n",
          1 - gap);
      expect_value(estimate(floor_below(0.8, 1) + (lamp_first ? disk + plane : plane + disk), 20000, 1), expected, 0.01,
                   fmt::format("gap {}", gap));
    }
}

// A floor of 10⁴ mean free paths with a layer of fog 0.01 above it, cut into two triangles or into many: the same picture.
TEST(HardCases, N63_the_picture_does_not_depend_on_how_a_large_plane_is_cut) {
  const auto scene = [](int cells) {
    std::string points, indices;
    for (int j = 0; j <= cells; ++j)
      for (int i = 0; i <= cells; ++i) points += fmt::format(" {:.17g} 0 {:.17g}", 2e4 * i / cells - 1e4, 2e4 * j / cells - 1e4);
    for (int j = 0; j < cells; ++j)
      for (int i = 0; i < cells; ++i) {
        const int a = j * (cells + 1) + i, b = a + 1, c = a + cells + 1, d = c + 1;
        indices += fmt::format(" {} {} {} {} {} {}", a, c, d, a, d, b);
      }
    const std::string plane = "Shape \"trianglemesh\" \"point3 P\" [" + points + " ] \"integer indices\" [" + indices + " ]\n";
    // The normal points up: below the sheet is the fog, above it nothing.
    return perspective({0, 1, 0}, {3, 0, 4}, 20, 20) + "WorldBegin\n" + environment(1) + homogeneous("m", Rgb(0.2f), Rgb(0.8f)) +
           "Material \"diffuse\" \"rgb reflectance\" [ .7 .7 .7 ]\n" + plane + boundary("m", "", "Translate 0 .01 0\n" + plane);
  };
  const Estimate two = estimate(scene(1), 60000, 1);
  for (const int cells : {3, 40}) expect_equal(estimate(scene(cells), 60000, 2), two, 0.01, fmt::format("{} cells", cells));
}

// A path that crosses ten thousand boundaries without a scattering is cut, and said to be.
TEST(HardCases, N68_a_path_that_is_cut_is_counted) {
  std::string panes;
  for (int i = 0; i < 200; ++i) panes += boundary("", "", fmt::format("Translate 0 0 {}\nShape \"disk\" \"float radius\" 5\n", -0.01 * i));
  const Estimate few = estimate(perspective({0, 0, 4}, {0, 0, 0}, 5, 10) + "WorldBegin\n" + environment(1) + panes, 100, 1);
  EXPECT_EQ(few.counters.truncated, 0u);
  EXPECT_EQ(few.mean[0], 1);
  std::string many = perspective({0, 0, 4}, {0, 0, 0}, 1, 10) + "WorldBegin\n" + environment(1) + "ObjectBegin \"panes\"\n";
  for (int i = 0; i < 200; ++i) many += boundary("", "", fmt::format("Translate 0 0 {}\nShape \"disk\" \"float radius\" 5\n", -0.01 * i));
  many += "ObjectEnd\n";
  for (int i = 0; i < 51; ++i) many += fmt::format("AttributeBegin\nTranslate 0 0 {}\nObjectInstance \"panes\"\nAttributeEnd\n", -2.5 * i);
  EXPECT_EQ(estimate(many, 100, 1).counters.truncated, 100u);
}

}  // namespace
}  // namespace woodcock::testing
