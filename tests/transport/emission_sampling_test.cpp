// Volumes that emit are found by paths that meet them and by sampling their bricks as lights. Both ways, and each feature
// that concerns grids, give the same light with it and without it; also for a `sum` of media.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "renderer/world/effects.h"
#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

/// 5³ voxels over the cube of half edge `half` around `at`, each third one glowing, with some smoke.
std::string flame(const std::string& name, double half, DVec3 at, Rgb emission) {
  std::string density, scale;
  for (int i = 0; i < 125; ++i) {
    density += fmt::format("{} ", i % 3 == 0 ? 3.0 : 0.4);
    scale += fmt::format("{} ", i % 5 == 0 ? 2.0 : 0.0);
  }
  return fmt::format(
      "MakeNamedMedium \"{}\" \"string type\" \"uniformgrid\" \"integer nx\" 5 \"integer ny\" 5 \"integer nz\" 5 \"rgb sigma_a\" [ 1 1 1 ] "
      "\"rgb "
      "sigma_s\" [ .5 .5 .5 ] \"float g\" 0.3 \"point3 p0\" [ {} {} {} ] \"point3 p1\" [ {} {} {} ] \"rgb Le\" [ {} {} {} ]\n \"float "
      "density\" [ "
      "{}]\n \"float Lescale\" [ {}]\n",
      name, at.x - half, at.y - half, at.z - half, at.x + half, at.y + half, at.z + half, emission.x, emission.y, emission.z, density,
      scale);
}

/// A floor below the ball of medium "m", seen from above and aside; the flame is not in the picture.
std::string floor_lit_by(const std::string& media) {
  return perspective({0, 1.5, 4}, {0, -1, 1.5}, 12, 4) +
         "WorldBegin\nAttributeBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ .8 .8 .8 ]\nTranslate 0 -1.2 0\nRotate -90 1 0 0\nShape "
         "\"disk\" \"float radius\" 9\nAttributeEnd\n" +
         media + boundary("m", "", sphere(1));
}

std::vector<std::pair<std::string, std::string>> scenes() {
  const std::string fire = flame("m", 0.5, {0, 0, 0}, {5, 3, 1});
  const std::string parts = flame("a", 0.3, {0.2, 0.1, 0}, {20, 3, 0}) + flame("b", 0.4, {-0.1, -0.3, 0.2}, {0, 6, 12}) +
                            homogeneous("f", Rgb(0.05f), Rgb(0.2f), 0.5, Rgb(3)) +
                            "MakeNamedMedium \"m\" \"string type\" \"sum\" \"string media\" [ \"a\" \"f\" \"b\" ]\n";
  return {{"flame", floor_lit_by(fire)}, {"sum", floor_lit_by(parts)}};
}

TEST(EmissionSampling, gives_the_same_light_as_meeting_the_volume_by_chance_with_less_noise) {
  for (const auto& [name, text] : scenes()) {
    const CompiledScene with = compile(text);
    CompiledScene without = compile(text);
    without.settings.features.take_out(Feature::kEmissionSampling);
    const Estimate a = estimate(with, 300000, 1), b = estimate(without, 300000, 2);
    expect_equal(a, b, 0.02, name);
    EXPECT_LT(a.error[1], 0.8 * b.error[1]) << name;
    EXPECT_GT(a.mean[1], 0.01) << name;
    EXPECT_EQ(a.counters.majorant_violations, 0u) << name;
  }
}

TEST(EmissionSampling, is_planned_where_the_glow_gives_a_fifth_of_the_light) {
  const std::string fire = floor_lit_by(flame("m", 0.5, {0, 0, 0}, {5, 3, 1}));
  const auto planned = [](const std::string& text) { return (compile(text).world->effects & kEmissionSampling) != 0; };
  EXPECT_TRUE(planned(fire));
  EXPECT_TRUE(planned(fire + environment(0.01f)));
  EXPECT_FALSE(planned(fire + environment(1)));
}

TEST(EmissionSampling, features_of_tracking_change_no_light_of_a_grid_or_a_sum) {
  for (const auto& [name, text] : scenes()) {
    const Estimate reference = estimate(compile(text), 150000, 3);
    for (const Feature feature : {Feature::kBricks, Feature::kResidual, Feature::kRayMarchedShadows, Feature::kMis}) {
      CompiledScene without = compile(text);
      without.settings.features.take_out(feature);
      expect_equal(reference, estimate(without, 150000, 4 + static_cast<uint64_t>(feature)), 0.03,
                   name + " without " + std::to_string(static_cast<int>(feature)));
    }
  }
}

}  // namespace
}  // namespace woodcock::testing
