// The path loop at surfaces: light sampled there, and the direction in which the path goes on.
#pragma once

#include "renderer/transport/path_kernel.h"

namespace woodcock {

template <uint32_t kMask>
template <typename Model>
inline bool PathKernel<kMask>::scatter_at_surface(const SurfaceVertex& v, const Model& bsdf) {
  const SurfacePoint& s = v.s;
  note([&] { return SurfaceScatters{s.p, -ray_.d, s.ng, s.ns, s.dpdu, v.material}; });
  const Frame frame = uses(kGeneralSurfaces) ? shading_frame(v.ns, s.dpdu) : Frame::from_normal(v.ns);
  const Vec3 wo = frame.to_local(Vec3(-ray_.d));
  if (aov_weight_ > 0) record_first_hit(albedo(bsdf, wo), v.ns);
  if (!may_scatter()) return false;
  next_vertex();
  // The flight to an earlier scattering in a medium could not have made this vertex.
  if (uses(kEquiangular)) last_flight_.reset();

  Stream layered = stream(key_, vertex_, Purpose::kLayered);
  if (is_specular(bsdf)) return leave_surface(v, bsdf, frame, wo, layered);
  sample_lights(s.p, [&](Vec3 wi, Scattered& scattered) {
    const Vec3 local = frame.to_local(wi);
    const bool transmission = local.z * wo.z < 0;
    leave(v.hit, wi, v.next, transmission);
    scattered = {eval_model(bsdf, wo, local, layered), woodcock::pdf(bsdf, wo, local), ray_towards(s, wi),
                 medium_after_leaving(v, wi, transmission)};
  });
  return split([&](PathKernel& part, bool is_path) {
    return part.leave_surface(v, bsdf, frame, wo, is_path ? layered : stream(part.key_, vertex_, Purpose::kLayered));
  });
}

template <uint32_t kMask>
template <typename Model>
inline bool PathKernel<kMask>::leave_surface(const SurfaceVertex& v, const Model& bsdf, const Frame& frame, Vec3 wo, Stream layered) {
  const SurfacePoint& s = v.s;
  Stream direction = stream(key_, vertex_, Purpose::kDirection);
  const auto sample = sample_model(bsdf, wo, direction, layered);
  if (!sample) return false;
  beta_ *= sample->weight;
  if (is_black(beta_)) return false;
  if (sample->transmission) eta_scale_ *= sample->eta * sample->eta;
  if (uses(kRefractedLight)) {
    refraction_.reset();
    if (sample->specular && sample->transmission && direction_pdf_ > 0) refraction_ = {&v.info, v.met, reference_, s.p, direction_pdf_};
  }
  const Vec3 wi = glm::normalize(frame.to_world(sample->wi));
  medium_ = medium_after_leaving(v, wi, sample->transmission);
  leave(v.hit, wi, v.next, sample->transmission);
  ray_ = ray_towards(s, wi);
  direction_pdf_ = sample->specular ? 0 : sample->pdf;
  note([&] { return DirectionTaken{wi, direction_pdf_, beta_}; });
  after_scattering(s.p);
  return survives_roulette();
}

}  // namespace woodcock
