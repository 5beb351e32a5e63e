// Pearson's χ² test of directions against the density they were drawn from.
//
// The sphere is cut into cells uniform in (z, φ); the density is integrated over each cell by adaptive Gauss
// quadrature and compared with the number of directions that fell there. What the density does not
// account for (a sampler may draw nothing, or a delta) is one more cell, so a density that does not integrate to the
// right total is found too.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "renderer/core/vec.h"

namespace woodcock::testing {

/// Q(a, x) = Γ(a, x)/Γ(a), the regularised upper incomplete gamma function, for a > 0, x ≥ 0: series below a + 1,
/// Lentz's continued fraction above.
inline double gamma_q(double a, double x) {
  if (!(x > 0)) return 1;
  const double log_front = a * std::log(x) - x - std::lgamma(a);
  if (x < a + 1) {
    double term = 1 / a, sum = term;
    for (int n = 1; n < 10000 && term > sum * 1e-16; ++n) {
      term *= x / (a + n);
      sum += term;
    }
    return 1 - sum * std::exp(log_front);
  }
  constexpr double kTiny = 1e-300;
  double b = x + 1 - a, c = 1 / kTiny, d = 1 / b, h = d;
  for (int n = 1; n < 10000; ++n) {
    const double an = -n * (n - a);
    b += 2;
    d = an * d + b;
    if (std::abs(d) < kTiny) d = kTiny;
    c = b + an / c;
    if (std::abs(c) < kTiny) c = kTiny;
    d = 1 / d;
    const double step = c * d;
    h *= step;
    if (std::abs(step - 1) < 1e-15) break;
  }
  return h * std::exp(log_front);
}

/// The probability of a χ² at least this large with so many degrees of freedom.
inline double chi_square_p_value(double statistic, int degrees) { return degrees < 1 ? 1 : gamma_q(0.5 * degrees, 0.5 * statistic); }

/// A direction from cylindrical coordinates of the unit sphere.
inline Vec3 direction_at(double z, double phi) {
  const double r = std::sqrt(std::fmax(0.0, (1 - z) * (1 + z)));
  return {static_cast<float>(r * std::cos(phi)), static_cast<float>(r * std::sin(phi)), static_cast<float>(z)};
}

inline constexpr int kMaxHalvings = 9;

/// ∫ f(w) dw over z0 < z < z1, φ0 < φ < φ1 (the area element of the sphere is dz dφ), to about `tolerance`. The first two
/// halvings are made in any case: a density may be zero in all but a corner.
template <typename Function>
double integrate_cell(const Function& f, double z0, double z1, double phi0, double phi1, double tolerance, int depth = kMaxHalvings) {
  // Three-point Gauss-Legendre in each variable.
  static constexpr std::array<double, 3> kNode{-0.7745966692414834, 0.0, 0.7745966692414834};
  static constexpr std::array<double, 3> kWeight{5.0 / 9, 8.0 / 9, 5.0 / 9};
  const auto rule = [&](double za, double zb, double pa, double pb) {
    double sum = 0;
    for (size_t i = 0; i < 3; ++i)
      for (size_t j = 0; j < 3; ++j)
        sum += kWeight[i] * kWeight[j] *
               static_cast<double>(
                   f(direction_at(0.5 * (za + zb) + 0.5 * (zb - za) * kNode[i], 0.5 * (pa + pb) + 0.5 * (pb - pa) * kNode[j])));
    return sum * 0.25 * (zb - za) * (pb - pa);
  };
  const double zm = 0.5 * (z0 + z1), pm = 0.5 * (phi0 + phi1);
  const double coarse = rule(z0, z1, phi0, phi1);
  const double fine = rule(z0, zm, phi0, pm) + rule(zm, z1, phi0, pm) + rule(z0, zm, pm, phi1) + rule(zm, z1, pm, phi1);
  if (depth == 0 || (depth <= kMaxHalvings - 2 && std::abs(fine - coarse) < tolerance)) return fine;
  return integrate_cell(f, z0, zm, phi0, pm, tolerance, depth - 1) + integrate_cell(f, zm, z1, phi0, pm, tolerance, depth - 1) +
         integrate_cell(f, z0, zm, pm, phi1, tolerance, depth - 1) + integrate_cell(f, zm, z1, pm, phi1, tolerance, depth - 1);
}

/// ∫ f over the sphere.
template <typename Function>
double integrate_sphere(const Function& f, int z_cells = 16, int phi_cells = 16, double tolerance = 1e-6) {
  double sum = 0;
  for (int i = 0; i < z_cells; ++i)
    for (int j = 0; j < phi_cells; ++j)
      sum += integrate_cell(f, -1 + 2.0 * i / z_cells, -1 + 2.0 * (i + 1) / z_cells, 2 * M_PI * j / phi_cells,
                            2 * M_PI * (j + 1) / phi_cells, tolerance);
  return sum;
}

struct ChiSquareOptions {
  int64_t samples = 200000;
  int z_cells = 20;  ///< even, so that no cell straddles the horizon z = 0
  int phi_cells = 20;
};

struct ChiSquareResult {
  double statistic = 0;
  int degrees = 0;
  double p_value = 1;
  double total = 0;  ///< ∫ pdf
  int64_t none = 0;  ///< draws without a direction

