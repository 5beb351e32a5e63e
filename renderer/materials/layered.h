// A dielectric coat over a diffuse or metallic base, with a scattering medium between.
//
// The model is pbrt-v4's LayeredBxDF (Pharr, Jakob, Humphreys 2023, "Physically Based Rendering", §14.3; after Guo, Hašan
// & Zhao 2018, "Position-Free Monte Carlo Simulation for Arbitrary Layered BSDFs"): the layers are flat, infinite and
// at one point, and light walks between them at random. Both functions below count the same paths, those with at
// most `max_depth` scatterings between entering and leaving:
//
//   eval     estimates f(wo, wi)·|cos θi| by walks from wo that are joined at every vertex to a direction refracted in
//            from wi, and to the walk's own next direction, MIS-weighted. Unbiased; the numbers come from `layered`.
//   sample   walks until the light leaves; the weight is that walk's own contribution over its probability.
//
// The density of leaving along wi has no closed form. `pdf` is a deterministic proxy with the right peaks. Multiple
// importance sampling stays unbiased with it: light sampling gets the weight pl/(pl + q) and a walk that leaves along wi
// gets q/(pl + q), with the same deterministic q(wo, wi); they sum to one for every wi, and each strategy alone is
// unbiased because eval and sample are. A poor proxy only costs variance.
//
// Two kinds have closed forms, the sum over the same paths, and need no walk (layered_closed_forms.h): an absorbing coat over a
// diffuse base, and one smooth boundary over a smooth metal. Their density is exact.
#pragma once

#include <optional>

#include "renderer/core/random.h"
#include "renderer/materials/bsdf_sample.h"
#include "renderer/materials/coat_table.h"
#include "renderer/materials/conductor.h"
#include "renderer/materials/dielectric.h"
#include "renderer/materials/diffuse.h"

namespace woodcock {

/// The upper boundary and the medium below it, whose extinction coefficient is 1 over a length of `thickness`.
/// It absorbs when its albedo is black. Both sides of the surface are coated.
struct Coat {
  DielectricBsdf boundary;
  float thickness = 0.01f;
  float g = 0;    ///< Henyey-Greenstein mean cosine, |g| < 1
  Rgb albedo{0};  ///< single scattering, in [0, 1]
  int max_depth = 10;
  int samples = 1;     ///< walks averaged by one `eval`
  bool walks = false;  ///< by walks even where there is a closed form

  bool scatters() const { return !is_black(albedo); }
};

struct CoatedDiffuseBsdf {
  Coat coat;
  DiffuseBsdf base;
  /// Of a coat that only absorbs and whose roughness is isotropic, made of this coat's parameters; null elsewhere. Outlives this.
  const CoatTable* table = nullptr;

  bool closed_form() const { return table != nullptr && !coat.walks; }
};
Rgb eval(const CoatedDiffuseBsdf& b, Vec3 wo, Vec3 wi, Stream& layered);
float pdf(const CoatedDiffuseBsdf& b, Vec3 wo, Vec3 wi);
std::optional<BsdfSample> sample(const CoatedDiffuseBsdf& b, Vec3 wo, Stream& direction, Stream& layered);
inline bool is_specular(const CoatedDiffuseBsdf&) { return false; }
Rgb albedo(const CoatedDiffuseBsdf& b, Vec3 wo);

/// The metal's index is relative to the coat.
struct CoatedConductorBsdf {
  Coat coat;
  ConductorBsdf base;

  /// Mirrors all through.
  bool delta() const { return coat.boundary.delta() && base.roughness.smooth() && !coat.scatters(); }
  bool closed_form() const { return delta() && !coat.walks; }
};
Rgb eval(const CoatedConductorBsdf& b, Vec3 wo, Vec3 wi, Stream& layered);
float pdf(const CoatedConductorBsdf& b, Vec3 wo, Vec3 wi);
std::optional<BsdfSample> sample(const CoatedConductorBsdf& b, Vec3 wo, Stream& direction, Stream& layered);
inline bool is_specular(const CoatedConductorBsdf& b) { return b.delta(); }
Rgb albedo(const CoatedConductorBsdf& b, Vec3 wo);

}  // namespace woodcock
