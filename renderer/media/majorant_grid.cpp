#include "renderer/media/majorant_grid.h"

#include <algorithm>

namespace woodcock {

namespace {

/// Upper bounds are raised by this factor, lower ones divided by it: three interpolations and a product round by less than 8 units in the
/// last place.
constexpr float kRoundingAllowance = 1 + 0x1p-20f;
/// Coarsening stops here; larger bricks save no steps worth having.
constexpr int kLargestEdge = 64;

int ceil_div(int a, int b) { return a >= 0 ? (a + b - 1) / b : -(-a / b); }
int floor_div(int a, int b) { return a >= 0 ? a / b : -((-a + b - 1) / b); }

}  // namespace

MajorantGrid::MajorantGrid(IVec3 voxels, const CellBox& box, const GridMap& map, int edge) : edge_(edge), box_(box), map_(map) {
  // Bricks cover [0, voxels]; what lies up to half a cell beyond is bounded by the outermost bricks.
  for (int i = 0; i < 3; ++i) size_[i] = std::max(1, ceil_div(voxels[i], edge));
  bounds_.resize(static_cast<size_t>(size_.x) * size_.y * size_.z);
  least_.resize(bounds_.size());
}

// Brick b involves the voxels b e − 1 … b e + e.
IVec3 MajorantGrid::brick_of_first(IVec3 voxel) const {
  IVec3 b;
  for (int i = 0; i < 3; ++i) b[i] = std::clamp(ceil_div(voxel[i], edge_) - 1, 0, size_[i] - 1);
  return b;
}
IVec3 MajorantGrid::brick_of_last(IVec3 voxel) const {
  IVec3 b;
  for (int i = 0; i < 3; ++i) b[i] = std::clamp(floor_div(voxel[i] + 1, edge_), 0, size_[i] - 1);
  return b;
}

void MajorantGrid::add_block(IVec3 first, IVec3 last, float largest, float smallest) {
  if (!(largest > 0)) return;
  const IVec3 a = brick_of_first(first), b = brick_of_last(last);
  for (int z = a.z; z <= b.z; ++z)
    for (int y = a.y; y <= b.y; ++y)
      for (int x = a.x; x <= b.x; ++x) {
        const IVec3 brick{x, y, z};
        const size_t i = offset(brick);
        bounds_[i].upper = std::max(bounds_[i].upper, largest);
        least_[i].value = std::min(least_[i].value, smallest);
        const IVec3 shared = glm::max(glm::min(last, brick * edge_ + edge_) - glm::max(first, brick * edge_ - 1) + 1, IVec3(0));
        least_[i].voxels += static_cast<int64_t>(shared.x) * shared.y * shared.z;
      }
}

/// Whether the medium may end within the brick or at its faces: next to that a look-up may round to outside, where there is
/// nothing.
bool MajorantGrid::reaches_end(IVec3 brick) const {
  for (int i = 0; i < 3; ++i) {
    if (brick[i] == 0 || brick[i] == size_[i] - 1) return true;
    if (brick[i] * edge_ <= box_.lower[i] || (brick[i] + 1) * edge_ >= box_.upper[i]) return true;
  }
  return false;
}

void MajorantGrid::scale(float largest, float smallest) {
  const auto involved = static_cast<int64_t>(edge_ + 2) * (edge_ + 2) * (edge_ + 2);
  for (int z = 0; z < size_.z; ++z)
    for (int y = 0; y < size_.y; ++y)
      for (int x = 0; x < size_.x; ++x) {
        const size_t i = offset({x, y, z});
        BrickBounds& bounds = bounds_[i];
        const float least = least_[i].voxels == involved && !reaches_end({x, y, z}) ? least_[i].value : 0;
        const float allowance = bounds.upper == least ? 1 : kRoundingAllowance;
        bounds = {bounds.upper * largest * allowance, least * smallest / allowance};
      }
  least_ = {};
}

MajorantGrid MajorantGrid::coarser() const {
  MajorantGrid result = *this;
  result.edge_ = 2 * edge_;
  result.size_ = (size_ + 1) / 2;
  result.bounds_.assign(static_cast<size_t>(result.size_.x) * result.size_.y * result.size_.z, {0, kInf});
  for (int z = 0; z < size_.z; ++z)
    for (int y = 0; y < size_.y; ++y)
      for (int x = 0; x < size_.x; ++x) {
        const BrickBounds& part = bounds_[offset({x, y, z})];
        BrickBounds& whole = result.bounds_[result.offset({x / 2, y / 2, z / 2})];
        whole = {std::max(whole.upper, part.upper), std::min(whole.lower, part.lower)};
      }
  return result;
}

double MajorantGrid::median_optical_depth() const {
  std::vector<float> filled;
  for (const BrickBounds& b : bounds_)
    if (b.upper > 0) filled.push_back(b.upper);
  if (filled.empty()) return 0;
  const auto middle = filled.begin() + static_cast<ptrdiff_t>(filled.size() / 2);
  std::nth_element(filled.begin(), middle, filled.end());
  return *middle * edge_ * map_.cell_edge();
}

float MajorantGrid::maximum() const {
  float largest = 0;
  for (const BrickBounds& b : bounds_) largest = std::max(largest, b.upper);
  return largest;
}

MajorantGrid choose_brick_edge(MajorantGrid finest) {
  MajorantGrid best = std::move(finest);
  double depth = best.median_optical_depth();
  while (depth > 0 && depth < 1 && best.edge() < kLargestEdge && std::max({best.size().x, best.size().y, best.size().z}) > 1) {
    MajorantGrid next = best.coarser();
    const double next_depth = next.median_optical_depth();
    // Nearest on a scale of ratios: stay when next/1 exceeds 1/depth.
    if (next_depth * depth > 1) break;
    best = std::move(next);
    depth = next_depth;
  }
  return best;
}

BrickWalk::BrickWalk(const MajorantGrid& grid, const Ray& ray, float t_max, double margin) {
  const DVec3 o = grid.map().point_exact(DVec3(ray.o)), d = grid.map().vector_exact(DVec3(ray.d));
  const CellBox box{grid.box().lower - margin, grid.box().upper + margin};
  // Clip to the box. A ray parallel to a pair of faces is inside when it lies between or on them; dividing by its
  // zero (of either sign) is never tried.
  double t0 = 0, t1 = t_max;
  double inverse[3];
  for (int i = 0; i < 3; ++i) {
    inverse[i] = 1 / d[i];
    if (!std::isfinite(inverse[i])) {
      if (!(o[i] >= box.lower[i] && o[i] <= box.upper[i])) return;
      continue;
    }
    double a = (box.lower[i] - o[i]) * inverse[i], b = (box.upper[i] - o[i]) * inverse[i];
    if (a > b) std::swap(a, b);
    t0 = std::max(t0, a);
    t1 = std::min(t1, b);
  }
  t_ = static_cast<float>(t0);
  t_end_ = static_cast<float>(t1);
  if (!(t_ < t_end_)) return;

  const double edge = grid.edge();
  const IVec3 size = grid.size();
  IVec3 brick;
  const ptrdiff_t unit[3] = {1, size.x, static_cast<ptrdiff_t>(size.x) * size.y};
  for (int i = 0; i < 3; ++i) {
    // The outermost bricks reach to the ends of the box.
    brick[i] = static_cast<int>(std::clamp(std::floor((o[i] + t0 * d[i]) / edge), 0.0, size[i] - 1.0));
    steps_[i] = 0;
    if (!std::isfinite(inverse[i])) {
      left_[i] = 0;
      stride_[i] = 0;
      face_t_[i] = next_t_[i] = std::numeric_limits<double>::infinity();
      face_dt_[i] = 0;
      continue;
    }
    const bool forward = d[i] > 0;
    left_[i] = forward ? size[i] - 1 - brick[i] : brick[i];
    stride_[i] = forward ? unit[i] : -unit[i];
    face_t_[i] = ((brick[i] + (forward ? 1 : 0)) * edge - o[i]) * inverse[i];
    face_dt_[i] = edge * std::abs(inverse[i]);
    next_t_[i] = left_[i] > 0 ? face_t_[i] : std::numeric_limits<double>::infinity();
  }
  bounds_ = grid.data();
  brick_ = static_cast<ptrdiff_t>(grid.offset(brick));
}

std::optional<MajorantSegment> BrickWalk::next() {
  while (bounds_ != nullptr) {
    // The nearest face; of equally near ones the first axis steps first, and the others follow over segments of
    // length zero. Each step lowers `left_`, so the walk ends.
    const int axis = next_t_[0] <= next_t_[1] ? (next_t_[0] <= next_t_[2] ? 0 : 2) : (next_t_[1] <= next_t_[2] ? 1 : 2);
    const BrickBounds bounds = bounds_[brick_];
    const float t0 = t_;
    float t1 = static_cast<float>(next_t_[axis]);
    if (t1 < t_end_) {
      brick_ += stride_[axis];
      --left_[axis];
      ++steps_[axis];
      next_t_[axis] = left_[axis] > 0 ? face_t_[axis] + steps_[axis] * face_dt_[axis] : std::numeric_limits<double>::infinity();
    } else {
      t1 = t_end_;
      bounds_ = nullptr;
    }
    if (!(t1 > t0)) continue;
    t_ = t1;
    if (bounds.upper > 0) return MajorantSegment{t0, t1, bounds.upper, bounds.lower};
  }
  return std::nullopt;
}

}  // namespace woodcock
