// Where along a ray a medium can be.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "renderer/media/medium.h"

namespace woodcock {

/// A part of a ray, in render units; empty where end ≤ begin.
struct Extent {
  double begin = 0, end = 0;
};

/// The part of ray.at(0 … t_max) that lies in the box of a grid; all of it where the medium is homogeneous; of a sum, from the
/// first of its parts to the last. In double, so that a march over it meets the same points whatever the scene's size.
inline Extent extent_of(const Medium& medium, const Ray& ray, double t_max) {
  Extent extent{0, t_max};
  if (medium.is_homogeneous()) return extent;
  if (!medium.parts().empty()) {
    Extent hull{std::numeric_limits<double>::infinity(), 0};
    for (const auto& part : medium.parts()) {
      const Extent of_part = extent_of(*part, ray, t_max);
      if (of_part.begin < of_part.end) hull = {std::min(hull.begin, of_part.begin), std::max(hull.end, of_part.end)};
    }
    return hull;
  }
  const CellBox& box = medium.majorants().box();
  const DVec3 o = medium.majorants().map().point(ray.o), d = medium.majorants().map().vector(ray.d);
  for (int i = 0; i < 3; ++i) {
    if (d[i] == 0) {
      if (o[i] < box.lower[i] || o[i] > box.upper[i]) return {};
      continue;
    }
    const double a = (box.lower[i] - o[i]) / d[i], b = (box.upper[i] - o[i]) / d[i];
    extent.begin = std::max(extent.begin, std::min(a, b));
    extent.end = std::min(extent.end, std::max(a, b));
  }
  return extent;
}

/// What a segment without end leads into: the coefficients there, and the distance from which on they hold.
struct UnboundedPart {
  double from;
  MediumPoint point;
};
/// Nothing where the segment has an end, or the medium on it has.
inline std::optional<UnboundedPart> unbounded_part(const Medium& medium, const Ray& ray, double t_max) {
  if (std::isfinite(t_max)) return std::nullopt;
  if (medium.is_homogeneous()) return UnboundedPart{0, medium.homogeneous()};
  UnboundedPart unbounded{0, {}};
  bool any = false;
  for (const auto& part : medium.parts()) {
    if (!part->is_homogeneous()) {
      unbounded.from = std::max(unbounded.from, extent_of(*part, ray, t_max).end);
      continue;
    }
    any = true;
    unbounded.point.sigma_t += part->homogeneous().sigma_t;
    unbounded.point.sigma_s += part->homogeneous().sigma_s;
    unbounded.point.emission += part->homogeneous().emission;
  }
  return any ? std::optional(unbounded) : std::nullopt;
}

}  // namespace woodcock
