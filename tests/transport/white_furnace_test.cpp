// In a furnace of radiance one where nothing absorbs, every path carries radiance one in the mean: whatever scatters,
// in whatever medium, and wherever the camera stands (hard cases N11, N12, N14, N17, N43).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

constexpr int kDeep = 1000000;
constexpr Rgb kOne{1};

struct Furnace {
  std::string name;
  std::string text;
  double expected = 1;
  double slack = 0;  ///< relative: what a model is known to lose at most
  int samples = 60000;
  double resolution = 2e-3;
};
void PrintTo(const Furnace& furnace, std::ostream* out) { *out << furnace.name; }

std::string looking_at_ball(int depth = kDeep) { return perspective({0, 0, 4}, {0, 0, 0}, 30, depth); }

Furnace ball(const std::string& name, const std::string& material, double slack = 0) {
  return {name, looking_at_ball() + "WorldBegin\n" + environment(1) + material + "\n" + sphere(1), 1, slack};
}

std::vector<Furnace> furnaces() {
  std::vector<Furnace> all;
  all.push_back(ball("Diffuse", "Material \"diffuse\" \"rgb reflectance\" [ 1 1 1 ]"));
  all.push_back(ball("SmoothGlass", "Material \"dielectric\""));
  all.push_back(ball("DenseGlass", "Material \"dielectric\" \"float eta\" 2.4"));
  all.push_back(ball("LighterThanOutside", "Material \"dielectric\" \"float eta\" 0.7"));
  all.push_back(ball("IndexMatchedGlass", "Material \"dielectric\" \"float eta\" 1"));
  // Facets of rough glass scatter once; what would scatter again is lost, more of it the rougher and the longer light
  // is caught inside. The loss must vanish with the roughness.
  all.push_back(ball("HardlyRoughGlass", "Material \"dielectric\" \"float roughness\" 0.005 \"bool remaproughness\" false", 0.003));
  all.push_back(ball("RoughGlass", "Material \"dielectric\" \"float roughness\" 0.1 \"bool remaproughness\" false", 0.06));
  all.push_back(ball("ThinGlass", "Material \"thindielectric\""));
  all.push_back(
      ball("DiffuseTransmission", "Material \"diffusetransmission\" \"rgb reflectance\" [ .3 .3 .3 ] \"rgb transmittance\" [ .7 .7 .7 ]"));
  all.push_back(ball("MixOfLossless",
                     "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" \"rgb reflectance\" [ 1 1 1 ]\n"
                     "MakeNamedMaterial \"b\" \"string type\" \"dielectric\"\n"
                     "Material \"mix\" \"string materials\" [ \"a\" \"b\" ] \"float amount\" 0.4"));
  all.push_back(ball("MixWithInterface",
                     "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" \"rgb reflectance\" [ 1 1 1 ]\n"
                     "MakeNamedMaterial \"b\" \"string type\" \"interface\"\n"
                     "Material \"mix\" \"string materials\" [ \"a\" \"b\" ] \"float amount\" 0.4"));
  all.push_back(ball("Interface", "Material \"interface\""));
  all.push_back({"HalfTransparent", looking_at_ball() + "WorldBegin\n" + environment(1) +
                                        "Material \"diffuse\" \"rgb reflectance\" [ 1 1 1 ]\n"
                                        "Shape \"sphere\" \"float radius\" 1 \"float alpha\" 0.5\n"});

  all.push_back(ball("Mirror", "Material \"conductor\" \"rgb reflectance\" [ 1 1 1 ]", 2e-4));
  // As in pbrt-v4 the reflectance of a metal is at most 0.9999. A single facet reflects 0.99 of what a mirror of this roughness would.
  all.push_back(ball("RoughMirror",
                     "Material \"conductor\" \"rgb reflectance\" [ 1 1 1 ] \"float roughness\" 0.1 \"bool remaproughness\" false", 0.03));
  all.push_back(ball("CoatedWhite",
                     "Material \"coateddiffuse\" \"rgb reflectance\" [ 1 1 1 ] \"rgb albedo\" [ 1 1 1 ] \"float thickness\" 0.5 \"float "
                     "roughness\" 0 \"integer maxdepth\" 100000"));
  all.back().resolution = 0.01;
  all.push_back(ball("CoatedMirror",
                     "Material \"coatedconductor\" \"rgb reflectance\" [ 1 1 1 ] \"rgb albedo\" [ 1 1 1 ] \"float thickness\" 0.5 \"float "
                     "interface.roughness\" 0 \"float conductor.roughness\" 0 \"integer maxdepth\" 100000"));
  // Metal of reflectance one has 0.9999 (as in pbrt-v4), and light meets it a few times.
  all.back().slack = 5e-4;
  all.back().resolution = 0.01;
  all.back().samples = 5000;
  all.push_back(ball("SubsurfaceWithoutAbsorption", "Material \"subsurface\" \"rgb sigma_a\" [ 0 0 0 ] \"rgb sigma_s\" [ 2 2 2 ]"));

  // A lamp of radiance one that is convex lights nothing of itself, whatever its material scatters; turned, so that its points are
  // off it by their rounding.
  const auto alone = [&](const std::string& name, const std::string& material, const std::string& sides, const std::string& shape) {
    all.push_back({name, perspective({0, 0, 4}, {0, 0, 0}, 5, kDeep) + "WorldBegin\nRotate 20 1 2 0.3\nMaterial " + material +
                             "\nAreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" " + sides + "\n" + shape});
  };
  const std::string triangle = "Shape \"trianglemesh\" \"point3 P\" [ -3 -3 0  3 -3 0  0 4 0 ] \"integer indices\" [ 0 1 2 ]\n",
                    grey = "\"diffuse\"",
                    through = "\"diffusetransmission\" \"rgb reflectance\" [ .25 .25 .25 ] \"rgb transmittance\" [ .5 .5 .5 ]",
                    rough = "\"conductor\" \"float roughness\" 0.4";
  alone("TwoSidedTriangleLampAlone", grey, "true", triangle);
  alone("TwoSidedTriangleLampOfRoughMetalAlone", rough, "true", triangle);
  alone("TranslucentTriangleLampAlone", through, "false", triangle);
  alone("TwoSidedSphereLampAlone", grey, "true", sphere(1));
  alone("TwoSidedPatchLampAlone", grey, "true", "Shape \"bilinearmesh\" \"point3 P\" [ -3 -3 0  3 -3 0  -2 3 0  4 3 0 ]\n");

  // Two skies are met at once and sampled one by one.
  const double half = 1.5;
  const Rgb none(0), sigma(2);
  const std::string skies = environment(0.5f) + environment(0.5f), uneven = environment(0.9f) + environment(0.1f);
  const std::string white = "Material \"diffuse\" \"rgb reflectance\" [ 1 1 1 ]\n" + sphere(1);
  all.push_back({"DiffuseUnderTwoSkies", looking_at_ball() + "WorldBegin\n" + skies + white});
  all.push_back({"DiffuseUnderTwoUnevenSkies", looking_at_ball() + "WorldBegin\n" + uneven + white});
  all.push_back(
      {"MediumUnderTwoSkies", looking_at_ball() + "WorldBegin\n" + skies + homogeneous("m", none, sigma) + boundary("m", "", sphere(1))});
  const auto in_ball = [&](const std::string& name, const std::string& medium, const std::string& material) {
    all.push_back(
        {name, looking_at_ball() + "WorldBegin\n" + environment(1) + medium + material + "\nMediumInterface \"m\" \"\"\n" + sphere(1)});
  };
  const std::string interface = "Material \"interface\"", glass = "Material \"dielectric\" \"float eta\" 1.3";
  in_ball("Homogeneous", homogeneous("m", none, sigma, 0.6), interface);
  in_ball("ConstantGrid", constant_grid("m", none, sigma, half, 0.6), interface);
  in_ball("ConstantRgbGrid", constant_rgb_grid("m", none, sigma, half, -0.6), interface);
  in_ball("ChromaticHomogeneous", homogeneous("m", none, {0, 1, 4}), interface);
  all.back().resolution = 7e-3;
  in_ball("ChromaticGrid", constant_grid("m", none, {4, 0, 1}, half), interface);
  all.back().resolution = 7e-3;
  in_ball("ChromaticRgbGrid", constant_rgb_grid("m", none, {1, 4, 0}, half), interface);
  all.back().resolution = 7e-3;
  in_ball("Cloud",
          "MakeNamedMedium \"m\" \"string type\" \"cloud\" \"rgb sigma_a\" [ 0 0 0 ] \"rgb sigma_s\" [ 6 6 6 ] \"float g\" 0.4 \"float "
          "density\" 2\n \"point3 p0\" [ -1 -1 -1 ] \"point3 p1\" [ 1 1 1 ]\n",
          interface);
  in_ball(
      "SpottyGrid",
      "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 2 \"integer ny\" 3 \"integer nz\" 2 \"rgb sigma_a\" [ 0 0 "
      "0 ]\n \"rgb sigma_s\" [ 3 3 3 ] \"point3 p0\" [ -1 -1 -1 ] \"point3 p1\" [ 1 1 1 ] \"float density\" [ 0 4 1 0 0 9 0 0 2 0 .1 0 ]\n",
      interface);
  const auto with_phase = [&](const std::string& name, const std::string& phase) {
    in_ball(name,
            "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [ 0 0 0 ] \"rgb sigma_s\" [ 2 2 2 ] \"string phase\" " +
                phase + "\n",
            interface);
    all.back().samples = 30000;
    all.back().resolution = 5e-3;
  };
  with_phase("Isotropic", "\"isotropic\"");
  with_phase("TwoLobes", "\"twolobe\" \"float g\" 0.8 \"float g2\" -0.5 \"float lobeweight\" 0.6");
  with_phase("Rayleigh", "\"rayleigh\"");
  with_phase("Draine", "\"draine\" \"float g\" 0.5 \"float alpha\" 20");
  with_phase("Mie", "\"mie\" \"float dropletdiameter\" 10");
  with_phase("Tabulated", "\"tabulated\" \"float phaseangles\" [ 0 10 90 180 ] \"float phasevalues\" [ 3 0.2 0 0.1 ]");
  // Media that overlap: the sum of a fog and of a grid that fills a part of the ball, with phase functions of their own.
  const std::string summed =
      homogeneous("f", none, {1, 2, 3}, 0.8) + constant_grid("c", none, {3, 1, 2}, 0.5, -0.5) + homogeneous("h", none, {2, 0, 1}, -0.3);
  in_ball("SumOfHomogeneous", summed + "MakeNamedMedium \"m\" \"string type\" \"sum\" \"string media\" [ \"f\" \"h\" ]\n", interface);
  all.back().samples = 150000;
  all.back().resolution = 7e-3;
  in_ball("SumWithGrid", summed + "MakeNamedMedium \"m\" \"string type\" \"sum\" \"string media\" [ \"f\" \"c\" \"h\" ]\n", interface);
  all.back().resolution = 0.015;
  in_ball("MediumInGlass", homogeneous("m", none, sigma), glass);
  in_ball("GridInGlass", constant_grid("m", none, sigma, half), glass);
  in_ball("MediumInRoughGlass", homogeneous("m", none, sigma),
          "Material \"dielectric\" \"float roughness\" 0.005 \"bool remaproughness\" false");
  all.back().slack = 0.003;
  in_ball("MediumInDiffuseShell", homogeneous("m", none, sigma),
          "Material \"diffusetransmission\" \"rgb reflectance\" [ .5 .5 .5 ] \"rgb transmittance\" [ .5 .5 .5 ]");
  // A boundary every few hundred ulps of a mean free path: what a scattering rounded onto it would lose shows here.
  in_ball("VeryDense", homogeneous("m", none, Rgb(10000)), interface);
  all.back().samples = 1000;
  all.back().resolution = 0.02;

  const std::string two = homogeneous("m", none, sigma, 0.3) + homogeneous("n", none, Rgb(5), -0.2);
  const std::string nested = two + boundary("m", "", sphere(1)) + boundary("n", "m", sphere(0.5, {0.1, 0.2, 0.1}));
  all.push_back({"MediumInMedium", looking_at_ball() + "WorldBegin\n" + environment(1) + nested});
  all.push_back({"InterfaceInInterface", looking_at_ball() + "WorldBegin\n" + environment(1) + two + boundary("m", "", sphere(1)) +
                                             boundary("m", "m", sphere(0.6))});
  all.push_back({"GlassInMedium", looking_at_ball() + "WorldBegin\n" + environment(1) + two + boundary("m", "", sphere(1)) +
                                      "AttributeBegin\nMaterial \"dielectric\"\nMediumInterface \"n\" \"m\"\n" + sphere(0.5) +
                                      "AttributeEnd\n"});
  all.push_back({"CameraInMedium", perspective({0.2, 0.1, 0.3}, {1, 0.4, 0.2}, 70, kDeep) + "WorldBegin\n" + environment(1) + two +
                                       boundary("m", "", sphere(1))});
  all.push_back({"CameraInInnerMedium", perspective({0.1, 0.1, 0.1}, {1, 0.4, 0.2}, 70, kDeep) + "WorldBegin\n" + environment(1) + nested});
  // A camera in glass sees n² times the radiance of its surroundings (N18).
  all.push_back(
      {"CameraInGlass",
       perspective({0.2, 0.1, 0.3}, {1, 0.4, 0.2}, 70, kDeep) + "WorldBegin\n" + environment(1) + "Material \"dielectric\"\n" + sphere(1),
       2.25});
  all.back().resolution = 0.01;
  all.push_back({"CameraInMediumInGlass",
                 perspective({0.2, 0.1, 0.3}, {1, 0.4, 0.2}, 70, kDeep) + "WorldBegin\n" + environment(1) + two +
                     "Material \"dielectric\"\nMediumInterface \"m\" \"\"\n" + sphere(1),
                 2.25});
  all.back().resolution = 0.01;
  // The medium that was given in the mirrored and unevenly scaled space of an instance.
  all.push_back({"Instance", looking_at_ball() + "WorldBegin\n" + environment(1) + two +
                                 "ObjectBegin \"o\"\nMaterial \"interface\"\nMediumInterface \"m\" \"\"\n" + sphere(1) +
                                 "ObjectEnd\nScale -0.5 1 0.7\nObjectInstance \"o\"\n"});
  return all;
}

class WhiteFurnace : public ::testing::TestWithParam<Furnace> {};

TEST_P(WhiteFurnace, ShowsNoBody) {
  const Furnace& f = GetParam();
  const Estimate e = estimate(f.text, f.samples, 7);
  for (size_t c = 0; c < 3; ++c) {
    const double noise = kStandardErrors * e.error[c] + kRounding * f.expected;
    const std::string report = fmt::format("channel {}: {:.7g} ± {:.2g}, expected {}", c, e.mean[c], e.error[c], f.expected);
    EXPECT_LE(e.mean[c], f.expected + noise) << report;
    EXPECT_GE(e.mean[c], f.expected * (1 - f.slack) - noise) << report;
    EXPECT_LE(e.error[c], f.resolution * f.expected) << report;
  }
  EXPECT_EQ(e.counters.nonfinite, 0u);
  EXPECT_EQ(e.counters.truncated, 0u);
  EXPECT_EQ(e.counters.majorant_violations, 0u);
}

INSTANTIATE_TEST_SUITE_P(Every, WhiteFurnace, ::testing::ValuesIn(furnaces()), [](const auto& p) { return p.param.name; });

}  // namespace
}  // namespace woodcock::testing
