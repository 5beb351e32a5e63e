// The list of exact values against closed forms evaluated here, and the errors that sampled grids add.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/statistical/adding_doubling.h"
#include "tests/statistical/reference_cases.h"
#include "tests/statistical/reference_scenes.h"

namespace woodcock::reference {
namespace {

const std::vector<Case>& cases() {
  static const std::vector<Case> list = read_cases(WOODCOCK_SOURCE_DIR "/tests/statistical/cases.json");
  return list;
}

const Case& find(const std::string& id) {
  for (const Case& c : cases())
    if (c.id == id) return c;
  throw std::out_of_range(id);
}

double simpson(double a, double b, int n, const auto& f) {
  const double h = (b - a) / n;
  double sum = f(a) + f(b);
  for (int i = 1; i < n; ++i) sum += (i % 2 ? 4 : 2) * f(a + i * h);
  return sum * h / 3;
}

TEST(ReferenceValues, TransmittanceThroughAHomogeneousMediumIsExponential) {
  const Case& c = find("P06");
  EXPECT_NEAR(c.expected.at(""), std::exp(-c.get("sigma_t") * c.get("length")), 1e-15);
}

TEST(ReferenceValues, TransmittanceThroughAnExponentialProfileIsTheClosedForm) {
  const Case& c = find("P07");
  const double h = c.get("h"), z0 = c.get("z0"), dz = c.get("dz");
  const double depth = c.get("rho0") * h / dz * (std::exp(-z0 / h) - std::exp(-(z0 + dz * c.get("length")) / h));
  EXPECT_NEAR(c.expected.at(""), std::exp(-depth), 1e-15);
}

TEST(ReferenceValues, TransmittanceThroughAGaussianBlobIsTheClosedForm) {
  const Case& c = find("P08");
  const double s = c.get("sigma"), b = c.get("b");
  const double depth = c.get("rho0") * s * std::sqrt(2 * std::numbers::pi) * std::exp(-b * b / (2 * s * s));
  EXPECT_NEAR(c.expected.at(""), std::exp(-depth), 1e-15);
}

TEST(ReferenceValues, AnEmittingAbsorbingSlabApproachesItsSource) {
  const Case& c = find("P09");
  EXPECT_NEAR(c.expected.at(""), -c.get("B") * std::expm1(-c.get("tau")), 1e-14);
}

TEST(ReferenceValues, AnEmittingAbsorbingSphereAddsToItsBackground) {
  const Case& c = find("P10");
  const double chord = 2 * std::sqrt(c.get("R") * c.get("R") - c.get("b") * c.get("b")), depth = c.get("sigma_a") * chord;
  EXPECT_NEAR(c.expected.at(""), -c.get("B") * std::expm1(-depth) + c.get("L0") * std::exp(-depth), 1e-14);
}

TEST(ReferenceValues, ALosslessMediumInAFurnaceIsInvisible) { EXPECT_EQ(find("P11").expected.at(""), 1.0); }

TEST(ReferenceValues, AHalfSpaceReflectsByChandrasekharsH) {
  // H(μ) = 1 / (√(1−a) + (a/2) ∫₀¹ x H(x)/(x + μ) dx), iterated (Chandrasekhar 1960, Radiative Transfer, §41).
  const Case& c = find("P13");
  constexpr int kNodes = 400;
  const double a = c.get("albedo");
  std::vector<double> h(kNodes, 1.0);
  const auto evaluate = [&](double mu) {
    double sum = 0;
    for (int i = 0; i < kNodes; ++i) {
      const double x = (i + 0.5) / kNodes;
      sum += x * h[static_cast<size_t>(i)] / (x + mu) / kNodes;
    }
    return 1 / (std::sqrt(1 - a) + 0.5 * a * sum);
  };
  for (int turn = 0; turn < 40; ++turn) {
    std::vector<double> next(kNodes);
    for (int i = 0; i < kNodes; ++i) next[static_cast<size_t>(i)] = evaluate((i + 0.5) / kNodes);
    h = next;
  }
  EXPECT_NEAR(c.expected.at(""), 1 - evaluate(c.get("mu")) * std::sqrt(1 - a), 1e-5);
}

TEST(ReferenceValues, SlabsAreWhatAddingDoublingGives) {
  for (const char* id : {"P01", "P02", "P03", "P04", "P05", "P13"}) {
    const Case& c = find(id);
    const SlabValues values = adding_doubling({c.get("tau"), c.get("albedo"), c.get("g"), c.get("n"), c.get("mu")});
    const bool both = c.expected.contains("R");
    EXPECT_NEAR(c.expected.at(both ? "R" : ""), values.reflectance, 2e-6) << id;
    if (both) {
      EXPECT_NEAR(c.expected.at("T"), values.transmittance, 2e-6) << id;
    }
  }
}

TEST(ReferenceValues, AirlightIsTheSingleScatteringIntegral) {
  const Case& c = find("P14");
  const double h = c.get("h"), s0 = c.get("s0"), sigma_t = c.get("sigma_t");
  const double radiance = simpson(0, 80, 20000, [&](double s) {
    const double r2 = h * h + (s - s0) * (s - s0);
    return c.get("sigma_s") / (4 * std::numbers::pi) * c.get("I") * std::exp(-sigma_t * (s + std::sqrt(r2))) / r2;
  });
  EXPECT_NEAR(c.expected.at(""), radiance, c.uncertainty + 1e-10);
}

TEST(ReferenceValues, AClosedRoomSumsAGeometricSeries) {
  const Case& c = find("P15");
  EXPECT_EQ(c.expected.at(""), c.get("E") / (1 - c.get("a")));
}

TEST(ReferenceScenes, SampledGridsChangeTransmittanceByLessThanAHundredThousandth) {
  const Case &p07 = find("P07"), &p08 = find("P08");
  EXPECT_NEAR(interpolated_profile_transmittance(p07) / p07.expected.at(""), 1, 1e-5);
  EXPECT_NEAR(interpolated_blob_transmittance(p08) / p08.expected.at(""), 1, 1e-5);
}

TEST(ReferenceScenes, EveryValueOfEveryCaseHasAScene) {
  for (const Case& c : cases()) {
    const std::vector<Scene> scenes = scenes_of(c);
    for (const auto& [value, expected] : c.expected)
      EXPECT_THAT(scenes, testing::Contains(testing::Field(&Scene::expected, testing::Eq(expected)))) << c.id << " " << value;
  }
}

}  // namespace
}  // namespace woodcock::reference
