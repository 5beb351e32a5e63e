// Voxel data as read from a scene file, NanoVDB or OpenVDB: plain, immutable, shareable.
#pragma once

#include <cstddef>
#include <memory>
#include <variant>
#include <vector>

#include "renderer/core/vec.h"

namespace woodcock {

/// A dense grid: x fastest, samples at voxel centres, trilinear, zero outside the box p0..p1 in medium space.
template <typename T>
struct DenseGrid {
  IVec3 size{0};
  DVec3 p0{0}, p1{1};
  std::vector<T> values;

  const T& at(int x, int y, int z) const { return values[(static_cast<size_t>(z) * size.y + y) * size.x + x]; }
};

/// A sparse float tree, kept as a NanoVDB buffer (NanoVDB's own layout, aligned to 32 bytes) that holds exactly
/// one grid of type float. Voxel (i,j,k) has its sample at index-space point (i,j,k); `medium_from_index`
/// is the grid's own affine map. Background must be zero.
struct SparseGrid {
  std::shared_ptr<const std::byte[]> buffer;
  size_t bytes = 0;
  DMat4 medium_from_index{1};
  IVec3 index_min{0}, index_max{0};  ///< inclusive bounds of the active voxels
  float maximum = 0;                 ///< over active voxels and tiles
};

using FloatVolume = std::variant<DenseGrid<float>, SparseGrid>;
using RgbVolume = DenseGrid<Rgb>;

}  // namespace woodcock
