// Where paths meet boundaries: which medium lies behind, what glass does to light, and meshes around fog.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/hard_cases/scene_pieces.h"

namespace woodcock::testing {
namespace {

// A shape without MediumInterface keeps the medium of the ray: a diffuse plate in fog is lit through the fog.
TEST(HardCases, N13_a_shape_without_media_of_its_own_keeps_the_medium) {
  const std::string fog = homogeneous("m", Rgb(0.7f), Rgb(0));
  const std::string light = "LightSource \"distant\" \"point3 from\" [ 0 1 0 ] \"point3 to\" [ 0 0 0 ] \"rgb L\" [ 1 1 1 ]\n";
  // A floor inside of a ball of radius 20: the light enters at height 20, the camera is at 0.5.
  const std::string plate =
      "AttributeBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ .8 .8 .8 ]\nRotate -90 1 0 0\nShape \"disk\" \"float radius\" "
      "1\nAttributeEnd\n";
  const Estimate e =
      estimate(perspective({0, 0.5, 0}, {0, 0, 0}, 0.1, 1) + "WorldBegin\n" + fog + plate + light + boundary("m", "", sphere(2)), 1000, 1);
  EXPECT_NEAR(e.mean[0], 0.8 / kPiD * std::exp(-0.7 * 2.5), 1e-4);
}

// The floor lies in a boundary between two media: what the sun sends through the upper one reaches it, whichever side the path
// came from, and the light sample knows the side it leaves to.
TEST(HardCases, N13_light_samples_of_a_boundary_leave_into_the_medium_of_their_side) {
  const std::string media = homogeneous("above", Rgb(0.4f), Rgb(0)) + homogeneous("below", Rgb(3), Rgb(0));
  const std::string light = "LightSource \"distant\" \"point3 from\" [ 0 1 0 ] \"point3 to\" [ 0 0 0 ] \"rgb L\" [ 1 1 1 ]\n";
  // A ball of radius 2 around a plate that transmits diffusely, with the media on its sides. The camera is in one of them.
  const auto plate = [&](double eye) {
    return perspective({0, eye, 0}, {0, 0, 0}, 0.1, 1) + "WorldBegin\n" + media + light +
           "AttributeBegin\nMaterial \"diffusetransmission\" \"rgb reflectance\" [ .4 .4 .4 ] \"rgb transmittance\" [ .5 .5 .5 ]\n"
           "MediumInterface \"below\" \"above\"\nRotate -90 1 0 0\nShape \"disk\" \"float radius\" 1\nAttributeEnd\n"
           "AttributeBegin\nMaterial \"interface\"\nTranslate 0 0 0\nRotate -90 1 0 0\n"
           "MediumInterface \"above\" \"\"\nShape \"sphere\" \"float radius\" 2 \"float zmin\" 0\n"
           "MediumInterface \"below\" \"\"\nShape \"sphere\" \"float radius\" 2 \"float zmax\" 0\nAttributeEnd\n";
  };
  // From above: 0.5 of medium "above" to the camera, 2 of it from the sun; from below 0.5 of "below" to the camera.
  EXPECT_NEAR(estimate(plate(0.5), 200, 1).mean[0], 0.4 / kPiD * std::exp(-0.4 * 2.5), 1e-4);
  EXPECT_NEAR(estimate(plate(-0.5), 200, 1).mean[0], 0.5 / kPiD * std::exp(-0.4 * 2 - 3 * 0.5), 1e-4);
}

TEST(HardCases, N14_the_camera_s_medium_is_found_in_one_ball_and_in_two) {
  const std::string media = homogeneous("m", Rgb(1), Rgb(0)) + homogeneous("n", Rgb(0.25f), Rgb(0));
  const std::string outer = boundary("m", "", sphere(2)), inner = boundary("n", "m", sphere(1, {0.2, 0, 0}));
  const auto seen = [&](DVec3 eye, const std::string& balls) {
    return estimate(perspective(eye, eye + DVec3(1, 0, 0), 0.01, 5) + "WorldBegin\n" + environment(1) + media + balls, 100, 1).mean[0];
  };
  EXPECT_NEAR(seen({0.5, 0, 0}, outer), std::exp(-1.5), 1e-5);
  EXPECT_NEAR(seen({0.5, 0, 0}, outer + inner), std::exp(-0.25 * 0.7 - 0.8), 1e-5);
  EXPECT_NEAR(seen({0.5, 0, 0}, inner + outer), std::exp(-0.25 * 0.7 - 0.8), 1e-5);
  EXPECT_NEAR(seen({1.5, 0, 0}, outer + inner), std::exp(-0.5), 1e-5);
  EXPECT_NEAR(seen({-3, 0, 0}, outer + inner), std::exp(-1.2 - 0.25 * 2 - 0.8), 1e-5);
  // In glass the camera is in the medium that the glass holds.
  const std::string glass =
      "AttributeBegin\nMaterial \"dielectric\" \"float eta\" 1\nMediumInterface \"m\" \"\"\n" + sphere(2) + "AttributeEnd\n";
  EXPECT_NEAR(seen({0.5, 0, 0}, glass), std::exp(-1.5), 1e-5);
}

// Overlapping balls: the last boundary that was crossed says which medium it is.
TEST(HardCases, N15_of_overlapping_media_the_last_boundary_crossed_wins) {
  const std::string media = homogeneous("m", Rgb(1), Rgb(0)) + homogeneous("n", Rgb(0.1f), Rgb(0));
  // Along z from 4: m from 1 to 0.5 (where n begins), n to -1 (where m ends and vacuum begins), vacuum to the end of n.
  const Estimate e = estimate(perspective({0, 0, 4}, {0, 0, 0}, 0.01, 1) + "WorldBegin\n" + environment(1) + media +
                                  boundary("m", "", sphere(1)) + boundary("n", "", sphere(1, {0, 0, -0.5})),
                              100, 1);
  EXPECT_NEAR(e.mean[0], std::exp(-0.5 - 0.15), 1e-4);
}

/// A plate of glass 0 ≥ z ≥ −3 with an inner plate −1 ≥ z ≥ −2 of index n₂, seen at right angles.
std::string plates(double n, double relative, const std::string& inner_medium = "") {
  const auto slab = [](double z0, double z1) {
    return fmt::format(
        "Shape \"trianglemesh\" \"point3 P\" [ -50 -50 {0} 50 -50 {0} 50 50 {0} -50 50 {0}  -50 -50 {1} -50 50 {1} 50 50 {1} 50 -50 {1} ] "
        "\"integer indices\" [ 0 1 2  0 2 3  4 5 6  4 6 7 ]\n",
        z0, z1);
  };
  return perspective({0, 0, 4}, {0, 0, 0}, 0.01, 1000) + "WorldBegin\n" + environment(1) +
         // Black behind, so that what is seen is the reflectance.
         "AttributeBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\nTranslate 0 0 -10\nShape \"disk\" \"float radius\" "
         "1000\nAttributeEnd\n" +
         inner_medium + fmt::format("Material \"dielectric\" \"float eta\" {}\n", n) + slab(0, -3) +
         fmt::format("AttributeBegin\nMaterial \"dielectric\" \"float eta\" {}\n{}", relative,
                     inner_medium.empty() ? "" : "MediumInterface \"m\" \"\"\n") +
         slab(-1, -2) + "AttributeEnd\n";
}

/// Two layers of reflectances a, b and transmittances t, u (over the incoherent sum of all orders): of both.
struct Layer {
  double r, t;
};
Layer stacked(Layer a, Layer b) {
  const double orders = 1 / (1 - a.r * b.r);
  return {a.r + a.t * a.t * b.r * orders, a.t * b.t * orders};
}

TEST(HardCases, N16_nested_dielectrics_reflect_the_incoherent_sum_of_all_orders) {
  const auto face = [](double n) {
    const double r = (n - 1) * (n - 1) / ((n + 1) * (n + 1));
    return Layer{r, 1 - r};
  };
  for (const double relative : {1.0, 1.33 / 1.5, 2.4 / 1.5}) {
    const Layer inner = stacked(face(relative), face(relative)), all = stacked(face(1.5), stacked(inner, face(1.5)));
    expect_value(estimate(plates(1.5, relative), 60000, 1), all.r, 0.02, fmt::format("relative index {}", relative));
  }
  // An inner plate that absorbs half of the light at each pass.
  const Layer absorbing{0, 0.5};
  const Layer inner = stacked(face(1.2), stacked(absorbing, face(1.2))), all = stacked(face(1.5), stacked(inner, face(1.5)));
  expect_value(estimate(plates(1.5, 1.2, homogeneous("m", Rgb(0.69314718f), Rgb(0))), 60000, 1), all.r, 0.02, "absorbing");
}

// A lamp in a medium in glass: shadow rays never get through the glass, chance does. Smooth glass of index 1 must show
// what an interface shows, where shadow rays do get through.
TEST(HardCases, N17_glass_of_index_one_around_a_lamp_in_fog_equals_an_interface) {
  const std::string medium = homogeneous("m", Rgb(0.3f), Rgb(1.5f), 0.3);
  const auto scene = [&](const char* material) {
    return floor_below(0.8, 4) + medium + lamp(sphere(0.3, {0, 1.5, 0})) + "AttributeBegin\nMaterial " + material +
           "\nMediumInterface \"m\" \"\"\n" + sphere(0.7, {0, 1.5, 0}) + "AttributeEnd\n";
  };
  // Depth counts the pass through a surface, so the comparison is of one more scattering at each crossing: deep enough
  // for neither to matter is deep enough for both.
  const auto deep = [](std::string text) {
    text.replace(text.find("\"integer maxdepth\" 4"), 20, "\"integer maxdepth\" 100");
    return text;
  };
  expect_equal(estimate(deep(scene("\"dielectric\" \"float eta\" 1")), 300000, 1), estimate(deep(scene("\"interface\"")), 60000, 2), 0.03,
               "lamp in fog in a shell");
}

// A black lamp in a ball of absorbing glass: the camera sees it through one face, dimmed by the glass and by n².
TEST(HardCases, N17_a_lamp_in_absorbing_glass_is_dimmed_by_the_way_to_the_face) {
  const auto ball = [](const std::string& medium) {
    return perspective({0, 0, 4}, {0, 0, 0}, 0.01, 100) + "WorldBegin\n" + homogeneous("m", Rgb(0.8f), Rgb(0)) +
           lamp(sphere(0.25), "Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\n") + "Material \"dielectric\" \"float eta\" 1.5\n" +
           medium + sphere(1);
  };
  const double through_face = 0.96 / 2.25;
  expect_value(estimate(ball(""), 200000, 1), 3 * through_face, 2e-3, "clear glass");
  expect_value(estimate(ball("MediumInterface \"m\" \"\"\n"), 200000, 1), 3 * through_face * std::exp(-0.8 * 0.75), 2e-3,
               "absorbing glass");
}

// Radiance over n² is what a boundary keeps: a camera in glass sees its surroundings n² as bright, and n⁴ in glass in glass;
// light that leaves again is as bright as it was.
TEST(HardCases, N18_radiance_is_scaled_by_the_square_of_the_index_once) {
  const auto shells = [](DVec3 eye, DVec3 target) {
    return perspective(eye, target, 20, 1000000) + "WorldBegin\n" + environment(1) + "Material \"dielectric\" \"float eta\" 1.4\n" +
           sphere(1) + "Material \"dielectric\" \"float eta\" 1.2\n" + sphere(0.5);
  };
  expect_value(estimate(shells({0, 0.75, 0}, {0, 2, 0}), 20000, 1), 1.4 * 1.4, 1e-2, "between the shells");
  expect_value(estimate(shells({0, 0.1, 0}, {0, 2, 0}), 20000, 1), 1.4 * 1.4 * 1.2 * 1.2, 1e-2, "inside of both");
  expect_value(estimate(shells({0, 0, 4}, {0, 0, 0}), 20000, 1), 1, 1e-2, "from outside");
}

// A box of fog cut into triangles, met at its vertices and on its edges: the way through it is as long as it is.
TEST(HardCases, N28_fog_in_a_mesh_is_as_deep_at_vertices_and_edges_as_elsewhere) {
  constexpr int kCells = 8;
  std::string points, indices;
  int vertex = 0;
  for (const double z : {1.0, -1.0}) {
    for (int j = 0; j <= kCells; ++j)
      for (int i = 0; i <= kCells; ++i) points += fmt::format(" {} {} {}", 2.0 * i / kCells - 1, 2.0 * j / kCells - 1, z);
    for (int j = 0; j < kCells; ++j)
      for (int i = 0; i < kCells; ++i) {
        const int a = vertex + j * (kCells + 1) + i, b = a + 1, c = a + kCells + 1, d = c + 1;
        // Counter-clockwise from outside; the diagonals differ between the two faces.
        indices += z > 0 ? fmt::format(" {} {} {} {} {} {}", a, b, d, a, d, c) : fmt::format(" {} {} {} {} {} {}", a, c, b, b, c, d);
      }
    vertex += (kCells + 1) * (kCells + 1);
  }
  const CompiledScene scene =
      compile(perspective({0, 0, 9}, {0, 0, 0}, 10, 5) + "WorldBegin\n" + environment(1) + homogeneous("m", Rgb(0.7f), Rgb(0)) +
              boundary("m", "", "Shape \"trianglemesh\" \"point3 P\" [" + points + " ] \"integer indices\" [" + indices + " ]\n"));
  PathCounters counters;
  for (int j = 1; j < 2 * kCells; ++j)
    for (int i = 1; i < 2 * kCells; ++i) {
      // Vertices, middles of edges and of diagonals, straight through and aslant to a vertex of the other face.
      const DVec3 from(static_cast<double>(i) / kCells - 1, static_cast<double>(j) / kCells - 1, 1), to(-0.25, 0.5, -1);
      EXPECT_NEAR(radiance_along(scene, from + DVec3(0, 0, 3), {0, 0, -1}, counters).g, std::exp(-0.7 * 2), 1e-5) << i << ' ' << j;
      EXPECT_NEAR(radiance_along(scene, from - 2.0 * (to - from), to - from, counters).g, std::exp(-0.7 * glm::length(to - from)), 1e-5)
          << i << ' ' << j;
    }
}

}  // namespace
}  // namespace woodcock::testing
