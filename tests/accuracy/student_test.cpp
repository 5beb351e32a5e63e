#include "renderer/accuracy/student.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace woodcock {
namespace {

TEST(Student, QuantilesAreThoseOfThePrintedTables) {
  // Two-sided 95 % and 99 %, as tabulated to three decimals or more.
  EXPECT_NEAR(student_quantile(0.975, 1), 12.7062, 5e-5);
  EXPECT_NEAR(student_quantile(0.975, 2), 4.30265, 5e-6);
  EXPECT_NEAR(student_quantile(0.975, 7), 2.36462, 5e-6);
  EXPECT_NEAR(student_quantile(0.975, 30), 2.04227, 5e-6);
  EXPECT_NEAR(student_quantile(0.975, 1e6), 1.95997, 5e-6);
  EXPECT_NEAR(student_quantile(0.995, 7), 3.49948, 5e-6);
  EXPECT_NEAR(student_quantile(0.95, 7), 1.89458, 5e-6);
}

TEST(Student, OneAndTwoDegreesHaveClosedForms) {
  for (const double t : {-40.0, -1.0, -0.01, 0.0, 0.3, 2.0, 1000.0}) {
    EXPECT_NEAR(student_cdf(t, 1), 0.5 + std::atan(t) / 3.14159265358979323846, 1e-13);
    EXPECT_NEAR(student_cdf(t, 2), 0.5 + t / (2 * std::sqrt(2 + t * t)), 1e-13);
  }
}

TEST(Student, QuantileInvertsTheDistributionAndIsSymmetric) {
  for (const double degrees : {1.0, 3.0, 7.0, 100.0})
    for (const double p : {1e-6, 0.01, 0.3, 0.5, 0.9, 0.999}) {
      EXPECT_NEAR(student_cdf(student_quantile(p, degrees), degrees), p, 1e-12 + 1e-10 * p);
      EXPECT_NEAR(student_quantile(p, degrees), -student_quantile(1 - p, degrees), 1e-6 * std::abs(student_quantile(p, degrees)));
    }
}

TEST(Student, RefusesWhatIsNoProbability) {
  EXPECT_THROW(student_quantile(1, 7), std::domain_error);
  EXPECT_THROW(student_quantile(0, 7), std::domain_error);
  EXPECT_THROW(student_quantile(0.5, 0), std::domain_error);
}

}  // namespace
}  // namespace woodcock
