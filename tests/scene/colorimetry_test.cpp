#include "renderer/scene/colorimetry.h"

#include <gmock/gmock.h>

#include <cmath>

#include "renderer/scene/scattering_presets.h"
#include "tests/scene/scene_folder.h"

namespace woodcock {
namespace {

void expect_rgb(Rgb found, Rgb expected, float tolerance) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], expected[c], tolerance) << "channel " << c;
}

TEST(Colorimetry, BlackbodyLightHasPbrtsChromaticityAndLuminanceOne) {
  expect_rgb(blackbody_rgb(3000), Rgb(1.77f, 0.84f, 0.27f), 0.015f);
  EXPECT_NEAR(luminance(blackbody_rgb(5000)), 1, 2e-3f);
  EXPECT_EQ(blackbody_rgb(0), Rgb(0));
  EXPECT_EQ(blackbody_rgb(-5), Rgb(0));
}

TEST(Colorimetry, DaylightIsNearlyWhite) { expect_rgb(blackbody_rgb(6504), Rgb(1), 0.05f); }

TEST(Colorimetry, TemperatureGridsAreAboutAHundredTimesBrighter) {
  // pbrt-v4 renders 97 as the mean of the channels; luminance is ∫ B ȳ.
  EXPECT_NEAR(average(blackbody_emission(6500)), 97, 1);
  EXPECT_NEAR(luminance(blackbody_emission(6500)), 94.66f, 0.1f);
  EXPECT_EQ(blackbody_emission(100), Rgb(0));
  EXPECT_EQ(blackbody_emission(-1), Rgb(0));
  EXPECT_EQ(blackbody_emission(std::nanf("")), Rgb(0));
}

TEST(Colorimetry, EmissionTableMatchesTheIntegral) {
  for (const float kelvin : {800.0f, 1234.5f, 2000.0f, 3333.0f, 6500.0f, 20000.0f, 1e5f}) {
    // The luminance follows from the normalised projection and the table's own chromaticity.
    const Rgb emission = blackbody_emission(kelvin);
    const Rgb chromaticity = blackbody_rgb(kelvin);
    const double y = luminance(emission) / luminance(chromaticity);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(emission[c], y * chromaticity[c], 3e-4 * luminance(emission)) << kelvin << " K, channel " << c;
  }
}

// Above some 5200 K a blackbody of peak 1 gets darker again, as its peak leaves the visible.
TEST(Colorimetry, EmissionRisesWithTemperatureWithoutSteps) {
  float last = 0;
  for (float kelvin = 600; kelvin < 4500; kelvin *= 1.0007f) {
    const float y = luminance(blackbody_emission(kelvin));
    EXPECT_GT(y, last * 0.9999f) << kelvin;
    if (last > 0) {
      EXPECT_LT(y, last * 1.05f) << kelvin;
    }
    last = y;
  }
}

TEST(Colorimetry, PlancksLawHasPeakOne) {
  EXPECT_NEAR(normalized_planck(2.897771955e6 / 5000, 5000), 1, 1e-12);
  EXPECT_LT(normalized_planck(400, 5000), 1);
  EXPECT_EQ(normalized_planck(400, 10), 0);
}

TEST(Colorimetry, ConstantSpectraAreExactlyGrey) {
  const SampledSpectrum constant{{400, 0.37}, {500, 0.37}, {800, 0.37}};
  EXPECT_EQ(project(constant, SpectrumUse::kReflectance), Rgb(0.37f));
  EXPECT_EQ(project(constant, SpectrumUse::kUnbounded), Rgb(0.37f));
}

TEST(Colorimetry, ProjectionIsContinuousAtConstants) {
  const SampledSpectrum nearly{{400, 0.5}, {800, 0.500001}};
  expect_rgb(project(nearly, SpectrumUse::kUnbounded), Rgb(0.5f), 1e-5f);
}

TEST(Colorimetry, LongWavelengthsAreRed) {
  const Rgb red = project({{380, 0}, {600, 0}, {610, 1}, {780, 1}}, SpectrumUse::kReflectance);
  EXPECT_GT(red.r, 0.5f);
  EXPECT_LT(red.g, 0.1f);
  EXPECT_GE(red.b, 0);
  EXPECT_LE(red.r, 1);
}

