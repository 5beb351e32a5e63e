// Unpacking NanoVDB trees into bricks.
#include "renderer/media/brick_field.h"

#include <nanovdb/NanoVDB.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <stdexcept>

#include "renderer/media/grid_mean.h"

namespace woodcock {

namespace {

using Tree = nanovdb::FloatTree;
using Leaf = Tree::LeafNodeType;
using Accessor = nanovdb::DefaultReadAccessor<float>;

constexpr int64_t kMaxNodes = 1 << 26;  // 256 MiB of table: a box of about 50 000³ voxels

nanovdb::Coord coord(IVec3 v) { return {v.x, v.y, v.z}; }
int floor_to(int value, int step) { return value & ~(step - 1); }

/// The value of a 128³ block that is a tile or background as a whole; nothing if it has a node of its own.
std::optional<float> block_value(const Tree& tree, IVec3 origin) {
  const auto* upper = tree.root().probeChild(coord(origin));
  if (upper != nullptr && upper->probeChild(coord(origin)) != nullptr) return std::nullopt;
  return tree.getValue(coord(origin));
}

}  // namespace

/// Unpacks a tree.
class SparseField::Builder {
 public:
  Builder(SparseField& field, const Tree& tree, IVec3 origin, Values values)
      : field_(field), tree_(tree), accessor_(tree.root()), origin_(origin), values_(values) {}

  void build() {
    const IVec3 n = field_.node_size_;
    for (int z = 0; z < n.z; ++z)
      for (int y = 0; y < n.y; ++y)
        for (int x = 0; x < n.x; ++x) field_.nodes_.push_back(node(origin_ + kNodeCells * IVec3(x, y, z)));
  }

 private:
  /// Values that no density has are read as 0, and counted once, in the brick that owns the voxel.
  float clean(float value, bool owned) {
    if ((value >= 0 || values_ == Values::kAnySign) && std::isfinite(value)) return value;
    if (owned) ++(std::isfinite(value) ? field_.negative_ : field_.non_finite_);
    return 0;
  }

  /// What a block and its upper neighbours hold where each is constant: bricks and nodes of equal `Octet` are equal.
  using Octet = std::array<float, 8>;

  int node(IVec3 corner) {
    // The node reads one layer of its upper neighbours.
    Octet values;
    bool constant = true;
    for (int i = 0; i < 8 && constant; ++i) {
      const std::optional<float> value = block_value(tree_, corner + kNodeCells * IVec3(i & 1, i >> 1 & 1, i >> 2));
      constant = value.has_value();
      values[i] = clean(value.value_or(0), false);
    }
    if (!constant) return unpack_node(corner);
    const auto known = constant_nodes_.find(values);
    return known != constant_nodes_.end() ? known->second : constant_nodes_[values] = unpack_node(corner);
  }

  int unpack_node(IVec3 corner) {
    std::vector<int> bricks(4096);
    for (int i = 0; i < 4096; ++i) bricks[static_cast<size_t>(i)] = brick(corner + 8 * IVec3(i & 15, i >> 4 & 15, i >> 8));
    return field_.add_node(bricks);
  }

  int brick(IVec3 corner) {
    // The eight 8³ blocks that the brick reads from: a leaf, or one value.
    std::array<const Leaf*, 8> leaf;
    Octet value;
    bool constant = true;
    for (int i = 0; i < 8; ++i) {
      const nanovdb::Coord c = coord(corner + 8 * IVec3(i & 1, i >> 1 & 1, i >> 2));
      leaf[i] = accessor_.probeLeaf(c);
      value[i] = leaf[i] != nullptr ? 0 : clean(accessor_.getValue(c), i == 0);
      constant = constant && leaf[i] == nullptr;
    }
    if (!constant) return unpack_brick(leaf, value);
    const auto known = constant_bricks_.find(value);
    return known != constant_bricks_.end() ? known->second : constant_bricks_[value] = unpack_brick(leaf, value);
  }

  int unpack_brick(const std::array<const Leaf*, 8>& leaf, const Octet& value) {
    float* v = scratch_.data();
    for (int z = 0; z < 9; ++z)
      for (int y = 0; y < 9; ++y)
        for (int x = 0; x < 9; ++x, ++v) {
          const int block = (x >> 3) | (y >> 3) << 1 | (z >> 3) << 2;
          // A leaf stores z fastest.
          *v = leaf[block] == nullptr ? value[block]
                                      : clean(leaf[block]->data()->getValue((x & 7) << 6 | (y & 7) << 3 | (z & 7)), block == 0);
        }
    return field_.add_brick(scratch_);
  }

