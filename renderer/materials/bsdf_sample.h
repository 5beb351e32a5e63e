// What sampling a scattering model gives.
#pragma once

#include "renderer/core/vec.h"

namespace woodcock {

struct BsdfSample {
  Vec3 wi;                    ///< local
  Rgb weight{0};              ///< f(wo, wi)·|cos θi| / pdf; for a delta lobe the factor of the path's throughput
  float pdf = 0;              ///< per solid angle; 0 for a delta lobe; for layered models a proxy for MIS only
  bool specular = false;      ///< a delta lobe was sampled
  bool transmission = false;  ///< wi lies on the other side of the surface
  float eta = 1;              ///< of a transmission: refractive index of wi's side over wo's (for Russian roulette)
};

inline float abs_cos(Vec3 w) { return std::abs(w.z); }
inline bool same_hemisphere(Vec3 a, Vec3 b) { return a.z * b.z > 0; }
inline Vec3 mirror(Vec3 w) { return {-w.x, -w.y, w.z}; }

}  // namespace woodcock
