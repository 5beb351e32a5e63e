#include "tests/statistical/adding_doubling.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

namespace woodcock::reference {
namespace {

/// A square matrix; an operator on radiances in the directions of a `Directions`.
class Matrix {
 public:
  explicit Matrix(int n) : n_(n), values_(static_cast<size_t>(n) * n) {}
  double& at(int i, int j) { return values_[static_cast<size_t>(i) * n_ + j]; }
  double at(int i, int j) const { return values_[static_cast<size_t>(i) * n_ + j]; }
  int size() const { return n_; }

  friend Matrix operator*(const Matrix& a, const Matrix& b) {
    Matrix c(a.n_);
    for (int i = 0; i < a.n_; ++i)
      for (int k = 0; k < a.n_; ++k)
        for (int j = 0; j < a.n_; ++j) c.at(i, j) += a.at(i, k) * b.at(k, j);
    return c;
  }
  friend Matrix combine(const Matrix& a, double factor, const Matrix& b) {
    Matrix c = a;
    for (size_t i = 0; i < c.values_.size(); ++i) c.values_[i] += factor * b.values_[i];
    return c;
  }

 private:
  int n_;
  std::vector<double> values_;
};

/// X with (I − A) X = B, by elimination with pivots.
Matrix solve_identity_minus(const Matrix& a, Matrix b) {
  const int n = a.size();
  Matrix m(n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) m.at(i, j) = (i == j ? 1.0 : 0.0) - a.at(i, j);
  for (int column = 0; column < n; ++column) {
    int pivot = column;
    for (int row = column + 1; row < n; ++row)
      if (std::abs(m.at(row, column)) > std::abs(m.at(pivot, column))) pivot = row;
    for (int j = 0; j < n && pivot != column; ++j) {
      std::swap(m.at(pivot, j), m.at(column, j));
      std::swap(b.at(pivot, j), b.at(column, j));
    }
    for (int row = 0; row < n; ++row) {
      if (row == column) continue;
      const double factor = m.at(row, column) / m.at(column, column);
      for (int j = column; j < n; ++j) m.at(row, j) -= factor * m.at(column, j);
      for (int j = 0; j < n; ++j) b.at(row, j) -= factor * b.at(column, j);
    }
  }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) b.at(i, j) /= m.at(i, i);
  return b;
}

/// Cosines inside the slab with quadrature weights; the last has weight 0: there the result is read.
struct Directions {
  std::vector<double> mu, weight;
};

/// Adds Gauss-Legendre nodes of a..b in x with μ = a + (b − a) x²: Fresnel's reflectance rises like a square root at
/// the critical angle `a`, and is smooth in x.
void add_gauss(Directions& directions, int n, double a, double b) {
  for (int i = 1; i <= n; ++i) {
    double x = std::cos(std::numbers::pi * (i - 0.25) / (n + 0.5)), slope = 0;
    for (int turn = 0; turn < 100; ++turn) {
      double p = 1, previous = 0;
      for (int l = 1; l <= n; ++l) previous = std::exchange(p, ((2 * l - 1) * x * p - (l - 1) * previous) / l);
      slope = n * (x * p - previous) / (x * x - 1);
      const double step = p / slope;
      x -= step;
      if (std::abs(step) < 1e-15) break;
    }
    const double y = 0.5 + 0.5 * x;
    directions.mu.push_back(a + (b - a) * y * y);
    directions.weight.push_back(2 * y * (b - a) / ((1 - x * x) * slope * slope));
  }
}

/// Σ (2l+1) gˡ P_l(μ) P_l(μ′): the phase function averaged over azimuth, normalised to ½∫ = 1.
double phase(double mu, double mu_in, double g) {
  double sum = 0, power = 1, p = 1, p_in = 1, q = 0, q_in = 0;
  for (int l = 0; l < 110; ++l) {
    sum += (2 * l + 1) * power * p * p_in;
    power *= g;
    q = std::exchange(p, ((2 * l + 1) * mu * p - l * q) / (l + 1));
    q_in = std::exchange(p_in, ((2 * l + 1) * mu_in * p_in - l * q_in) / (l + 1));
  }
  return sum;
}

/// Fresnel reflectance from inside (index n) to outside (1) at cosine μ inside.
double fresnel_inside(double mu, double n) {
  const double sin2 = n * n * (1 - mu) * (1 + mu);
  if (n == 1) return 0;
  if (sin2 >= 1) return 1;
  const double outside = std::sqrt(1 - sin2);
  const double s = (n * mu - outside) / (n * mu + outside), p = (n * outside - mu) / (n * outside + mu);
  return 0.5 * (s * s + p * p);
}

}  // namespace

SlabValues adding_doubling(const SlabCase& slab) {
  Directions directions;
  const double critical = std::sqrt(std::max(0.0, 1 - 1 / (slab.n * slab.n)));
  if (slab.n > 1) add_gauss(directions, 50, 0, critical);
  add_gauss(directions, 110, critical, 1);
  directions.mu.push_back(std::sqrt(1 - (1 - slab.mu) * (1 + slab.mu) / (slab.n * slab.n)));
  directions.weight.push_back(0);
  const int n = static_cast<int>(directions.mu.size()), view = n - 1;

  // A layer so thin that it scatters once at most, then doubled until it is the slab.
  int doublings = 0;
  double layer = slab.tau;
  for (; layer > 1e-9; ++doublings) layer *= 0.5;
  Matrix r(n), t(n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const double mu = directions.mu[static_cast<size_t>(i)], mu_in = directions.mu[static_cast<size_t>(j)];
      const double factor = slab.albedo * layer / (2 * mu) * directions.weight[static_cast<size_t>(j)];
      r.at(i, j) = factor * phase(-mu, mu_in, slab.g);
      t.at(i, j) = factor * phase(mu, mu_in, slab.g) + (i == j ? std::exp(-layer / mu) : 0.0);
    }
  for (int i = 0; i < doublings; ++i) {
    const Matrix between = solve_identity_minus(r * r, t);  // (1 − RR)⁻¹ T
    r = combine(r, 1, t * (r * between));
    t = t * between;
  }

  // Between two equal faces: with X± the sum and the difference of the radiances going into the medium at the two faces,
  // (1 − F (R ± T)) X± = S, where S is what the lit face lets in.
  Matrix x_sum(n), x_difference(n), source(n);
  for (int i = 0; i < n; ++i) source.at(i, 0) = slab.n * slab.n * (1 - fresnel_inside(directions.mu[static_cast<size_t>(i)], slab.n));
  const Matrix sum = combine(r, 1, t), difference = combine(r, -1, t);
  const auto reflected_at_face = [&](Matrix m) {
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) m.at(i, j) *= fresnel_inside(directions.mu[static_cast<size_t>(i)], slab.n);
    return m;
  };
  x_sum = sum * solve_identity_minus(reflected_at_face(sum), source);
  x_difference = difference * solve_identity_minus(reflected_at_face(difference), source);
  const double f = fresnel_inside(directions.mu.back(), slab.n), out = (1 - f) / (slab.n * slab.n);
  return {f + out * 0.5 * (x_sum.at(view, 0) + x_difference.at(view, 0)), out * 0.5 * (x_sum.at(view, 0) - x_difference.at(view, 0))};
}

}  // namespace woodcock::reference