  SparseField& field_;
  const Tree& tree_;
  Accessor accessor_;
  IVec3 origin_;
  Values values_;
  std::map<Octet, int> constant_nodes_, constant_bricks_;
  std::vector<float> scratch_ = std::vector<float>(kBrickValues);
};

SparseField::SparseField(const SparseGrid& grid, const DMat4& render_from_medium, Values values) {
  const IVec3 min = grid.index_min, max = grid.index_max;
  if (grid.buffer == nullptr || max.x < min.x || max.y < min.y || max.z < min.z) return;
  // Cells count from a corner that is aligned to NanoVDB's nodes and lies below the first sample, so that cell
  // coordinates are small and positive wherever the grid lies.
  IVec3 origin;
  for (int i = 0; i < 3; ++i) origin[i] = floor_to(min[i] - 1, kNodeCells);
  voxels_ = max - origin + 1;
  to_storage_ = -0.5f;
  int64_t nodes = 1;
  for (int i = 0; i < 3; ++i) {
    // Samples up to max + 1 are base corners of look-ups.
    node_size_[i] = (max[i] + 1 - origin[i]) / kNodeCells + 1;
    nodes *= node_size_[i];
    if (nodes > kMaxNodes) throw std::length_error("the box of active voxels is too large");
  }
  DMat4 index_from_cell{1};
  index_from_cell[3] = glm::dvec4(DVec3(origin) - 0.5, 1);
  map_ = GridMap(glm::inverse(render_from_medium * grid.medium_from_index * index_from_cell));
  nodes_.reserve(static_cast<size_t>(nodes));
  const auto* nano = reinterpret_cast<const nanovdb::FloatGrid*>(grid.buffer.get());
  Builder(*this, nano->tree(), origin, values).build();
  set_box({DVec3(min - origin) + 0.5, DVec3(max - origin) + 1.5});
}

void SparseField::set_box(const CellBox& box) {
  // A sample reaches one cell to each side.
  const CellBox reach{DVec3(0.5), DVec3(voxels_) + 0.5};
  box_ = {glm::max(box.lower, reach.lower), glm::min(box.upper, reach.upper)};
  lower_ = Vec3(box_.lower);
  upper_ = Vec3(box_.upper);
}

/// Calls f(first, last, value) for every voxel or constant block of voxels that is positive, each voxel once.
template <typename F>
void SparseField::for_each_block(F f) const {
  const auto values_of = [&](int brick) { return values_.data() + static_cast<size_t>(brick) * kBrickValues; };
  const auto constant = [&](int brick) {
    const float* v = values_of(brick);
    return std::all_of(v, v + kBrickValues, [&](float value) { return value == *v; });
  };
  for (size_t n = 0; n < nodes_.size(); ++n) {
    if (nodes_[n] < 0) continue;
    const IVec3 node_corner = kNodeCells * IVec3(n % node_size_.x, n / node_size_.x % node_size_.y, n / node_size_.x / node_size_.y);
    const int* bricks = bricks_.data() + (static_cast<size_t>(nodes_[n]) << 12);
    if (bricks[0] >= 0 && std::all_of(bricks, bricks + 4096, [&](int b) { return b == bricks[0]; }) && constant(bricks[0])) {
      f(node_corner, node_corner + (kNodeCells - 1), *values_of(bricks[0]));
      continue;
    }
    for (int b = 0; b < 4096; ++b) {
      if (bricks[b] < 0) continue;
      const IVec3 corner = node_corner + 8 * IVec3(b & 15, b >> 4 & 15, b >> 8);
      const float* v = values_of(bricks[b]);
      for (int z = 0; z < 8; ++z)
        for (int y = 0; y < 8; ++y)
          for (int x = 0; x < 8; ++x) {
            const IVec3 voxel = corner + IVec3(x, y, z);
            if (const float value = v[z * kSlice + y * kRow + x]; value > 0) f(voxel, voxel, value);
          }
    }
  }
}

void SparseField::add_bounds(MajorantGrid& bounds) const {
  for_each_block([&](IVec3 first, IVec3 last, float value) { bounds.add_block(first, last, value); });
}

double SparseField::mean() const {
  // Weights of voxels along each axis, summed up from the first, so that those of a block are a difference.
  std::vector<double> sums[3];
  for (int i = 0; i < 3; ++i) {
    const std::vector<double> weights = hat_integrals(node_size_[i] * kNodeCells, box_.lower[i], box_.upper[i]);
    sums[i].assign(1, 0.0);
    for (const double w : weights) sums[i].push_back(sums[i].back() + w);
  }
  double sum = 0;
  for_each_block([&](IVec3 first, IVec3 last, float value) {
    double weight = static_cast<double>(value);
    for (int i = 0; i < 3; ++i) weight *= sums[i][static_cast<size_t>(last[i] + 1)] - sums[i][static_cast<size_t>(first[i])];
    sum += weight;
  });
  const DVec3 extent = box_.upper - box_.lower;
  return sum > 0 ? sum / (extent.x * extent.y * extent.z) : 0;
}

}  // namespace woodcock
