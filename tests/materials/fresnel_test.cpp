// Fresnel's equations against the textbook form in long double, and at their limits.
#include "renderer/materials/fresnel.h"

#include <gtest/gtest.h>

#include <complex>

namespace woodcock {
namespace {

long double reference_conductor(long double c, long double eta, long double k) {
  using Complex = std::complex<long double>;
  const Complex n(eta, k), ct = std::sqrt(Complex(1) - Complex(1 - c * c) / (n * n));
  const Complex rp = (n * c - ct) / (n * c + ct), rs = (c - n * ct) / (c + n * ct);
  return (std::norm(rp) + std::norm(rs)) / 2;
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
