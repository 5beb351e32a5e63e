// Affine maps applied to points, vectors and normals, in double.
#pragma once

#include "renderer/core/vec.h"

namespace woodcock {

inline DVec3 transform_point(const DMat4& m, DVec3 p) { return DVec3(m * glm::dvec4(p, 1)); }
inline DVec3 transform_vector(const DMat4& m, DVec3 v) { return DVec3(m * glm::dvec4(v, 0)); }
/// A normal is a covector: it goes by the inverse transpose, so the map's *inverse* is passed.
inline DVec3 transform_normal(const DMat4& inverse, DVec3 n) { return DVec3(glm::transpose(inverse) * glm::dvec4(n, 0)); }

}  // namespace woodcock
