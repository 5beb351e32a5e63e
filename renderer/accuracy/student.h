// Student's t distribution.
#pragma once

namespace woodcock {

/// The t of a two-sided interval of 95 % of the normal distribution, which is that of very many degrees of freedom.
inline constexpr double kNormal95 = 1.959963984540054;

/// P(T ≤ t) for `degrees` ≥ 1 degrees of freedom; relative error of the smaller tail about 1e-13.
double student_cdf(double t, double degrees);

/// The t with P(T ≤ t) = `probability`, in (0, 1). Throws std::domain_error outside, or for degrees < 1.
double student_quantile(double probability, double degrees);

}  // namespace woodcock
