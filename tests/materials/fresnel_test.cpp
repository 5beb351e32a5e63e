// Fresnel's equations against the textbook form in long double, and at their limits.
#include "renderer/materials/fresnel.h"

#include <gtest/gtest.h>

#include <complex>

namespace woodcock {
namespace {

/// The textbook form, in 64-bit mantissas.
long double reference_dielectric(long double c, long double eta) {
  const long double sin2 = (1 - c * c) / (eta * eta);
  if (sin2 >= 1) return 1;
  const long double ct = std::sqrt(1 - sin2);
  const long double rp = (eta * c - ct) / (eta * c + ct), rs = (c - eta * ct) / (c + eta * ct);
  return (rp * rp + rs * rs) / 2;
}

long double reference_conductor(long double c, long double eta, long double k) {
  using Complex = std::complex<long double>;
  const Complex n(eta, k), ct = std::sqrt(Complex(1) - Complex(1 - c * c) / (n * n));
  const Complex rp = (n * c - ct) / (n * c + ct), rs = (c - n * ct) / (c + n * ct);
  return (std::norm(rp) + std::norm(rs)) / 2;
}

// N32
TEST(Fresnel, KeepsItsDigitsForIndicesNearOneAndAtGrazingAngles) {
  for (const float eta : {0.4f, 0.7f, 0.999f, 0.99999f, 1.0000001f, 1.00001f, 1.001f, 1.33f, 1.5f, 2.4f, 10.0f})
    for (const float c : {1.0f, 0.999f, 0.7f, 0.5f, 0.1f, 0.01f, 1e-3f, 1e-5f}) {
      const long double expected = reference_dielectric(c, eta);
      // One ulp of cos θ or eta moves the result by more than this only within a hair of the critical angle.
      if (expected > 0.9L && expected < 1 && eta < 1) continue;
      EXPECT_NEAR(static_cast<double>(fresnel_dielectric(c, eta)), static_cast<double>(expected),
                  2e-6 * static_cast<double>(expected) + 1e-20)
          << "eta " << eta << " cos " << c;
    }
}

// N16, N32
TEST(Fresnel, AnIndexOfOneReflectsExactlyNothing) {
  for (const float c : {0.0f, 1e-30f, 1e-6f, 0.3f, 1.0f}) EXPECT_EQ(fresnel_dielectric(c, 1), 0);
}

TEST(Fresnel, GrazingLightIsReflectedEntirely) {
  for (const float eta : {0.5f, 0.999f, 1.0000001f, 1.5f, 3.0f}) {
    EXPECT_EQ(fresnel_dielectric(0, eta), 1) << eta;
    EXPECT_GT(fresnel_dielectric(1e-8f, eta), 0.99f) << eta;
  }
  EXPECT_EQ(fresnel_conductor(0, 0.2f, 3.9f), 1);
}

TEST(Fresnel, NormalIncidenceHasItsClosedForm) {
  for (const float eta : {0.5f, 1.5f, 2.0f})
    EXPECT_NEAR(fresnel_dielectric(1, eta), (eta - 1) * (eta - 1) / ((eta + 1) * (eta + 1)), 1e-7f);
}

TEST(Fresnel, TotalReflectionBeginsAtTheCriticalAngle) {
  const float eta = 1 / 1.5f, critical = std::sqrt(1 - eta * eta);
  EXPECT_EQ(fresnel_dielectric(critical * 0.999f, eta), 1);
  EXPECT_LT(fresnel_dielectric(critical * 1.001f, eta), 1);
}

TEST(Fresnel, BothDirectionsThroughABoundaryReflectAlike) {
  for (const float c : {0.9f, 0.5f, 0.2f}) {
    const float eta = 1.5f, inside = std::sqrt(1 - (1 - c * c) / (eta * eta));
    EXPECT_NEAR(fresnel_dielectric(c, eta), fresnel_dielectric(inside, 1 / eta), 1e-6f);
  }
}

TEST(Fresnel, ConductorsMatchTheComplexForm) {
  for (const float eta : {0.05f, 0.2f, 1.0f, 1.5f, 4.0f})
    for (const float k : {0.0f, 1e-4f, 0.5f, 3.9f, 200.0f})
      for (const float c : {1.0f, 0.8f, 0.3f, 0.01f}) {
        const double expected = static_cast<double>(reference_conductor(c, eta, k));
        EXPECT_NEAR(static_cast<double>(fresnel_conductor(c, eta, k)), expected, 1e-6) << eta << " + " << k << "i, cos " << c;
      }
}

TEST(Fresnel, StaysBetweenZeroAndOneForEveryInput) {
  for (const float eta : {0.0f, 1e-10f, 1.0f, 1e10f})
    for (const float k : {0.0f, 1e-10f, 1.0f, 1e10f})
      for (const float c : {0.0f, 1e-20f, 0.5f, 1.0f, 1.0000001f}) {
        const float r = fresnel_conductor(c, eta, k);
        EXPECT_TRUE(r >= 0 && r <= 1) << eta << " " << k << " " << c << ": " << r;
      }
}

}  // namespace
}  // namespace woodcock
