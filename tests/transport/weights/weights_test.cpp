// Weights sum to one on every path (N69): every contribution of the path loop is compared with an independent function of the
// complete path, over random scenes with every feature on and off.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

#include "tests/transport/weights/random_scenes.h"
#include "tests/transport/weights/weights_check.h"

namespace woodcock::testing {
namespace {

TEST(Weights, N69_weights_sum_to_one_on_every_path_of_random_scenes) {
  // WOODCOCK_SEED shows one scene alone, with its text.
  CheckReport report;
  if (const char* seed = std::getenv("WOODCOCK_SEED")) {
    std::puts(random_scene(std::strtoull(seed, nullptr, 10)).c_str());
    report = check_random_scene(std::strtoull(seed, nullptr, 10), 1000);
  } else {
    for (uint64_t i = 1; i <= 216; ++i) report.add(check_random_scene(i, 500));
    EXPECT_GT(report.total(), 150000);
    EXPECT_GT(report.light_roulettes, 1000);
    // Few scenes have bodies of smooth glass under area lights.
    for (const int64_t& n : report.contributions) EXPECT_GT(n, &n == &report.contributions.back() ? 100 : 500);
  }
  std::puts(describe(report).c_str());
  EXPECT_EQ(report.failed, 0) << describe(report);
  EXPECT_LT(report.too_near, report.total() / 500 + 10);
}

/// Milk in a ball and in a box of smooth glass under a wide lamp that the camera does not see: it is met by chance behind the glass as
/// often as it is sampled through it.
TEST(Weights, N69_light_met_behind_smooth_glass_is_weighted_against_samples_through_it) {
  const std::string box =
      "Shape \"trianglemesh\" \"integer indices\" [ 0 2 1 1 2 3  4 5 6 5 7 6  0 1 4 1 5 4  2 6 3 3 6 7  0 4 2 2 4 6  1 3 5 3 7 5 ] "
      "\"point3 "
      "P\" [ -1 -1 -1  1 -1 -1  -1 1 -1  1 1 -1  -1 -1 1  1 -1 1  -1 1 1  1 1 1 ]\n";
  for (const std::string& shape : {std::string("Shape \"sphere\" \"float radius\" 1\n"), box}) {
    const std::string text =
        "LookAt 0 0 4  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 30\nFilm \"rgb\" \"integer xresolution\" 8 \"integer "
        "yresolution\" "
        "8\nIntegrator \"volpath\" \"integer maxdepth\" 12\nWorldBegin\n"
        "AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [ 3 2 1 ] \"bool twosided\" true\nMaterial \"diffuse\" \"rgb reflectance\" "
        "[ "
        "0 0 0 "
        "]\nTranslate 0 3 0\nRotate 90 1 0 0\nShape \"disk\" \"float radius\" 4\nAttributeEnd\n"
        "MakeNamedMedium \"milk\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ 1 1 1 ] \"rgb sigma_a\" [ 0.1 0.1 0.1 ] \"float g\" "
        "0.4\n"
        "MediumInterface \"milk\" \"\"\nMaterial \"dielectric\" \"float eta\" 1.4\n" +
        shape;
    PathSettings settings;
    settings.frame_seed = frame_seed(7, 0);
    const CheckReport report = check_scene(text, settings, false, 20000, "milk in glass");
    EXPECT_GT(report.contributions.front(), 1000) << "met by chance";
    EXPECT_GT(report.contributions.back(), 1000) << "sampled through the glass";
    EXPECT_EQ(report.failed, 0) << describe(report);
    EXPECT_LT(report.too_near, report.total() / 100) << describe(report);
  }
}

/// A ball that scatters forwards over a floor, under two suns and a sky: what a branch finds the path finds as well, on the floor and
/// behind the ball's boundary the path alone.
TEST(Weights, N69_what_branches_towards_a_light_find_is_shared_with_the_path) {
  for (const char* sigma_s : {"3 3 3", "3 2 1"}) {
    const std::string text =
        std::string(
            "LookAt 0 0 4  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 40\nFilm \"rgb\" \"integer xresolution\" 8 \"integer "
            "yresolution\" 8\nIntegrator \"volpath\" \"integer maxdepth\" 12\nWorldBegin\nLightSource \"infinite\" \"rgb L\" [ 0.2 0.2 0.2 "
            "]\nLightSource \"distant\" \"rgb L\" [ 3 2 1 ] \"point3 from\" [ 1 3 2 ] \"point3 to\" [ 0 0 0 ]\nLightSource \"distant\" "
            "\"rgb L\" [ 0.5 1 1 ] \"point3 from\" [ -1 2 -2 ] \"point3 to\" [ 0 0 0 ]\nMaterial \"diffuse\" \"rgb reflectance\" [ 0.5 0.5 "
            "0.5 "
            "]\nAttributeBegin\nTranslate 0 -1.2 0\nRotate 90 1 0 0\nShape \"disk\" \"float radius\" 9\nAttributeEnd\nMakeNamedMedium "
            "\"milk\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ ") +
        sigma_s +
        " ] \"rgb sigma_a\" [ 0.1 0.1 0.1 ] \"float g\" 0.7\nMediumInterface \"milk\" \"\"\nMaterial \"interface\"\nShape \"sphere\" "
        "\"float radius\" 1\n";
    PathSettings settings;
    settings.frame_seed = frame_seed(7, 0);
    const CheckReport report = check_scene(text, settings, false, 20000, "milk");
    EXPECT_GT(report.shared, 5000) << "light samples that a branch could have made";
    EXPECT_GT(report.branches, 2000);
    EXPECT_GT(report.light_roulettes, 5000);
    EXPECT_EQ(report.failed, 0) << describe(report);
    EXPECT_LT(report.too_near, report.total() / 100) << describe(report);
    PathSettings without = settings;
    without.features.take_out(Feature::kTowardsLight);
    const CheckReport alone = check_scene(text, without, false, 2000, "milk without branches");
    EXPECT_EQ(alone.shared + alone.branches, 0);
    EXPECT_EQ(alone.failed, 0) << describe(alone);
  }
}

/// Where two lights or depths are near a threshold, or a vertex is near a light, rounding may be more than what was changed.
TEST(Weights, N69_weights_that_are_off_by_a_five_hundredth_are_noticed) {
  Tampering all;
  for (uint64_t i = 1; i <= 24; ++i) {
    const Tampering t = check_tampered_scene(i, 40);
    all.changed += t.changed;
    all.noticed += t.noticed;
  }
  EXPECT_GT(all.changed, 1000);
  EXPECT_GT(static_cast<double>(all.noticed), 0.9 * static_cast<double>(all.changed)) << all.noticed << " of " << all.changed;
}

}  // namespace
}  // namespace woodcock::testing
