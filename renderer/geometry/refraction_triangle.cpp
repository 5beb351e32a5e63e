#include "renderer/geometry/refraction_triangle.h"

#include <algorithm>
#include <cmath>

namespace woodcock {
namespace {

/// The root T ≥ 0 of a T + b T/√(k² + (k² − 1) T²) = d, for k ≥ 1, from a guess.
double larger_tangent(double a, double b, double k, double d, double guess) {
  const double m = (k - 1) * (k + 1), k2 = k * k;
  // Two lines that lie nowhere below the left side.
  double least = d / (a + b / k);
  if (m > 0) least = std::max(least, (d - b / std::sqrt(m)) / a);
  double t = std::max(least, guess);
  for (int i = 0; i < 30; ++i) {
    const double s = 1 / (k2 + m * t * t), root = std::sqrt(s);
    const double next = std::max(least, t + (d - (a + b * root) * t) / (a + b * k2 * s * root)), step = std::abs(next - t);
    t = next;
    // The error of the next step is of the size of the square of this one.
    if (!(step > 0x1p-28 * t)) break;
  }
  return t;
}

}  // namespace

std::optional<RefractedWay> way_through_plane(DVec3 p0, DVec3 n, double eta, DVec3 x, DVec3 y, double larger_sine) {
  const double h = glm::dot(n, p0 - x), h_out = glm::dot(n, y - p0);
  if (!(h > 0 && h_out > 0)) return std::nullopt;
  DVec3 along = y - x;
  along -= glm::dot(along, n) * n;
  const double d = glm::length(along);
  double tan_i = 0, tan_t = 0;
  if (d > 0) {
    along /= d;
    const double guess = larger_sine < 1 ? larger_sine / std::sqrt((1 - larger_sine) * (1 + larger_sine)) : 0;
    if (eta > 1) {
      tan_t = larger_tangent(h_out, h, eta, d, guess);
      tan_i = tan_t / std::sqrt(eta * eta + (eta - 1) * (eta + 1) * tan_t * tan_t);
    } else {
      const double k = 1 / eta;
      tan_i = larger_tangent(h, h_out, k, d, guess);
      tan_t = tan_i / std::sqrt(k * k + (k - 1) * (k + 1) * tan_i * tan_i);
    }
  }
  RefractedWay way;
  way.cos_i = 1 / std::sqrt(1 + tan_i * tan_i);
  way.cos_t = 1 / std::sqrt(1 + tan_t * tan_t);
  way.v = x + h * n + h * tan_i * along;
  way.wi = way.cos_i * (n + tan_i * along);
  way.wo = way.cos_t * (n + tan_t * along);
  const double inner = way.cos_i, outer = way.cos_t;
  way.solid_angle_per_area =
      1 / ((h / inner + eta * h_out / outer) * (h * outer / (inner * inner) + eta * h_out * inner / (outer * outer)));
  return way;
}

RefractionStep refraction_step(const ShadedTriangle& triangle, DVec2 b, double eta, DVec3 x, DVec3 y) {
  RefractionStep result;
  RefractedWay& way = result.way;
  way.v = triangle.at(b);
  const DVec3 in = way.v - x, out = y - way.v;
  const double r_in = glm::length(in), r_out = glm::length(out);
  way.wi = in / r_in;
  way.wo = out / r_out;
  const DVec3 unscaled = (1 - b.x - b.y) * triangle.normals[0] + b.x * triangle.normals[1] + b.y * triangle.normals[2];
  const double length = glm::length(unscaled);
  const DVec3 n = unscaled / length;
  way.cos_i = glm::dot(way.wi, n);
  way.cos_t = glm::dot(way.wo, n);
  result.crosses = way.cos_i > 0 && way.cos_t > 0 && glm::dot(way.wi, triangle.ng) > 0 && glm::dot(way.wo, triangle.ng) > 0 &&
                   glm::dot(n, triangle.ng) > 0;

  const DVec3 h = eta * way.wi - way.wo;
  const double nh = glm::dot(n, h);
  result.error = glm::length(h - nh * n);
  const DVec3 e[2] = {triangle.e1, triangle.e2};
  const double en[2] = {glm::dot(e[0], n), glm::dot(e[1], n)};
  const DVec2 c(glm::dot(e[0], h) - en[0] * nh, glm::dot(e[1], h) - en[1] * nh);
  double by_b[2][2];
  for (int j = 0; j < 2; ++j) {
    const DVec3 dh = eta * (e[j] - glm::dot(e[j], way.wi) * way.wi) / r_in + (e[j] - glm::dot(e[j], way.wo) * way.wo) / r_out;
    const DVec3 turn = (triangle.normals[static_cast<size_t>(j + 1)] - triangle.normals[0]) / length, dn = turn - glm::dot(turn, n) * n;
    const double dnh = glm::dot(dn, h) + glm::dot(n, dh);
    for (int k = 0; k < 2; ++k) by_b[k][j] = glm::dot(e[k], dh) - glm::dot(e[k], dn) * nh - en[k] * dnh;
  }
  const double det = by_b[0][0] * by_b[1][1] - by_b[0][1] * by_b[1][0];
  result.step = -DVec2(by_b[1][1] * c.x - by_b[0][1] * c.y, by_b[0][0] * c.y - by_b[1][0] * c.x) / det;

  const DVec3 p = glm::normalize(glm::cross(way.wo, std::abs(way.wo.x) < 0.5 ? DVec3(1, 0, 0) : DVec3(0, 1, 0))), q = glm::cross(way.wo, p);
  const auto by_y = [&](int k, DVec3 w) { return (glm::dot(e[k], w) - en[k] * glm::dot(n, w)) / r_out; };
  const double det_y = by_y(0, p) * by_y(1, q) - by_y(0, q) * by_y(1, p);
  way.solid_angle_per_area = std::abs(glm::dot(way.wi, triangle.ng) * det_y / det) * glm::length(glm::cross(e[0], e[1])) / (r_in * r_in);
  return result;
}

}  // namespace woodcock
