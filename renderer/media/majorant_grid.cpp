#include "renderer/media/majorant_grid.h"

#include <algorithm>
#include <limits>

namespace woodcock {

namespace {

/// Upper bounds are raised by this factor, lower ones divided by it: three interpolations and a product round by less than 8 units in the
/// last place.
constexpr float kRoundingAllowance = 1 + 0x1p-20f;
/// Coarsening stops here; larger bricks save no steps worth having.
constexpr int kMaxEdge = 64;

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

void MajorantGrid::follow(const MajorantGrid& other) {
  for (size_t i = 0; i < bounds_.size(); ++i)
    bounds_[i].upper = other.bounds_[i].upper > 0 ? std::max(bounds_[i].upper, std::numeric_limits<float>::min()) : 0;
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
  while (depth > 0 && depth < 1 && best.edge() < kMaxEdge && std::max({best.size().x, best.size().y, best.size().z}) > 1) {
    MajorantGrid next = best.coarser();
    const double next_depth = next.median_optical_depth();
    // Nearest on a scale of ratios: stay when next/1 exceeds 1/depth.
    if (next_depth * depth > 1) break;
    best = std::move(next);
    depth = next_depth;
  }
  return best;
}

}  // namespace woodcock