TEST(Colorimetry, StandardIlluminantsAreWhereTheyBelong) {
  EXPECT_EQ(*named_illuminant("stdillum-D65"), Rgb(1));
  // Illuminant A is a blackbody of 2856 K.
  expect_rgb(*named_illuminant("stdillum-A"), blackbody_rgb(2856), 0.01f);
  EXPECT_FALSE(named_illuminant("stdillum-Z").has_value());
  for (const std::string& name : named_spectra())
    EXPECT_TRUE(named_illuminant(name) || named_glass(name) || named_coefficient(name)) << name;
}

TEST(Colorimetry, NormalIncidenceReflectanceOfMetalsIsPlausible) {
  const auto reflectance = [](const char* metal) {
    const Rgb eta = *named_coefficient(std::string("metal-") + metal + "-eta"),
              k = *named_coefficient(std::string("metal-") + metal + "-k");
    return ((eta - 1.0f) * (eta - 1.0f) + k * k) / ((eta + 1.0f) * (eta + 1.0f) + k * k);
  };
  const Rgb silver = reflectance("Ag"), gold = reflectance("Au"), copper = reflectance("Cu"), aluminium = reflectance("Al");
  EXPECT_GT(silver.b, 0.85f);
  EXPECT_GT(gold.r, gold.g);
  EXPECT_GT(gold.g, gold.b);
  EXPECT_GT(copper.r, 0.9f);
  EXPECT_LT(copper.b, 0.65f);
  EXPECT_NEAR(aluminium.g, 0.92f, 0.02f);
}

TEST(Colorimetry, RgbOfALightIsThatRgbAndOtherSpectraHaveLuminanceOne) {
  const auto intensity = [](const std::string& parameters) {
    return std::get<PointLightDescription>(read_world("LightSource \"point\" " + parameters).lights[0].kind).intensity;
  };
  EXPECT_EQ(intensity("\"rgb I\" [2 3 4]"), Rgb(2, 3, 4));
  EXPECT_EQ(intensity(""), Rgb(1));
  EXPECT_EQ(intensity("\"spectrum I\" \"stdillum-D65\" \"float scale\" 5"), Rgb(5));
  expect_rgb(intensity("\"blackbody I\" 3000 \"float scale\" 10"), 10.0f * blackbody_rgb(3000), 1e-4f);
  EXPECT_NEAR(luminance(intensity("\"spectrum I\" [400 7 700 7]")), 1, 2e-3f);
}

TEST(Colorimetry, SpectrumFilesAreRead) {
  const SceneFolder folder;
  folder.write("flat.spd", "# wavelength value\n400 .25\n700 .25\n");
  const SceneDescription scene = folder.read("WorldBegin Material \"diffuse\" \"spectrum reflectance\" \"flat.spd\" Shape \"sphere\"");
  EXPECT_EQ(std::get<DiffuseDescription>(scene.materials[static_cast<size_t>(scene.shapes[0].material)].kind).reflectance.value,
            Rgb(0.25f));
  EXPECT_EQ(scene.files.size(), 2u);
}

TEST(Subsurface, AlbedoInvertsTheDiffuseReflectance) {
  EXPECT_NEAR(albedo_from_diffuse_reflectance(0, 1.33f, 0), 0, 1e-6f);
  EXPECT_NEAR(albedo_from_diffuse_reflectance(1, 1.33f, 0), 1, 1e-6f);
  float last = 0;
  for (float r = 0.05f; r < 1; r += 0.05f) {
    const float albedo = albedo_from_diffuse_reflectance(r, 1.33f, 0);
    EXPECT_GT(albedo, last);
    EXPECT_LT(albedo, 1);
    last = albedo;
    // Forward scattering needs more scattering for the same look: α′ = (1-g)α/(1-gα).
    const float forward = albedo_from_diffuse_reflectance(r, 1.33f, 0.8f);
    EXPECT_NEAR((1 - 0.8f) * forward / (1 - 0.8f * forward), albedo, 1e-4f);
  }
}

}  // namespace
}  // namespace woodcock
