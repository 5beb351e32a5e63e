// The size of a scene, its place, and the number of mean free paths across it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

// Seen from outside, a ball of a thousand mean free paths is a half space, and so is one of a hundred thousand, where
// floats next to the boundary are not much finer than a mean free path: what scatters there must stay inside.
TEST(HardCases, N12_dense_bodies_look_the_same_from_a_thousand_mean_free_paths_on) {
  const auto ball = [](float sigma) {
    return perspective({0, 0, 4}, {0, 0, 0}, 20, 100000) + "WorldBegin\n" + environment(1) +
           homogeneous("m", Rgb(0.02f * sigma), Rgb(0.98f * sigma)) + boundary("m", "", sphere(1));
  };
  const Estimate thick = estimate(ball(1e3f), 40000, 1);
  for (const float sigma : {3e4f, 1e5f}) expect_equal(estimate(ball(sigma), 40000, 2), thick, 0.01, fmt::format("sigma {}", sigma));
}

/// A scene of everything that has a length: glass, a medium in an interface, a grid, a floor, lamps; `s` times as
/// large, moved by `at`.
std::string everything(double s, DVec3 at = DVec3(0)) {
  const auto f = static_cast<float>(s);
  const DVec3 eye = at + s * DVec3(0.3, 1.5, 5), target = at + s * DVec3(0, 0.5, 0);
  return perspective(eye, target, 40, 20) + "WorldBegin\n" + homogeneous("fog", Rgb(0.2f / f), {0.5f / f, 1 / f, 2 / f}, 0.5) +
         fmt::format("AttributeBegin\nTranslate {:.17g} {:.17g} {:.17g}\nScale {:.17g} {:.17g} {:.17g}\n", at.x, at.y, at.z, s, s, s) +
         // Bounds of a medium scale with its transform, coefficients do not.
         "AttributeBegin\nTranslate 1.2 0.7 0\n" + constant_grid("smoke", Rgb(0.5f / f), Rgb(2 / f), 0.6) +
         boundary("smoke", "", sphere(0.5)) + "AttributeEnd\n" + boundary("fog", "", sphere(0.6, {-0.3, 0.7, 0})) +
         "AttributeBegin\nMaterial \"dielectric\"\nMediumInterface \"fog\" \"\"\n" + sphere(0.4, {-1.5, 0.5, 0.5}) +
         "AttributeEnd\nAttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [ 6 5 4 ]\n" + sphere(0.3, {0, 2.5, 1}) +
         "AttributeEnd\nMaterial \"diffuse\" \"rgb reflectance\" [ .6 .5 .4 ]\nShape \"bilinearmesh\" \"point3 P\" [ -4 0 4  4 0 4  -4 0 "
         "-4  4 0 -4 ]\n" +
         fmt::format("LightSource \"point\" \"point3 from\" [ -2 2 2 ] \"rgb I\" [ {0:.9g} {0:.9g} {0:.9g} ]\nAttributeEnd\n", 3 * s * s) +
         environment(0.2f);
}

TEST(HardCases, N60_a_scale_of_a_power_of_two_gives_the_same_bits) {
  const std::vector<Rgb> reference = radiances(compile(everything(1)), 3000, 1);
  for (const double s : {0x1p-20, 0.5, 0x1p13}) EXPECT_EQ(radiances(compile(everything(s)), 3000, 1), reference) << s;
}

TEST(HardCases, N27_scenes_of_any_size_give_the_same_picture) {
  const Estimate reference = estimate(everything(1), 40000, 1);
  for (const double s : {1e-4, 1e5}) expect_equal(estimate(everything(s), 40000, 2), reference, 0.03, fmt::format("scale {}", s));
}

TEST(HardCases, N26_scenes_far_from_the_origin_give_the_same_picture) {
  const Estimate reference = estimate(everything(1), 40000, 1);
  for (const DVec3 at : {DVec3(1e5, 0, 0), DVec3(-3e4, 1e5, 7e4), DVec3(3e7, -1e7, 2e7)})
    expect_equal(estimate(everything(1, at), 40000, 3), reference, 0.03, fmt::format("moved by {} {} {}", at.x, at.y, at.z));
}

}  // namespace
}  // namespace woodcock::testing
