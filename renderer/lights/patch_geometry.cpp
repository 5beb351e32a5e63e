#include "renderer/lights/patch_geometry.h"

#include <algorithm>

namespace woodcock {

bool is_flat_and_convex(const PatchCorners& c) {
  const DVec3 normal = glm::cross(c[3] - c[0], c[2] - c[1]);  // of the diagonals
  const double length = glm::length(normal);
  const double size = std::max(glm::length(c[3] - c[0]), glm::length(c[2] - c[1]));
  if (!(length > 0)) return false;
  if (std::abs(glm::dot(c[1] - c[0], normal)) > 1e-6 * size * length) return false;
  // In a flat patch the normal is linear in (u,v), so that its sign at the corners is its sign everywhere.
  int positive = 0;
  for (const DVec2 corner : {DVec2(0, 0), DVec2(1, 0), DVec2(0, 1), DVec2(1, 1)}) positive += glm::dot(patch_normal(c, corner), normal) > 0;
  return positive == 4 || positive == 0;
}

double patch_area(const PatchCorners& c) {
  constexpr double kNode[2] = {0.3399810435848563, 0.8611363115940526}, kWeight[2] = {0.6521451548625461, 0.3478548451374538};
  constexpr int kCells = 4;
  double area = 0;
  const auto for_each_node = [&](const auto& visit) {
    for (int cell = 0; cell < kCells; ++cell)
      for (int k = 0; k < 4; ++k) {
        const double x = (k < 2 ? -1 : 1) * kNode[k % 2];
        visit((cell + 0.5 * (x + 1)) / kCells, kWeight[k % 2] / (2 * kCells));
      }
  };
  for_each_node([&](double u, double wu) {
    for_each_node([&](double v, double wv) { area += wu * wv * glm::length(patch_normal(c, {u, v})); });
  });
  return area;
}

DVec2 invert_patch(const PatchCorners& c, DVec3 p) {
  DVec2 best(0.5);
  double best_error = -1;
  // Gauss-Newton converges quadratically, as the residual vanishes; several starts are for patches that fold.
  for (const DVec2 start : {DVec2(0.5, 0.5), DVec2(0.1, 0.1), DVec2(0.9, 0.1), DVec2(0.1, 0.9), DVec2(0.9, 0.9)}) {
    DVec2 uv = start;
    for (int step = 0; step < 24; ++step) {
      const DVec3 du = patch_dpdu(c, uv.y), dv = patch_dpdv(c, uv.x), r = p - patch_point(c, uv);
      const double a = glm::dot(du, du), b = glm::dot(du, dv), d = glm::dot(dv, dv), determinant = a * d - b * b;
      if (!(determinant > 0)) break;
      const double x = glm::dot(du, r), y = glm::dot(dv, r);
      const DVec2 next = glm::clamp(uv + DVec2(d * x - b * y, a * y - b * x) / determinant, DVec2(0), DVec2(1));
      const DVec2 moved = glm::abs(next - uv);
      uv = next;
      if (std::max(moved.x, moved.y) < 1e-14) break;
    }
    const DVec3 r = p - patch_point(c, uv);
    const double error = glm::dot(r, r);
    if (best_error < 0 || error < best_error) {
      best_error = error;
      best = uv;
    }
    const double size = glm::length(c[3] - c[0]) + glm::length(c[2] - c[1]);
    if (best_error <= 1e-12 * size * size) break;
  }
  return best;
}

double patch_uv_pdf(const PatchCorners& c, DVec2 uv, DVec3 ref, DVec3 p) {
  const DVec3 to_light = p - ref;
  const double distance = glm::length(to_light), projected = std::abs(glm::dot(to_light, patch_normal(c, uv)));
  return projected > 0 ? distance * distance * distance / projected : 0;
}

}  // namespace woodcock
