// Glass, water, skin: the smooth or GGX-rough boundary of a dielectric body.
#pragma once

#include <optional>

#include "renderer/core/random.h"
#include "renderer/materials/bsdf_sample.h"
#include "renderer/materials/ggx.h"

namespace woodcock {

/// `eta` is the index of the inside (z < 0) over that of the outside. With eta = 1 there is no reflection and
/// rays go straight through, whatever the roughness. Rough: Walter et al. 2007, "Microfacet Models for
/// Refraction through Rough Surfaces", single scattering only.
struct DielectricBsdf {
  float eta = 1.5f;
  Ggx roughness;

  /// Both lobes are deltas.
  bool delta() const { return eta == 1 || roughness.smooth(); }
};

/// What a value carries across the boundary: radiance is divided by the squared relative index, importance
/// (the adjoint, needed by walks inside layered models) is not.
enum class Transport { kRadiance, kImportance };
/// Which lobes take part in sampling.
enum class Lobes { kBoth, kReflection, kTransmission };

Rgb eval(const DielectricBsdf& b, Vec3 wo, Vec3 wi, Transport transport = Transport::kRadiance);
float pdf(const DielectricBsdf& b, Vec3 wo, Vec3 wi, Lobes lobes = Lobes::kBoth);
std::optional<BsdfSample> sample(const DielectricBsdf& b, Vec3 wo, Stream& direction, Lobes lobes = Lobes::kBoth,
                                 Transport transport = Transport::kRadiance);
inline bool is_specular(const DielectricBsdf& b) { return b.delta(); }
inline Rgb albedo(const DielectricBsdf&, Vec3) { return Rgb(1); }

}  // namespace woodcock
