// Trilinear interpolation of eight neighbours in an array.
#pragma once

#include <cstddef>

#include "renderer/core/vec.h"

namespace woodcock {

/// a + f (b − a), with one rounding of the sum.
inline float lerp_fma(float f, float a, float b) { return std::fma(f, b - a, a); }
inline Vec3 lerp_fma(float f, Vec3 a, Vec3 b) { return {lerp_fma(f, a.x, b.x), lerp_fma(f, a.y, b.y), lerp_fma(f, a.z, b.z)}; }

/// Interpolates between v[0] and its neighbours +1, +row, +slice; `f` are the weights of the upper neighbours.
template <typename T>
T trilinear(const T* v, size_t row, size_t slice, Vec3 f) {
  const T* w = v + slice;
  const T v0 = lerp_fma(f.y, lerp_fma(f.x, v[0], v[1]), lerp_fma(f.x, v[row], v[row + 1]));
  const T v1 = lerp_fma(f.y, lerp_fma(f.x, w[0], w[1]), lerp_fma(f.x, w[row], w[row + 1]));
  return lerp_fma(f.z, v0, v1);
}

}  // namespace woodcock
