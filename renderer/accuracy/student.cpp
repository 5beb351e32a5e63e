#include "renderer/accuracy/student.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace woodcock {

namespace {

/// The regularised incomplete beta function I_x(a, b) by its continued fraction (NIST DLMF 8.17.22), evaluated with
/// the modified Lentz method; it converges fast for x < (a + 1)/(a + b + 2).
double beta_fraction(double x, double a, double b) {
  constexpr double kTiny = 1e-300;
  const auto guard = [](double v) { return std::abs(v) < kTiny ? kTiny : v; };
  double c = 1, d = 1 / guard(1 - (a + b) * x / (a + 1)), h = d;
  for (int m = 1; m < 10000; ++m) {
    const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
    d = 1 / guard(1 + even * d);
    c = guard(1 + even / c);
    h *= d * c;
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
    d = 1 / guard(1 + odd * d);
    c = guard(1 + odd / c);
    h *= d * c;
    if (std::abs(d * c - 1) < std::numeric_limits<double>::epsilon()) break;
  }
  const double log_front = a * std::log(x) + b * std::log1p(-x) - (std::lgamma(a) + std::lgamma(b) - std::lgamma(a + b));
  return std::exp(log_front) * h / a;
}

/// P(|T| > |t|) = I_x(ν/2, 1/2) with x = ν/(ν + t²).
double two_tails(double t, double degrees) {
  const double square = t * t;
  if (square == 0) return 1;
  const double x = degrees / (degrees + square), a = degrees / 2, b = 0.5;
  if (x < (a + 1) / (a + b + 2)) return beta_fraction(x, a, b);
  return 1 - beta_fraction(square / (degrees + square), b, a);
}

}  // namespace

double student_cdf(double t, double degrees) {
  const double tail = 0.5 * two_tails(t, degrees);
  return t > 0 ? 1 - tail : tail;
}

double student_quantile(double probability, double degrees) {
  if (!(probability > 0 && probability < 1) || !(degrees >= 1))
    throw std::domain_error("Student's t: probability outside (0, 1) or less than one degree of freedom");
  if (probability == 0.5) return 0;
  // The tail falls with t: bracket it, then halve the bracket until it is one step of double wide.
  const double tail = 2 * std::min(probability, 1 - probability);
  double low = 0, high = 1;
  while (two_tails(high, degrees) > tail) high *= 2;
  for (double middle = 0.5 * (low + high); middle > low && middle < high; middle = 0.5 * (low + high))
    (two_tails(middle, degrees) > tail ? low : high) = middle;
  return probability < 0.5 ? -high : high;
}

}  // namespace woodcock
