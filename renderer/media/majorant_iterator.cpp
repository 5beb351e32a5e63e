#include "renderer/media/majorant_iterator.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "renderer/media/extent.h"

namespace woodcock {

BrickIterator::BrickIterator(const MajorantGrid& grid, const Ray& ray, double t_max, double margin) {
  const DVec3 o = grid.map().point(ray.o), d = grid.map().vector(ray.d);
  const CellBox& box = grid.box();
  // Clip to the box. A ray parallel to a pair of faces is inside when it lies between or on them; dividing by its
  // zero (of either sign) is never tried.
  double t0 = 0, t1 = t_max;
  double inverse[3];
  for (int i = 0; i < 3; ++i) {
    inverse[i] = 1 / d[i];
    const double lower = box.lower[i] - margin, upper = box.upper[i] + margin;
    if (!std::isfinite(inverse[i])) {
      if (!(o[i] >= lower && o[i] <= upper)) return;
      continue;
    }
    const double a = (lower - o[i]) * inverse[i], b = (upper - o[i]) * inverse[i];
    t0 = std::max(t0, std::min(a, b));
    t1 = std::min(t1, std::max(a, b));
  }
  t_ = t0;
  t_end_ = t1;
  if (!(t_ < t_end_)) return;

  const double edge = grid.edge(), per_edge = 1 / edge;  // exact: edges are powers of two
  const IVec3 size = grid.size();
  const ptrdiff_t unit[3] = {1, size.x, static_cast<ptrdiff_t>(size.x) * size.y};
  for (int i = 0; i < 3; ++i) {
    // The outermost bricks reach to the ends of the box. The sign of a direction is as good as random: no branches on it.
    const double last = size[i] - 1.0, forward = d[i] > 0 ? 1 : 0;
    const auto brick = static_cast<int>(std::min(std::max(0.0, (o[i] + t0 * d[i]) * per_edge), last));
    brick_ += brick * unit[i];
    steps_[i] = 0;
    if (!std::isfinite(inverse[i])) {
      last_step_[i] = face_dt_[i] = 0;
      stride_[i] = 0;
      face_t_[i] = next_t_[i] = std::numeric_limits<double>::infinity();
      continue;
    }
    const double b = brick;
    last_step_[i] = b + forward * (last - 2 * b);
    stride_[i] = unit[i] * (2 * static_cast<ptrdiff_t>(forward) - 1);
    face_t_[i] = ((b + forward) * edge - o[i]) * inverse[i];
    face_dt_[i] = edge * std::abs(inverse[i]);
    next_t_[i] = last_step_[i] > 0 ? face_t_[i] : std::numeric_limits<double>::infinity();
  }
  bounds_ = grid.data();
}

/// The walk through media that overlap.
class SumIterator {
 public:
  SumIterator(const Medium& sum, const Ray& ray, double t_max);
  std::optional<MajorantSegment> next();

 private:
  /// One part of the sum, and its segment that holds `t_` or comes next.
  struct Part {
    std::optional<MajorantSegment> segment;
    BrickIterator bricks;
  };

  std::vector<Part> parts_;
  double t_ = 0;  ///< where the next segment begins, or later
};

namespace {

std::optional<MajorantSegment> whole_of(const Medium& homogeneous, double t_max) {
  if (!(homogeneous.maximum_sigma_t() > 0) || !(t_max > 0)) return std::nullopt;
  return MajorantSegment{0, t_max, homogeneous.maximum_sigma_t(), min_component(homogeneous.homogeneous().sigma_t)};
}

std::optional<MajorantSegment> whole_box_of(const Medium& medium, const Ray& ray, double t_max) {
  const Extent extent = extent_of(medium, ray, t_max);
  if (!(extent.begin < extent.end) || !(medium.maximum_sigma_t() > 0)) return std::nullopt;
  return MajorantSegment{extent.begin, extent.end, medium.maximum_sigma_t(), 0};
}

}  // namespace

SumIterator::SumIterator(const Medium& sum, const Ray& ray, double t_max) {
  // Rounding may put a point outside of a grid's box, where the bound is that of the others alone, into it. Bounds hold a
  // little beyond the box.
  constexpr double kMargin = 0x1p-8;  // cells
  for (const auto& part : sum.parts()) {
    Part entered;
    if (part->has_bricks()) {
      entered.bricks = BrickIterator(part->majorants(), ray, t_max, kMargin);
      entered.segment = entered.bricks.next();
    } else {
      entered.segment = whole_of(*part, t_max);
    }
    parts_.push_back(entered);
  }
}

std::optional<MajorantSegment> SumIterator::next() {
  // Between two ends of parts' segments the bounds add. Sums run over the parts in order, as those of coefficients do, so
  // that rounding is the same in both and the bounds hold to the bit.
  while (true) {
    MajorantSegment sum{t_, kInf, 0, 0};
    bool pending = false, inside = false;
    for (const Part& part : parts_) {
      if (!part.segment) continue;
      pending = true;
      if (part.segment->t0 > t_) {
        sum.t1 = std::min(sum.t1, part.segment->t0);
        continue;
      }
      inside = true;
      sum.t1 = std::min(sum.t1, part.segment->t1);
      sum.sigma += part.segment->sigma;
      sum.lower += part.segment->lower;
    }
    if (!pending) return std::nullopt;
    t_ = sum.t1;
    for (Part& part : parts_)
      if (part.segment && part.segment->t1 <= t_) part.segment = part.bricks.next();
    if (inside) return sum;
  }
}

void MajorantIterator::DeleteSum::operator()(SumIterator* sum) const { delete sum; }

void MajorantIterator::enter(const Medium& medium, const Ray& ray, double t_max, bool bricks) {
  if (medium.is_homogeneous()) {
    whole_ = whole_of(medium, t_max);
  } else if (!bricks) {
    whole_ = whole_box_of(medium, ray, t_max);
  } else {
    sum_.reset(new SumIterator(medium, ray, t_max));
  }
}

std::optional<MajorantSegment> MajorantIterator::next_of(SumIterator& sum) { return sum.next(); }

}  // namespace woodcock