  std::string describe() const {
    std::ostringstream out;
    out << "chi2 " << statistic << " with " << degrees << " degrees of freedom, p = " << p_value << ", integral of the density " << total
        << ", " << none << " draws without a direction";
    return out.str();
  }
};

/// `draw()` gives std::optional<Vec3> (empty: nothing, or a delta, was drawn), `density(w)` its density per solid
/// angle. A right sampler fails a test `p_value > a` with probability a.
template <typename Draw, typename Density>
ChiSquareResult chi_square_sphere(Draw&& draw, Density&& density, const ChiSquareOptions& options = {}) {
  const size_t rows = static_cast<size_t>(options.z_cells), columns = static_cast<size_t>(options.phi_cells);
  std::vector<double> observed(rows * columns + 1, 0), expected(rows * columns + 1, 0);
  ChiSquareResult result;
  for (int64_t n = 0; n < options.samples; ++n) {
    const std::optional<Vec3> w = draw();
    if (!w) {
      ++result.none;
      observed.back() += 1;
      continue;
    }
    double phi = std::atan2(static_cast<double>(w->y), static_cast<double>(w->x));
    if (phi < 0) phi += 2 * M_PI;
    const size_t row = std::min(rows - 1, static_cast<size_t>(0.5 * (static_cast<double>(w->z) + 1) * options.z_cells));
    const size_t column = std::min(columns - 1, static_cast<size_t>(phi / (2 * M_PI) * options.phi_cells));
    observed[row * columns + column] += 1;
  }
  const double count = static_cast<double>(options.samples);
  for (size_t i = 0; i < rows; ++i)
    for (size_t j = 0; j < columns; ++j) {
      const double p = integrate_cell(
          density, -1 + 2.0 * static_cast<double>(i) / options.z_cells, -1 + 2.0 * static_cast<double>(i + 1) / options.z_cells,
          2 * M_PI * static_cast<double>(j) / options.phi_cells, 2 * M_PI * static_cast<double>(j + 1) / options.phi_cells, 0.01 / count);
      expected[i * columns + j] = p * count;
      result.total += p;
    }
  expected.back() = std::fmax(0.0, 1 - result.total) * count;
  // Cells that expect fewer than five are pooled, in order, until they do not.
  double pooled_expected = 0, pooled_observed = 0;
  int cells = 0;
  const auto add = [&](double e, double o) {
    result.statistic += (o - e) * (o - e) / e;
    ++cells;
  };
  for (size_t i = 0; i < expected.size(); ++i) {
    if (expected[i] >= 5) {
      add(expected[i], observed[i]);
      continue;
    }
    pooled_expected += expected[i];
    pooled_observed += observed[i];
    if (pooled_expected >= 5) {
      add(pooled_expected, pooled_observed);
      pooled_expected = pooled_observed = 0;
    }
  }
  // A remainder that expects less than five counts only when it is impossible.
  if (pooled_observed > 30) add(std::fmax(pooled_expected, 1e-3), pooled_observed);
  result.degrees = cells - 1;
  // A density of more than one in all is wrong for any sampler; quadrature is good to much less than this.
  result.p_value = result.total > 1.002 ? 0 : chi_square_p_value(result.statistic, result.degrees);
  return result;
}

}  // namespace woodcock::testing
