#include "renderer/transport/paper_path.h"

#include "renderer/core/warp.h"

namespace woodcock {
namespace {

/// Delta lobes beside others in one model: uniform directions alone would miss the delta lobes.
bool has_delta_beside_others(const Bsdf& bsdf) {
  if (const auto* coated = std::get_if<CoatedDiffuseBsdf>(&bsdf)) return coated->coat.boundary.delta();
  if (const auto* coated = std::get_if<CoatedConductorBsdf>(&bsdf)) return coated->coat.boundary.delta() && !is_specular(bsdf);
  return false;
}

bool transmits(const Bsdf& bsdf) {
  return std::holds_alternative<DiffuseTransmissionBsdf>(bsdf) || std::holds_alternative<DielectricBsdf>(bsdf);
}

/// A direction uniform on the hemisphere of wo, or on the sphere: weight f |cos|/pdf.
BsdfSample sample_uniformly(const Bsdf& bsdf, Vec3 wo, Vec2 u, Stream& layered) {
  BsdfSample s;
  if (transmits(bsdf)) {
    s.wi = square_to_sphere(u);
    s.pdf = square_to_sphere_pdf();
    s.transmission = !same_hemisphere(s.wi, wo);
  } else {
    s.wi = square_to_hemisphere(u);
    if (wo.z < 0) s.wi = -s.wi;
    s.pdf = square_to_hemisphere_pdf();
  }
  s.weight = eval(bsdf, wo, s.wi, layered) / s.pdf;
  return s;
}

}  // namespace

std::optional<BsdfSample> scatter_uniformly(const Bsdf& bsdf, Vec3 wo, PathKey key, uint32_t vertex) {
  Stream direction = stream(key, vertex, Purpose::kDirection), layered = stream(key, vertex, Purpose::kLayered);
  const bool mixed = has_delta_beside_others(bsdf);
  const bool delta = is_specular(bsdf) || (mixed && stream(key, vertex, Purpose::kBranching).uniform() < 0.5f);
  std::optional<BsdfSample> scattered;
  if (delta) {
    scattered = sample(bsdf, wo, direction, layered);
    if (!scattered || !scattered->specular) return std::nullopt;
  } else {
    scattered = sample_uniformly(bsdf, wo, direction.uniform2(), layered);
  }
  scattered->weight *= mixed ? 2.0f : 1.0f;
  return scattered;
}

}  // namespace woodcock
