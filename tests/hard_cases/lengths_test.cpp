// Lengths are those between true hits, however dense a medium is and however far away (N70).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/hard_cases/scene_pieces.h"

namespace woodcock::testing {
namespace {

std::string orthographic(double distance, double half_window, int depth) {
  return fmt::format(
      "LookAt 0 0 {0:.17g}  0 0 0  0 1 0\nCamera \"orthographic\" \"float screenwindow\" [ -{1:.17g} {1:.17g} -{1:.17g} {1:.17g} ]\nFilm "
      "\"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8\nPixelFilter \"box\"\nIntegrator \"volpath\" \"integer maxdepth\" "
      "{2}\nWorldBegin\n",
      -distance, half_window, depth);
}

/// A box from z = 0 to z = thickness, as wide as it is far away or more.
std::string slab(double thickness, double width) {
  return fmt::format(
      "Shape \"trianglemesh\" \"point3 P\" [ -{0:.17g} -{0:.17g} 0 {0:.17g} -{0:.17g} 0 {0:.17g} {0:.17g} 0 -{0:.17g} {0:.17g} 0 -{0:.17g} "
      "-{0:.17g} {1:.17g} {0:.17g} -{0:.17g} {1:.17g} {0:.17g} {0:.17g} {1:.17g} -{0:.17g} {0:.17g} {1:.17g} ] \"integer indices\" [ 0 2 "
      "1 0 3 2 4 5 6 4 6 7 0 1 5 0 5 4 3 7 6 3 6 2 0 4 7 0 7 3 1 2 6 1 6 5 ]\n",
      width, thickness);
}

/// Mean free paths between camera and medium.
constexpr double kAway[] = {1, 1e3, 1e6};
constexpr double kDensities[] = {1e-2, 1, 1e4, 1e8};

// The digits of σ and of the file's numbers, and float radiances.
constexpr double kExact = 2e-6;

TEST(HardCases, N70_a_slab_of_one_mean_free_path_lets_1_over_e_through_at_any_distance_and_density) {
  for (const double sigma : kDensities)
    for (const double away : kAway) {
      const double thickness = 1 / sigma, distance = away * thickness, width = std::max(distance, thickness);
      const std::string head = orthographic(distance, 0.3 * thickness, 5) + environment(1);
      const auto expect_exact = [&](const std::string& medium, const std::string& shape, double expected, const char* what) {
        const CompiledScene scene = compile(head + medium + boundary("m", "", shape));
        EXPECT_TRUE(scene.world->notes.empty()) << what << ": " << scene.world->notes.front();
        for (const Rgb& r : radiances(scene, 64, 1))
          ASSERT_NEAR(static_cast<double>(r.g), expected, kExact) << what << ", sigma " << sigma << ", " << away << " mean free paths away";
      };
      const auto s = static_cast<float>(sigma);
      expect_exact(homogeneous("m", Rgb(s), Rgb(0)), slab(thickness, width), std::exp(-1), "mesh");
      // A cylinder along the view: its caps are open, so the way through is between two disks.
      const std::string disks = fmt::format(
          "Shape \"disk\" \"float radius\" {0:.17g} \"float height\" {1:.17g}\nReverseOrientation\nShape \"disk\" \"float radius\" "
          "{0:.17g}\n",
          width, thickness);
      expect_exact(homogeneous("m", Rgb(s), Rgb(0)), disks, std::exp(-1), "disks");
      const auto patch = [&](double z) {
        return fmt::format(
            "Shape \"bilinearmesh\" \"point3 P\" [ -{0:.17g} -{0:.17g} {1:.17g} {0:.17g} -{0:.17g} {1:.17g} -{0:.17g} {0:.17g} {1:.17g} "
            "{0:.17g} {2:.17g} {1:.17g} ]\n",
            width, z, 1.1 * width);
      };
      expect_exact(homogeneous("m", Rgb(s), Rgb(0)), patch(thickness) + "ReverseOrientation\n" + patch(0), std::exp(-1), "patches");
    }
}

TEST(HardCases, N70_estimates_through_grids_are_those_of_the_length_between_hits) {
  // A grid tracks; its mean is exact, whatever the distance.
  std::string ones;
  for (int i = 0; i < 64; ++i) ones += "1 ";
  for (const double sigma : {1.0, 1e8})
    for (const double away : kAway) {
      const double thickness = 1 / sigma, distance = away * thickness, width = std::max(distance, thickness);
      const std::string grid = fmt::format(
          "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 4 \"integer ny\" 4 \"integer nz\" 4 \"point3 p0\" [ "
          "-{0:.17g} "
          "-{0:.17g} -{1:.17g} ] \"point3 p1\" [ {0:.17g} {0:.17g} {2:.17g} ] \"rgb sigma_a\" [ {3:.9g} {3:.9g} {3:.9g} ] \"rgb sigma_s\" "
          "[ 0 "
          "0 0 ] \"float density\" [ {4} ]\n",
          2 * width, thickness, 2 * thickness, sigma, ones);
      const Estimate e = estimate(
          orthographic(distance, 0.3 * thickness, 5) + environment(1) + grid + boundary("m", "", slab(thickness, width)), 40000, 3);
      expect_value(e, std::exp(-1), 0.01, fmt::format("sigma {}, {} mean free paths away", sigma, away));
    }
}

/// 1 − H(1) √(1 − ω): what a half space with isotropic scattering of albedo ω shows straight ahead under a uniform sky (Chandrasekhar
/// 1960, Radiative Transfer, chapter V), H by iteration of its integral equation on 64 midpoints of μ = x².
double half_space(double albedo) {
  constexpr int kNodes = 400;
  std::vector<double> mu(kNodes), weight(kNodes), h(kNodes, 1);
  for (int i = 0; i < kNodes; ++i) {
    const double x = (i + 0.5) / kNodes;
    mu[static_cast<size_t>(i)] = x * x;
    weight[static_cast<size_t>(i)] = 2 * x / kNodes;
  }
  const double root = std::sqrt(1 - albedo);
  const auto next = [&](double at) {
    double sum = 0;
    for (size_t j = 0; j < mu.size(); ++j) sum += weight[j] * mu[j] * h[j] / (at + mu[j]);
    return 1 / (root + albedo / 2 * sum);
  };
  for (int turn = 0; turn < 60; ++turn) {
    std::vector<double> better;
    for (const double at : mu) better.push_back(next(at));
    h = better;
  }
  return 1 - next(1) * root;
}

TEST(HardCases, N70_a_half_space_reflects_the_same_at_any_distance_and_density) {
  const double expected = half_space(0.5);
  EXPECT_NEAR(expected, 0.1152, 5e-5);  // tables of H
  for (const double sigma : {1e3, 1e6, 1e8})
    for (const double distance : {1e-3, 1.0, 1e4}) {
      if (sigma * distance > 1e10) continue;  // see below
      const double half = std::max(0.5 * distance, 500 / sigma), across = std::min(half, 0.2 * distance + 1 / sigma);
      const auto s = static_cast<float>(sigma / 2);
      const Estimate e = estimate(orthographic(distance, 0.3 * across, 1000000) + environment(1) + homogeneous("m", Rgb(s), Rgb(s)) +
                                      boundary("m", "", slab(2 * half, half)),
                                  60000, 7);
      expect_value(e, expected, 0.02, fmt::format("sigma {}, {} units away", sigma, distance));
    }
}

TEST(HardCases, N70_light_sampled_through_a_thin_dense_layer_pays_for_all_of_it) {
  // A floor below a layer of one mean free path, lit and seen straight through it.
  for (const double sigma : {1.0, 1e4, 1e7})
    for (const double away : kAway) {
      const double thickness = 1 / sigma, distance = away * thickness, width = std::max(distance, thickness);
      const auto s = static_cast<float>(sigma);
      const std::string layer = slab(thickness, width),
                        floor = fmt::format(
                            "AttributeBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ .8 .8 .8 ]\nTranslate 0 0 {:.17g}\n"
                            "ReverseOrientation\nShape \"disk\" \"float radius\" {:.17g}\nAttributeEnd\n",
                            0.9 * thickness, 0.9 * width);
      const std::string sun = "LightSource \"distant\" \"point3 from\" [ 0 0 -1 ] \"point3 to\" [ 0 0 0 ] \"rgb L\" [ 3 3 3 ]\n";
      const std::string text = orthographic(distance, 0.3 * thickness, 1) + sun + homogeneous("m", Rgb(s), Rgb(0)) +
                               "AttributeBegin\nMediumInterface \"m\" \"\"\nMaterial \"interface\"\n" + layer +
                               "AttributeEnd\nAttributeBegin\nMediumInterface \"m\" \"m\"\n" + floor + "AttributeEnd\n";
      for (const Rgb& r : radiances(compile(text), 64, 1))
        ASSERT_NEAR(static_cast<double>(r.g), 0.8 / kPiD * 3 * std::exp(-1.8), 1e-5) << sigma << ' ' << away;
    }
}

TEST(HardCases, N70_a_medium_in_a_gap_too_thin_to_be_told_is_said) {
  // 1e-8 of the scene's size: one mean free path that no ray can find its way in.
  const auto scene = [](double thickness) {
    return compile(orthographic(1, 0.2, 5) + environment(1) + homogeneous("m", Rgb(static_cast<float>(1 / thickness)), Rgb(0)) +
                   boundary("m", "", slab(thickness, 0.5)));
  };
  const CompiledScene thin = scene(1e-8);
  const auto says = [](const CompiledScene& s) {
    return std::any_of(s.world->notes.begin(), s.world->notes.end(),
                       [](const std::string& note) { return note.find("\"m\" fills a gap") != std::string::npos; });
  };
  EXPECT_TRUE(says(thin));
  EXPECT_FALSE(says(scene(1e-5)));
}

TEST(HardCases, N70_a_medium_too_dense_for_double_is_said) {
  const auto notes = [](double sigma) {
    const auto s = static_cast<float>(sigma / 2);
    return compile(orthographic(1, 0.2, 5) + environment(1) + homogeneous("m", Rgb(s), Rgb(s)) + boundary("m", "", slab(1, 0.5)))
        .world->notes;
  };
  EXPECT_TRUE(notes(1e10).empty());
  ASSERT_EQ(notes(1e12).size(), 1u);
  EXPECT_NE(notes(1e12)[0].find("\"m\" is so dense"), std::string::npos);
}

}  // namespace
}  // namespace woodcock::testing
