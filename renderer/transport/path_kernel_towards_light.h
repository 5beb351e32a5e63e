// The path loop in media: branches towards a light.
#pragma once

#include "renderer/transport/path_kernel.h"

namespace woodcock {

template <uint32_t kMask>
float PathKernel<kMask>::branch_probability(const PhaseMix& phase) const {
  if (!plan_.towards_light || !light_direction_ || !may_scatter()) return 0;
  return phase.pdf(-*light_direction_, *light_direction_) > kMinForwardPeak ? kBranchProbability : 0;
}

template <uint32_t kMask>
void PathKernel<kMask>::branch_towards_light(const PhaseMix& phase, Vec3 wo, DVec3 p, Vec3 to_light, float probability) {
  const PathKey branch = branch_key(key_, kTowardsLightBranch);
  Stream direction = stream(branch, vertex_, Purpose::kDirection);
  if (direction.uniform_double() >= static_cast<double>(probability)) return;
  const Vec2 u = direction.uniform2();
  const auto sample = phase.sample(-to_light, u, direction.uniform());
  const Rgb weight = phase.eval(wo, sample.wi) / (phase.pdf(wo, sample.wi) + probability * sample.pdf);
  if (is_black(weight)) return;

  // begin_segment() gives the path its own numbers again.
  const auto path = std::tuple(key_, beta_, ray_);
  key_ = branch;
  beta_ *= weight;
  ray_ = {p, sample.wi, ray_.time};
  begin_segment();
  note([&] { return BranchStarts{sample.wi, beta_}; });
  ++count_.rays;
  const auto hit = find_hit();
  const auto t = sample_distance(hit ? hit->t : no_hit_until_);
  if (!ended_) note([&] { return SegmentEnds{t, beta_}; });
  if (t && !ended_) {
    const DVec3 at = point_before(world_, ray_, *t, hit, uses(kTouching));
    const PhaseMix phase_there = world_.media[medium_].phase_at(at);
    const Vec3 wo_there(-ray_.d);
    note([&] { return MediumScatters{at, wo_there, *t, medium_}; });
    sample_light(at, [&](Vec3 wi, Scattered& scattered) {
      scattered = {phase_there.eval(wo_there, wi), phase_there.pdf(wo_there, wi), {at, wi, ray_.time}, medium_, true};
    });
  }
  note([] { return BranchEnds{}; });
  std::tie(key_, beta_, ray_) = path;
  ended_ = sample_.stopped;
}

}  // namespace woodcock
